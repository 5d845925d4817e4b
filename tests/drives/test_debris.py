"""What a stop cuts off is not shown as a line of a program's; what a program prints is."""

import asyncio

import pytest

from multidrop.dialects import Hints, Request
from multidrop.dialects.codec import Kind
from multidrop.dialects.mcode.host.codec import MCode
from multidrop.drives.bus import Bus
from multidrop.drives.events import Unsolicited
from multidrop.drives.inbox import LASTS, Debris
from multidrop.simulator.cells import read
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.in_process import SimPipe
from multidrop.simulator.serving.running import RunningFloor
from tests.support.cell_session import bus, party
from tests.support.virtual import in_virtual_time

ALONE = 'personality = "LMDCM"\nset = {{ EM = {}, CK = {}, ES = {} }}'


def opened(*drives, baud=9600):
    """A bus on simulated drives, and the lines that it hears."""
    floor = RunningFloor(Floor(read(bus("w", *drives, baud=baud), "cell")))
    made = Bus("w", SimPipe("sim:#w", floor, "w", lambda: None), baud=baud)
    heard = []
    made.watch(lambda event: heard.extend(event.lines) if isinstance(event, Unsolicited) else None)
    made.start()
    return made, heard, floor


@pytest.mark.wide
@pytest.mark.parametrize("names", [(), ("a", "b", "c")], ids=["alone", "party"])
@pytest.mark.parametrize("es", [1, 3])
@pytest.mark.parametrize("ck", [0, 1])
@pytest.mark.parametrize("em", [0, 1, 2, 3])
@in_virtual_time
async def test_nothing_of_a_poll_that_was_cut_off_is_shown(em, ck, es, names, nightly):
    drives = [party(name, EM=em, CK=ck, ES=es) for name in names] or [ALONE.format(em, ck, es)]
    line, heard, _ = opened(*drives)
    await line.identify(Hints(drives=names, party=bool(names)))
    line.telemetry.subscribe(names or ("",))
    for stop in range(0, 25, 1 if nightly else 12):
        await asyncio.sleep(0.2 + 0.00137 * stop)
        line.stop()
        await line.stopped()
        await asyncio.sleep(0.3)
    assert heard == []
    await line.close()


@in_virtual_time
async def test_opening_a_clean_line_again_right_behind_polls_shows_nothing():
    drives = [party("a", EM=0), party("b", EM=1, CK=0), party("c", EM=3, CK=0)]
    line, heard, floor = opened(*drives)
    for _ in range(5):
        await line.identify(Hints(drives=("a", "b", "c"), party=True))
        line.telemetry.subscribe(("a", "b", "c"))
        await asyncio.sleep(0.511)
        await line.close()
        line = Bus("w", SimPipe("sim:#w", floor, "w", lambda: None), baud=9600)
        line.watch(lambda event: heard.extend(event.lines) if isinstance(event, Unsolicited) else None)
        line.start()
    assert heard == []
    await line.close()


@pytest.mark.parametrize("em", [0, 1, 2, 3])
@in_virtual_time
async def test_what_a_program_prints_is_shown_up_to_its_stop_and_behind_it(em):
    line, heard, floor = opened(ALONE.format(em, 0, 1))
    await line.identify(Hints())
    device = floor.floor.drives[0].device
    for text in ("PG 1", "LB G1", "IC R1", 'PR "tick ",R1', "H 30", "BR G1", "E", "PG", "EX G1"):
        device.execute(text, floor.now())
    line.telemetry.subscribe(("",))
    await asyncio.sleep(1.0)
    line.stop()
    printed = int(device.execute("PR R1", floor.now()).lines[0])
    await line.stopped()  # until then a program is stopped again
    device.execute("EX G1", floor.now())
    await asyncio.sleep(0.5)
    whole = [text for text in heard if text.startswith("tick ")]
    assert whole[: printed - 1] == [f"tick {n}" for n in range(1, printed)]
    assert len(whole) > printed + 3
    await line.close()


@pytest.mark.parametrize(
    ("text", "debris"),
    [
        ("#", True),
        ("a#", True),
        ("~~~~", True),
        ("?~~~", True),
        (' P,"a', True),
        ("-12a 0", True),
        ("\x08\x00a 0", True),
        (" ", True),
        ('"', True),
        ('0"', True),
        ("0!", True),
        ("tick 100", False),
        ('say "hi"', False),
        ("100", False),
        ("b", False),
        ("at home", False),
    ],
)
def test_what_counts_as_debris(text, debris):
    asked = Request("a", 'PR P,"a ",V', Kind.PRINT, MCode(party=True), expect=r"(-?\d+)a (-?\d+)")
    left = Debris()
    left.request_written(b'aPR P,"a ",V\n', asked, 1.0)
    left.stop_written(b"\x1b~~~~~~\n", 2.0)
    assert left.removed(("x 1", text), MCode.stop_debris, 2.0 + LASTS) == (("x 1",) if debris else ("x 1", text))
    assert left.removed((text,), MCode.stop_debris, 2.1 + LASTS) == (text,), "later, everything is shown"
