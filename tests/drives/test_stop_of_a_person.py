"""A person's stop behind an automation's stop of some drives: it goes first, in its own order and with its purge.

An automation that ends early stops what it moved. Such a stop holds up a person's no more than any other line does.
"""

import asyncio
from collections.abc import AsyncIterator
from typing import Any

import pytest

from multidrop.dialects import Started
from multidrop.drives import pacing
from multidrop.drives.events import Traffic
from multidrop.drives.stop_forms import stop_forms
from tests.drives.test_whole_stop import SharedPipe, VirtualPacer
from tests.support.cell_session import drive, party, pmx
from tests.support.simulated_bus import SimulatedBus

pytestmark = pytest.mark.virtual

ONE_AXIS = Started(frozenset("x"), program=False, lasts=False)
FIRST_MOTOR = Started(frozenset("0"), program=False, lasts=False)
PROGRAM = Started()
NAMES = {"pmx": ("01", "02", "03"), "tmcl": ("1", "2", "3"), "mcode": ("a", "b", "c")}
CASES = {
    "pmx-axis": ("pmx", ONE_AXIS),
    "pmx-program": ("pmx", PROGRAM),
    "tmcl-motor": ("tmcl", FIRST_MOTOR),
    "tmcl-program": ("tmcl", PROGRAM),
    "mcode-ES0": ("mcode", PROGRAM),
    "mcode-ES1": ("mcode", PROGRAM),
    "mcode-ES2": ("mcode", PROGRAM),
    "mcode-ES3": ("mcode", PROGRAM),
}
SOONER_AND_LATER = (0.0, 0.005, 0.02, 0.045)
"""While the automation's stop is leaving, while its reply is due or comes, within the gap behind that, s."""


@pytest.fixture(autouse=True)
def pacer(monkeypatch: pytest.MonkeyPatch) -> VirtualPacer:
    made = VirtualPacer()
    monkeypatch.setattr(pacing, "PACER", made)
    return made


def drives(case: str, family: str) -> list[str]:
    if family == "pmx":
        return [pmx(name) for name in NAMES[family]]
    if family == "tmcl":
        return [drive("TMCM", name) for name in NAMES[family]]
    return [party(name, ES=int(case[-1])) for name in NAMES[family]]


class Shop(SimulatedBus):
    """A simulated bus that knows when it wrote."""

    def begin(self) -> None:
        super().begin()
        self.out: list[tuple[float, bytes]] = []
        write = self.floor.write

        def noted(bus: str, data: bytes, source: Any) -> None:
            self.out.append((self.bus.now(), data))
            write(bus, data, source)

        self.floor.write = noted  # type: ignore[method-assign, assignment]

    def later(self) -> list[tuple[float, bytes]]:
        """What was written since `mark`, and how long after it."""
        begin, number = self.marked
        return [(at - begin, data) for at, data in self.out[number:]]

    def mark(self) -> None:
        self.marked = self.bus.now(), len(self.out)


@pytest.fixture(params=CASES)
async def case(request: pytest.FixtureRequest) -> AsyncIterator[tuple[Shop, dict[Any, Started]]]:
    """Drives of a line, quiet; and what an automation has started in the first of them."""
    family, started = CASES[request.param]
    shop = Shop(*drives(request.param, family), pipe=SharedPipe, **({} if family == "mcode" else {"family": family}))
    await shop.open(*NAMES[family])
    await asyncio.sleep(1.0)
    yield shop, {shop.bus.drives[NAMES[family][0]]: started}
    await shop.bus.close()


@pytest.mark.parametrize("after", SOONER_AND_LATER)
@pytest.mark.parametrize("key", [True, False], ids=["key", "/stop"])
async def test_it_leaves_at_once_and_begins_with_its_own_first_drive(case, after, key):
    shop, started = case
    bus = shop.bus
    bus.halt(started, started=started)
    bus.link.advance()
    await asyncio.sleep(after)
    forms = stop_forms(bus.roster)
    shop.mark()
    if key:
        bus.stop_ahead()
    bus.stop()
    at, first = shop.later()[0]
    assert at == 0.0
    assert first in (forms.immediate, forms.unterminated + forms.invalidate + forms.immediate)
    await bus.stopped()
    sent = [data for _, data in shop.later()]
    assert in_order([first, *(each.data for each in forms.repeats)], sent), "the whole of it, in its own order"


