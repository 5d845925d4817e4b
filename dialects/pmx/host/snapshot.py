"""Reading everything of a controller: settings, programs, counters and inputs. It moves and clears nothing."""

from __future__ import annotations

from multidrop.dialects.codec import Procedure
from multidrop.dialects.parameters import Progress
from multidrop.dialects.pmx.host import parameters
from multidrop.dialects.pmx.host.download import listing
from multidrop.dialects.pmx.host.exchange import answered, number
from multidrop.dialects.pmx.host.operations import PROGRAMS
from multidrop.dialects.pmx.host.state import PmxState
from multidrop.dialects.pmx.manual import status as words
from multidrop.dialects.pmx.manual.program_file import RAW
from multidrop.dialects.pmx.manual.table import AXES
from multidrop.dialects.snapshots import Levels, Snapshot

BAUDS = {1: 9600, 2: 19200, 3: 38400, 4: 57600, 5: 115200}
"""By DB (table 6.1)."""
INPUTS = range(1, 9)
POLARITY = 1 << 10
"""The bit of POLX that inverts the inputs."""
RUNNING = 1


def take(state: PmxState, progress: Progress) -> Procedure[Snapshot]:
    """Read a controller. Raises NoAnswer."""
    readings = yield from parameters.read(state, progress)
    identity = yield from answered(state, state.codec.request(state.address, "ID"))
    remarks = yield from _activity(state)
    counters = {}
    for key, word in (("position", "P"), ("encoder", "E")):
        counters[key] = (yield from number(state, f"{word}X")), (yield from number(state, f"{word}Y"))
    analog = (yield from number(state, "AI1")), (yield from number(state, "AI2"))
    values = readings.values
    levels = _levels(_whole(values.get("POLX")))
    return Snapshot(
        kind="pmx",
        product="PMX",
        part=identity.text,
        version=state.version,
        name=str(values.get("DN", state.name))[-2:] or state.address,
        baud=BAUDS.get(_whole(values.get("DB")), 0),
        readings=readings,
        program=(yield from _program(state)),
        counters=counters,
        inputs=levels.of((yield from number(state, levels.word))),
        levels=levels,
        active=bool(remarks),
        analog=analog,
        remarks=tuple(remarks),
    )


def _activity(state: PmxState) -> Procedure[list[str]]:
    remarks = []
    for axis in AXES:
        if (yield from number(state, f"MST{axis}")) & words.MOVING:
            remarks.append(f"{axis} moved while it was read: its position is one of that moment")
    for program in PROGRAMS:
        if (yield from number(state, f"SASTAT{program}")) == RUNNING:
            remarks.append(f"program {program} ran while it was read")
    return remarks


def _program(state: PmxState) -> Procedure[tuple[tuple[int, str], ...]]:
    listed = yield from listing(state)
    return tuple((int(row[1]), row[2]) for line in listed if (row := RAW.fullmatch(line)))


def _levels(polarity: int) -> Levels:
    """A bit of DI is 1 if the input is at ground, or with the other polarity if it is not."""
    return Levels("DI", tuple((n, n - 1) for n in INPUTS), inverted=not polarity & POLARITY)


def _whole(held: object) -> int:
    return held if isinstance(held, int) else 0
