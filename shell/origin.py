"""Where a line comes from. What the line does is given this with it, so nothing depends on the task that does it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from multidrop.shell.automation_record import Automation
from multidrop.shell.events import By, Output, Printed, SessionEvent
from multidrop.shell.line_syntax import split_target

NO_ROLES: Mapping[str, str] = MappingProxyType({})
"""No bus plays a role."""


@dataclass
class LastLine:
    """Where the next wait for a text of one sender of lines looks from."""

    printed: int | None = None
    """The number of lines that drives had printed before its last line for one; None: it has sent none."""


@dataclass(frozen=True, eq=False)
class Origin:
    """Who enters a line and to what it belongs. By default a person at the session.

    A line of a script or macro has the origin of the line that runs the script or macro, with some fields replaced.
    """

    by: By = By.OPERATOR
    automation: Automation | None = None
    """The automation that it is a part of: its early end stops what the line starts. None: a person's line."""
    roles: Mapping[str, str] = field(default_factory=lambda: NO_ROLES)
    """The bus for each role of the macro that it is a line of."""
    heard: Callable[[SessionEvent], None] | None = None
    """Takes what the line enters and prints, for the script that it is a line of."""
    printed: list[str] | None = None
    """Takes the lines that it prints, for the call of a program that it is of."""
    outcome: list[str] | None = None
    """Takes the word of a `/wait ended`, for the script that it is a line of."""
    last: LastLine | None = None
    """What its sender has sent last; None: its waits look from the last line of anyone."""
    may_leave_travel: bool = False
    """Its moves may leave their travel."""
    published: list[BaseException] | None = None
    """The failures that were published already in the line, of a person or a program, that it is a part of."""

    def sequence(self, person: object) -> object:
        """Who sends lines like this one after the other: an automation, else the person at the session."""
        return self.automation or person

    def hear(self, event: SessionEvent) -> None:
        """Hand what the line enters or prints to whom it is for."""
        if self.heard is not None:
            self.heard(event)
        if self.printed is not None and isinstance(event, Printed | Output):
            self.printed.append(event.text)

    def bus_of_role(self, name: str) -> str:
        """The name of the bus that plays a role; any other name stays."""
        return self.roles.get(name, name)

    def target(self, target: str) -> tuple[str, str]:
        """The name of a bus and the address of a target, of which each may be empty."""
        bus, address = split_target(target)
        return self.bus_of_role(bus), address

    def cast(self, roles: Mapping[str, str]) -> Origin:
        """The same with further roles."""
        return replace(self, roles={**self.roles, **roles})


PERSON = Origin()
"""The origin of what a person types."""
