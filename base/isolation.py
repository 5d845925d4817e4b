"""A step after which others must still be done, whatever it raises: the stop of a drive, a subscriber, a feature."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable
from inspect import iscoroutinefunction
from types import TracebackType
from typing import Any

from multidrop.base.errors import Diagnostic, FeatureFailed, TransportLost
from multidrop.base.text import visible

LOG = logging.getLogger("multidrop")
OTHERS = "others"
"""The part of the log for features by others: what is in it is no defect of multidrop."""
MOST_SAID_FAILURES = 100
_said: set[str] = set()
"""The failures of features that were reported where no one keeps a log: an event comes ten times a second."""


def _report(what: str, failure: Exception) -> None:
    kept = LOG.hasHandlers()
    if isinstance(failure, Diagnostic) and not kept:  # it is for a person, without a traceback
        if (text := str(failure)) not in _said and len(_said) < MOST_SAID_FAILURES:
            _said.add(text)
            LOG.error("%s", visible(text))
    elif not isinstance(failure, FeatureFailed):
        LOG.error("%s failed", what, exc_info=failure)


def at_once(function: Callable[..., Any]) -> None:
    """Raise Diagnostic for an async function where a plain one is called: nothing would await it."""
    called = function if iscoroutinefunction(function) else getattr(function, "__call__", function)  # noqa: B004
    if iscoroutinefunction(called):
        name = getattr(function, "__name__", type(function).__name__)
        raise Diagnostic(
            f"{name} is async, and nothing awaits it", hint="give a plain function, which may start a task"
        )


def takes_signals() -> bool:
    """Whether an event loop runs in this thread: it takes the signals, so Ctrl+C raises no KeyboardInterrupt."""
    asyncio = sys.modules.get("asyncio")
    return asyncio is not None and asyncio._get_running_loop() is not None


class isolated:  # noqa: N801
    """Isolate a step: add the text of what it raises to `failed`, and write a defect to the log.

    It takes any exception, because other drives are still to be stopped after the step. A class, not
    a generator: each event of a bus passes here, and this takes a third of the time.

    With `exits`, an exit of the program is added to these, too: it waits until the other lines are stopped. Elsewhere
    it passes, as the handler of a signal may have raised it.
    """

    __slots__ = ("_exits", "_failed", "_what")

    def __init__(self, what: str, failed: list[str] | None = None, exits: list[SystemExit] | None = None) -> None:
        self._what, self._failed, self._exits = what, failed, exits

    def __enter__(self) -> None:
        return None

    def __exit__(
        self, kind: type[BaseException] | None, failure: BaseException | None, _: TracebackType | None
    ) -> bool:
        if self._exits is not None and isinstance(failure, SystemExit):
            self._exits.append(failure)
            return True
        if not isinstance(failure, Exception):
            return False
        text = str(failure)
        if not isinstance(failure, TransportLost | OSError):  # a defect, of whatever kind
            text = str(failure) if isinstance(failure, Diagnostic) else f"a defect: {type(failure).__name__}"
            _report(self._what, failure)
        if self._failed is not None:
            self._failed.append(text)
        return True
