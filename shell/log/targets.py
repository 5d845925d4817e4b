"""The drive of a session for each place of a log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from multidrop.base.errors import Diagnostic
from multidrop.drives.drive import Drive
from multidrop.shell.line_syntax import EVERYONE, join_target
from multidrop.shell.log.steps import LoggedPoll, LoggedStep

if TYPE_CHECKING:
    from multidrop.shell.session import Session

Place = tuple[str, str]
"""Bus and address in the log."""


def targets(session: Session, steps: Sequence[LoggedStep | LoggedPoll]) -> Mapping[tuple[str, str], Drive]:
    """The drive for each place in the log. Raises Diagnostic."""
    places = dict.fromkeys((step.bus, step.drive) for step in steps if step.bus)
    return {place: _target(session, place, list(places)) for place in places}


def _target(session: Session, place: tuple[str, str], places: Sequence[tuple[str, str]]) -> Drive:
    """The drive for one place: of the same name, or the only one where the log has only one."""
    name, address = place
    if name not in session.buses and len({bus for bus, _ in places}) == len(session.buses) == 1:
        name = next(iter(session.buses))
    bus = session.buses.get(name)
    if bus is not None and (address in bus.drives or address in EVERYONE):
        return session.drive(name, address)
    if bus is not None and len(bus.drives) == 1 and len([each for each in places if each[0] == place[0]]) == 1:
        return next(iter(bus.drives.values()))
    logged = ", ".join(join_target(*each) for each in places if each[1] not in EVERYONE)
    opened = ", ".join(join_target(each, drive) for each, its in session.buses.items() for drive in its.drives)
    what = f"a bus {place[0]}" if bus is None else f"a drive {join_target(*place)}"
    raise Diagnostic(f"the log has {what}", hint=f"drives of the log: {logged or 'none'}; open: {opened or 'none'}")
