"""Programs between host and simulated module, wired in memory: bytes, replies lost, stops, what is read back."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from multidrop.base.errors import Inexpressible, NoAnswer, Refused, Stopped
from multidrop.base.files import SourceLine
from multidrop.families.tmcl.host import programs
from multidrop.families.tmcl.host.codec import Tmcl, TmclState
from multidrop.families.tmcl.host.family import TmclFamily
from multidrop.families.tmcl.host.programs import TmclPrograms
from multidrop.families.tmcl.manual import instructions, program_file
from multidrop.families.tmcl.manual.commands import Command, TmclCall
from tests.families.tmcl.host.test_exchange import Shop

pytestmark = pytest.mark.slow

FILE = "Loop: MVP ABS, 0, 1000\n  WAIT POS, 0, 0\n  JA Loop\n"


def nothing(done: int, total: int) -> None:
    """Take no note of progress."""


def lines(text: str) -> list[SourceLine]:
    return program_file.read(text, "a.tmc")


def opened() -> tuple[Any, Any]:
    shop = Shop()
    (state,) = shop.open()
    return shop, state


def load(shop: Any, state: Any, text: str) -> None:
    shop.run(TmclPrograms(state).download(lines(text), None, nothing))


def test_a_download_byte_for_byte() -> None:
    shop, state = opened()
    before = len(shop.written)
    load(shop, state, FILE)
    sent = [data.hex(" ").upper() for data in shop.written[before:]]
    assert sent == [
        "01 0A 80 00 00 00 00 00 8B",  # does its program run
        "01 84 00 00 00 00 00 00 85",
        "01 04 00 00 00 00 03 E8 F0",
        "01 1B 01 00 00 00 00 00 1D",
        "01 16 00 00 00 00 00 00 17",
        "01 00 00 00 00 00 00 00 01",  # nothing after it
        "01 85 00 00 00 00 00 00 86",
    ]
    held = shop.run(TmclPrograms(state).read(lines(FILE), nothing))
    assert [line.text for line in held.lines] == ["MVP ABS, 0, 1000", "WAIT POS, 0, 0", "JA 0"]
    assert TmclPrograms(state).differences(lines(FILE), held) == ()
    assert not state.programming and state.restore is None


def test_a_stored_line_comes_in_place_of_status_and_command() -> None:
    shop, state = opened()
    load(shop, state, "SAP 101, 0, -2\nSTOP")
    device = shop.devices["1"]
    answer = device.execute(TmclCall(Command.READ_PROGRAM, value=0), shop.now)
    assert answer.line == TmclCall(5, 101, 0, -2)
    assert shop.type(state, "134 0, 0, 0") == ("SAP 101, 0, -2",)
    assert not state.programming, "the type 101 of a line is no status"
    assert shop.type(state, "134 0, 0, 1") == ("STOP",)
    with pytest.raises(Refused, match="status 4"):
        shop.type(state, "134 0, 0, 2048")


def test_a_running_program_is_not_overwritten() -> None:
    shop, state = opened()
    load(shop, state, FILE)
    shop.type(state, "129 1, 0, 0")
    with pytest.raises(Refused, match="its program runs; 128 0, 0, 0 ends it"):
        load(shop, state, "STOP")
    assert len(shop.devices["1"].program.memory) == 3
    assert shop.run(TmclPrograms(state).end()) is True
    load(shop, state, "STOP")
    held = shop.run(TmclPrograms(state).read((), nothing))
    assert [line.text for line in held.lines] == ["STOP", "JA 0"], "what the file does not reach stays"
    assert TmclPrograms(state).differences(lines("STOP"), held) == ()


def test_a_motor_that_moves_without_a_program_ends_the_download_before_it_begins() -> None:
    shop, state = opened()
    shop.type(state, "ROR 0, 1000")
    shop.wait(0.5)
    with pytest.raises(Refused, match="moves: stop it first"):
        shop.run(TmclPrograms(state).end())


@pytest.mark.parametrize("lost", range(1, 7))
def test_a_lost_reply_ends_the_download_says_what_is_stored_and_sends_nothing_twice(lost: int) -> None:
    shop, state = opened()
    before = len(shop.written)
    shop.delays = [0.0] * lost + [None]
    with pytest.raises(NoAnswer, match="sent once"):
        load(shop, state, FILE)
    sent = [data[1] for data in shop.written[before:]]
    stored = [number for number in sent if number < Command.STOP_PROGRAM and number not in (Command.GGP, 136, 6, 13)]
    assert stored == [4, 27, 22, 0][: max(lost - 1, 0)] and sent[-1] == Command.END_DOWNLOAD
    assert not shop.devices["1"].program.storing


def test_a_stop_in_a_download_ends_it_and_is_told() -> None:
    shop, state = opened()
    before = len(shop.written)

    def stop(_: object) -> None:
        if len(shop.written) == before + 4 and not shop.line.waiting:
            shop.line.stop(shop.now)

    with pytest.raises(Stopped, match="lines are stored: the program in module 1 is incomplete"):
        shop.run(TmclPrograms(state).download(lines(FILE), None, nothing), at=stop)
    assert any("the download was cut off" in note for note in state.notes)


def test_routines_at_other_addresses_are_listed_with_a_gap_and_come_back() -> None:
    shop, state = opened()
    device = shop.devices["1"]
    device.program.load({0: TmclCall(28), 50: TmclCall(3), 51: TmclCall(22, value=50)})
    upload = shop.run(programs.TmclPrograms(state).upload(raw=False))
    assert upload[:2] == ("    STOP", "    0 0, 0, 0") and upload[-3:] == ("Line50:", "    MST 0", "    JA Line50")
    memory = list(device.program.memory)
    device.program.load({})
    load(shop, state, "\n".join(upload))
    assert list(device.program.memory) == memory
    assert TmclPrograms(TmclState(Tmcl(), "1")).readable(
        programs.held_of({0: TmclCall(28), 1: TmclCall(22, value=0)})
    ) == (
        "0  Line0: STOP",
        "1         JA Line0",
    )


@settings(max_examples=15)
@given(
    st.lists(st.sampled_from(sorted(instructions.ROWS)), min_size=1, max_size=12),
    st.integers(0, 12),
    st.integers(0, 12),
)
def test_what_upload_writes_downloads_to_the_same_memory(numbers: list[int], kind: int, value: int) -> None:
    shop, state = opened()
    device = shop.devices["1"]
    device.program.load({at: TmclCall(number, kind, 0, value) for at, number in enumerate(numbers)})
    memory = list(device.program.memory)
    for raw in (False, True):
        text = "\n".join(shop.run(programs.TmclPrograms(state).upload(raw)))
        device.program.load({})
        load(shop, state, text)
        assert list(device.program.memory) == memory


def test_a_program_is_stepped_from_its_first_line() -> None:
    shop, state = opened()
    load(shop, state, "SAP 4, 0, 7\nSAP 4, 0, 8\nSTOP")
    observed = TmclFamily(state).debugging
    assert observed is not None
    rows = shop.run(observed.listing())
    with pytest.raises(Inexpressible, match="single step begins with line 0"):
        shop.run(observed.idle("1", None))
    shop.run(observed.begin("0"))
    for at, speed in ((0, "7"), (1, "8")):
        assert shop.run(observed.step(rows)).row.at == at
        assert shop.type(state, "GAP 4, 0") == (speed,)
        assert shop.run(observed.look("0")).paused
    shop.run(observed.step(rows))
    assert not shop.run(observed.look("0")).runs
    with pytest.raises(Refused, match="not known to be halted"):
        shop.run(observed.waits("0", None))


def test_a_running_program_is_broken_where_it_is_and_goes_on() -> None:
    shop, state = opened()
    load(shop, state, "ROR 0, 500\nWAIT TICKS, 0, 50\nMST 0\nWAIT TICKS, 0, 500\nSTOP")
    observed = TmclFamily(state).debugging
    assert observed is not None
    shop.run(observed.trace("0"))
    shop.wait(0.2)
    assert shop.run(observed.look("0"))[:2] == (True, False)
    shop.run(observed.break_now("0"))
    look = shop.run(observed.look("0"))
    assert (look.runs, look.paused, look.address) == (True, True, 2)
    assert shop.run(observed.values(("A", "AP3"))) == {"A": "0", "AP3": "500"}
    shop.run(observed.go_on("0"))
    shop.wait(1.0)
    assert shop.type(state, "GAP 3, 0") == ("0",)
