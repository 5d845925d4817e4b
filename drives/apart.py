"""Steps that must not fail each other: the stop of each line, an event for each watcher."""

from __future__ import annotations

import logging
from types import TracebackType

from multidrop.transports import TransportLost

LOG = logging.getLogger("multidrop")


class apart:  # noqa: N801
    """Isolate a step: add the text of what it raises to `failed`, and write a defect to the log.

    This is the one place that takes any exception: after the step, other drives are still to be stopped. A class, not
    a generator: each event of a bus passes here, and this takes a third of the time.
    """

    __slots__ = ("_failed", "_what")

    def __init__(self, what: str, failed: list[str] | None = None) -> None:
        self._what, self._failed = what, failed

    def __enter__(self) -> None:
        return None

    def __exit__(
        self, kind: type[BaseException] | None, failure: BaseException | None, _: TracebackType | None
    ) -> bool:
        if not isinstance(failure, Exception):
            return False
        if isinstance(failure, TransportLost | OSError):
            self._note(str(failure))
        else:  # a defect, of whatever kind
            self._note(f"a defect: {type(failure).__name__}")
            LOG.error("%s failed", self._what, exc_info=failure)
        return True

    def _note(self, text: str) -> None:
        if self._failed is not None:
            self._failed.append(text)
