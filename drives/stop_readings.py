"""What a drive does after a stop, as it is read, and published."""

from __future__ import annotations

from typing import NamedTuple

from multidrop.base.errors import DriveError, Stopped, TransportLost
from multidrop.drives.drive import Drive
from multidrop.drives.events import Sample


class Activity(NamedTuple):
    """What a drive did when it was read; nothing, where that is not known."""

    speed: int = 0
    """Unsigned, of its fastest axis."""
    runs: bool = False
    """A program runs."""
    places: tuple[tuple[str, int], ...] = ()
    """Axis and position of each of its axes; empty: not read."""

    @property
    def none(self) -> bool:
        """Whether it neither moves nor runs a program, or nothing is known."""
        return not self.speed and not self.runs

    def lessens(self, before: Activity | None, ends_after_motion: bool = False) -> bool:
        """Whether it slows down, as far as two readings show, and no program runs that can move it again.

        `ends_after_motion`: the stop ends a program only once its motion is over, so one may run until then.
        """
        goes_on = self.runs and not (ends_after_motion and self.speed)
        return not goes_on and (before is None or self.speed < before.speed)


NOTHING = Activity()
ENDLESS = Activity(1 << 40)
"""Of a drive that another stop kept from being read: faster than any."""


async def read_activity(drive: Drive, axes: frozenset[str] | None) -> tuple[Activity, str]:
    """Read and publish what a drive does; NOTHING with the reason where that cannot be read. `axes`: those that count.

    None: all axes.
    """
    if drive.programming and not drive.engaged:
        return NOTHING, "its velocity cannot be read in program mode"
    try:
        motions = await drive.motion()
        assert drive.seen is not None
        at = drive.seen.transmitted_at
        runs, why = motions[0].program, ""
        if runs is None and not any(axis.velocity for axis in motions):  # a drive that moves is stopped again
            try:
                runs = await drive.busy()
            except Stopped:
                raise
            except (TimeoutError, DriveError, TransportLost) as error:
                why = f"velocity 0 was read, and whether a program runs was not: {error}"
    except Stopped:
        return ENDLESS, ""
    except (TimeoutError, DriveError, TransportLost) as error:
        return NOTHING, f"its velocity could not be read: {error}"
    for motion in motions:
        drive.link.publish(
            Sample(at, drive.address, motion.position, motion.velocity, motion.axis, motion.trouble, runs)
        )
    speeds = zip(motions, drive.seen.velocities, strict=True) if drive.seen is not None and not why else ()
    # The only axis of a drive has no name, whatever number its lines give it.
    speed = max((abs(each) for axis, each in speeds if axes is None or not axis.axis or axis.axis in axes), default=0)
    counts = [motion for motion in motions if axes is None or not motion.axis or motion.axis in axes]
    places = () if why else tuple((count.axis, count.position) for count in counts)
    return Activity(speed, bool(runs) and not why, places), why
