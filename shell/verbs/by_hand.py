"""The operation that reads the variables of the programs in a drive."""

from __future__ import annotations

from typing import TYPE_CHECKING

from multidrop.shell.operations.argument_types import Address
from multidrop.shell.operations.operation import Group, Operation

if TYPE_CHECKING:
    from multidrop.shell.session import Call

SHOWN = 40
"""The number of variables that the line names."""


async def variables(call: Call, address: Address = "") -> None:
    from multidrop.shell.channel import running, transferring
    from multidrop.shell.events import VariablesRead

    session, drive = call.session, call.drive(address)
    name = session.display_name(drive) or drive.shown
    with running(session, f"{name}: read variables") as progress:
        found = await transferring(drive, drive.family.values.by_hand.variables(progress))
    session.publish(VariablesRead(session.now(), drive.link.name, drive.address, found))
    others = [f"{each.name}={each.value}" for each in found if each.value]
    more = f" and {len(others) - SHOWN} more" if len(others) > SHOWN else ""
    rest = f"; not 0: {', '.join(others[:SHOWN])}{more}" if others else ", all 0"
    call.output(f"{name}: {len(found)} variables{rest}")


OPERATIONS = (
    Operation(
        variables,
        verb="/variables",
        group=Group.VALUES,
        help="""
Read the variables of the programs in a drive: those of its language, and those that a program declares.

Nothing is changed. On the screen the page of the same name edits them.
""",
    ),
)
