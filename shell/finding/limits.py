"""The time limit of a search: a device that sends all the time would make it last for hours."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from multidrop.dialects import DriveState
from multidrop.dialects.families import seen
from multidrop.dialects.scanning import Reach, Scan, SearchOutcome
from multidrop.drives.bus import Bus

LEAST_SECONDS, TIMES_AS_LONG = 12.0, 4.0
"""A search may take this long, s, and this many times its estimate; each drive that is found gives it that again."""


async def searched(
    bus: Bus, scan: Scan, reach: Reach, found: Callable[[DriveState], None], step: Callable[[], None]
) -> SearchOutcome:
    """Search a bus. A search that the noise on its line makes too long ends, and its remark says what came."""
    limit = LEAST_SECONDS + TIMES_AS_LONG * scan.seconds(reach, round(bus.line.baud) or None)
    now = asyncio.get_running_loop().time
    with bus.link.received() as heard:
        try:
            async with asyncio.timeout(limit) as left:

                def another(state: DriveState) -> None:
                    left.reschedule(now() + limit)
                    found(state)

                return await bus.search(scan.search(reach, another, step))
        except TimeoutError:
            why = f", as the line is never quiet; {seen(bytes(heard), bus.roster.family.name)}" if heard else ""
            return SearchOutcome((f"given up after {limit:.0f} s before every address was asked{why}",))
