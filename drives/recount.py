"""Reading again what the scales of a drive rest on."""

from __future__ import annotations

from multidrop.dialects.codec import Priority
from multidrop.drives.drive import Drive


async def recount(drive: Drive, priority: Priority = Priority.OPERATOR) -> None:
    """Read the settings of each axis that has a scale, and warn once of what differs from what was accepted.

    The places of the machine of such an axis have no reference any more. Raises DriveError or TransportLost.
    """
    changed = await drive.run(drive.counting.reading(drive.family.units, drive.state, priority))
    drive.state.reference_lost(drive.anchored.intersection(changed))
    for axis, changes in changed.items():
        hint = f"/units {drive.address}{f'.{axis}' if axis else ''}".rstrip()
        why = f"its scale rests on that, so its own numbers are shown; {hint} accepts it as it is now"
        drive.link.notify(f"{drive.shown}: {', '.join(changes)}: {why}", drive.address, warning=True)
