"""Steps that must not fail each other: the stop of each line, an event for each watcher."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator

from transports import TransportLost

LOG = logging.getLogger("multidrop")


@contextlib.contextmanager
def apart(what: str, failed: list[str] | None = None) -> Iterator[None]:
    """Isolate a step: add the text of what it raises to `failed`, and write a defect to the log.

    This is the one place that takes any exception: after the step, other drives are still to be stopped.
    """
    try:
        yield
    except (TransportLost, OSError) as failure:
        _note(failed, str(failure))
    except Exception as failure:  # a defect, of whatever kind
        _note(failed, f"a defect: {type(failure).__name__}")
        LOG.exception("%s failed", what)


def _note(failed: list[str] | None, text: str) -> None:
    if failed is not None:
        failed.append(text)
