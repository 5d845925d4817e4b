"""Whether a drive was active when it was last read: what counts, how old it may be, and when that is not known."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from multidrop.shell.at_rest import known_active
from tests.support.cases import for_each

NOW = 100.0


def drive(noted: Any = None, seen: Any = None, running: Any = None, commanded: float = 90.0) -> Any:
    """`noted`: time, active. `seen`: time, velocity. `running`: time, whether a program runs."""
    return SimpleNamespace(
        noted=noted,
        seen=seen and SimpleNamespace(at=seen[0], velocity=seen[1]),
        running=running and SimpleNamespace(at=running[0], runs=running[1]),
        commanded_at=commanded,
        link=SimpleNamespace(now=lambda: NOW),
    )


@for_each(
    "given, active",
    [
        ({}, None),
        ({"noted": (99.5, True)}, True),
        ({"noted": (99.0, True)}, None),  # a second old
        ({"noted": (99.5, True), "commanded": 99.5}, None),
        ({"noted": (99.6, True), "commanded": 99.5}, True),
        ({"noted": (91.0, False)}, False),
        ({"noted": (90.0, False)}, None),
        ({"noted": (91.0, False), "commanded": 92.0}, None),
        ({"seen": (99.5, 7)}, True),
        ({"seen": (99.5, -7)}, True),
        ({"seen": (98.9, 7)}, None),
        ({"seen": (99.5, 0)}, None),  # at rest, and a program may run
        ({"running": (99.5, True)}, True),
        ({"running": (98.9, True)}, None),
        ({"running": (99.5, False)}, None),
        ({"noted": (91.0, False), "seen": (99.5, 7)}, True),
        ({"noted": (91.0, False), "running": (99.5, True)}, True),
        ({"noted": (91.0, False), "seen": (98.0, 7)}, False),
    ],
)
def test_a_recent_reading_since_the_last_command_says_whether_a_drive_is_active(
    given: Any, active: bool | None
) -> None:
    assert known_active(drive(**given)) is active