def in_order(pieces: list[bytes], sent: list[bytes]) -> bool:
    rest = iter(sent)
    return all(piece in rest for piece in pieces)


async def test_what_it_cuts_off_of_the_other_stop_is_made_harmless():
    shop = await Shop(*(pmx(name) for name in NAMES["pmx"]), family="pmx", pipe=SharedPipe).open(*NAMES["pmx"])
    await asyncio.sleep(1.0)
    only = {shop.bus.drives["02"]: ONE_AXIS}
    shop.bus.halt(only, started=only)
    await asyncio.sleep(0.005)
    shop.mark()
    shop.bus.stop_ahead()
    shop.bus.stop()
    assert shop.later()[0] == (0.0, b"~~~\r@01ABORT\r")
    await shop.bus.stopped()
    assert not [text for text in shop.told if "?" in text]
    await shop.bus.close()


async def test_one_that_has_left_is_not_made_harmless_for_nothing():
    shop = await Shop(*(pmx(name) for name in NAMES["pmx"]), family="pmx", pipe=SharedPipe).open(*NAMES["pmx"])
    await asyncio.sleep(1.0)
    only = {shop.bus.drives["02"]: ONE_AXIS}
    shop.bus.halt(only, started=only)
    await asyncio.sleep(0.02)
    shop.mark()
    shop.bus.stop_ahead()
    shop.bus.stop()
    assert shop.later()[0] == (0.0, b"@01ABORT\r")
    await shop.bus.stopped()
    await shop.bus.close()


@pytest.mark.parametrize("held_up", [True, False])
async def test_a_key_that_is_held_down_then_goes_round_as_ever(held_up, monkeypatch):
    shop = await Shop(*(pmx(name) for name in NAMES["pmx"]), family="pmx", pipe=SharedPipe).open(*NAMES["pmx"])
    await asyncio.sleep(1.0)
    only = {shop.bus.drives["03"]: PROGRAM}
    shop.bus.halt(only, started=only)
    shop.bus.link.advance()
    if held_up:
        monkeypatch.setattr(shop.bus.link, "advance", lambda: None)
        monkeypatch.setattr(shop.bus.link, "call_soon", lambda work: None)
        await asyncio.sleep(0.2)  # the thread has taken the automation's stop back, and writes that
        assert [data for _, data in shop.out[-2:]] != [b"@03ABORT\r"] * 2
    shop.mark()
    for _ in range(30):
        shop.bus.stop_ahead()
        if not held_up:
            shop.bus.stop()
        await asyncio.sleep(1 / 30)
    sent = shop.later()
    assert sent[0][0] == 0.0 and sent[0][1].endswith(b"@01ABORT\r")
    firsts = [next(at for at, data in sent if f"@{name}ABORT\r".encode() in data) for name in NAMES["pmx"]]
    assert firsts == sorted(firsts) and firsts[-1] < 0.15
    assert sum(data.endswith(b"~~~\r@01ABORT\r") for _, data in sent) <= 1, "only the first key begins a stop"
    monkeypatch.undo()
    if held_up:
        for _ in range(30):
            shop.bus.stop()
    await shop.bus.stopped()
    await shop.bus.close()


async def test_an_automations_stop_of_another_drive_still_waits_for_the_gap():
    shop = await Shop(*(pmx(name) for name in NAMES["pmx"]), family="pmx", pipe=SharedPipe).open(*NAMES["pmx"])
    await asyncio.sleep(1.0)
    for name, wait in (("02", 0.003), ("03", 0.0)):
        only = {shop.bus.drives[name]: ONE_AXIS}
        shop.bus.halted(shop.bus.halt(only, started=only))
        await asyncio.sleep(wait)
    await asyncio.sleep(0.2)
    stops = [data for _, data in shop.out if b"ABORT" in data]
    assert stops[0] == b"@02ABORTX\r" and any(data.startswith(b"@03ABORT") for data in stops)
    times = [at for at, data in shop.out if b"ABORT" in data]
    assert all(later - sooner >= 0.03 for sooner, later in zip(times, times[1:], strict=False))
    assert [each for each in shop.events if isinstance(each, Traffic)]
    await shop.bus.stopped()
    await shop.bus.close()
