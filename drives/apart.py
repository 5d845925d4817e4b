"""Steps of which one that fails must not keep the others back: the stop of a line, an event for each watcher."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator

from transports import TransportLost

LOG = logging.getLogger("multidrop")


@contextlib.contextmanager
def apart(what: str, failed: list[str] | None = None) -> Iterator[None]:
    """Do a step by itself. What it raises ends here: its text is added to `failed`, a defect goes to the log.

    This is the one place where any exception is taken: behind it stand drives that are still to be stopped.
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
