"""How far each drive moved in this session: `/mileage` and `multidrop mileage`."""

import asyncio
import re
from collections import Counter, defaultdict, deque
from typing import Annotated, Any

from multidrop.base.errors import Diagnostic
from multidrop.base.feature import Feature
from multidrop.drives.events import Restarted, Sample
from multidrop.shell.at_session import AtSession
from multidrop.shell.batch.runner import run
from multidrop.shell.events import Entered
from multidrop.shell.operations.argument_types import Address, Url
from multidrop.shell.operations.operation import Operation
from multidrop.shell.operations.parameter import Argument
from multidrop.shell.setting_units import distance

Line = Annotated[str, Argument("a line, as for send", metavar="LINE")]
SETS = re.compile(r"(@\S+\s+)?((P|PX|PY)\s*=|SAP\s+1\s*,)", re.IGNORECASE)  # gives a position and moves nothing


class Mileage:
    def __init__(self, session: Any) -> None:
        self.session, self.moved, self.set_at = session, defaultdict[Any, Any](Counter), defaultdict[Any, Any](float)
        self.read: Any = defaultdict(dict)  # (line, address) -> axis -> the last readings: time, position, steps
        session.subscribe(self.take, Sample, Restarted, Entered)
        session.hooks.identified.append(lambda bus: bus.telemetry.subscribe(list(bus.drives), 0.05))

    def take(self, event: Any) -> None:
        inner = event if isinstance(event, Entered) else event.event
        drive = (event.bus, inner.address)
        if isinstance(inner, Sample):
            last = self.read[drive].setdefault(inner.axis, deque([(0.0, inner.position, 0)] * 2, maxlen=20))
            jump = last[-2][0] < max(self.set_at[drive], self.set_at[event.bus, "*"])  # one reading may be under way
            last.append((inner.at, inner.position, 0 if jump else abs(inner.position - last[-1][1])))
            self.moved[drive][inner.axis] += last[-1][2]
        elif isinstance(inner, Restarted):  # which is reported a moment after its jump was read
            for axis, last in self.read[drive].items() if inner.certain else ():
                self.moved[drive][axis] -= max(steps for _, _, steps in last)
                last.extend([(*last[-1][:2], 0)] * 20)
        elif SETS.match(inner.line):
            self.set_at[drive] = inner.at

    async def again(self, only: Any = None) -> list[Any]:
        """Return all drives, or one, once they were read again. One that does not reply holds this up for 2 s."""
        drives = [only] if only else [drive for bus in self.session.buses.values() for drive in bus.drives.values()]
        began, read = self.session.now(), [self.read[drive.link.name, drive.address].values() for drive in drives]
        while self.session.now() < began + 2 and not all(own and min(r[-2][0] for r in own) > began for own in read):
            await asyncio.sleep(0.02)
        return drives

    async def show(self, output: Any, only: Any = None) -> None:
        for drive in await self.again(only):
            for axis, steps in self.moved[drive.link.name, drive.address].items():
                name, way = self.session.display_name(drive), distance(self.session, drive, axis, steps).lstrip("-")
                output(f"{name}{axis and f'.{axis}'}: {steps} steps{way and f' ({way})'}")

    async def play(self, lines: tuple[str, ...]) -> None:
        for line in lines:
            await self.again()
            await self.session.run(line)
        await self.show(self.session.output)


async def show(call: Any, address: Address = "") -> None:
    drive = call.drive(address) if address else None
    if drive and drive.address not in call.session.buses[drive.link.name].drives:
        raise Diagnostic(f"no drive {address}", "/mileage", "/drives lists them")
    await call.session.hooks.part(Mileage).show(call.output, drive)


def play(url: Url, lines: tuple[Line, ...]) -> int:
    return run([url], lambda session: session.hooks.part(Mileage).play(lines))


FEATURE = Feature(
    "mileage",
    "how far drives moved",
    adds=(
        AtSession(lambda session: session.hooks.keep(Mileage(session))),
        Operation(
            show,
            verb="/mileage",
            help="Show how far each drive moved in this session.\nThere and back counts twice.",
        ),
        Operation(
            play,
            command="mileage",
            meaning="run lines, then show how far each drive moved",
            examples=("mileage 'sim:#press' 'MR 51200' '/wait stopped'",),
        ),
    ),
)
