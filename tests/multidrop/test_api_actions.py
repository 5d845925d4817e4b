"""What a program asks of any family without its words: homing, running, current, inputs, outputs, errors, waits."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from multidrop import (
    AsyncSession,
    Diagnostic,
    DriveError,
    Fault,
    Inexpressible,
    Limits,
    MotionFailed,
    Timeout,
    connect_async,
)
from multidrop.drives.events import Traffic
from multidrop.shell.events import OnBus
from tests.support.cell_session import bus, drive, pmx

pytestmark = pytest.mark.virtual
HOME = "world = { home = -2000, limit_minus = -400000, limit_plus = 400000 }"
IS = 'set = { EM = 1, IS = ["1,1,0", "2,3,0", "3,2,0"] }'
MCODE = drive("LMDCM", "a", IS, HOME, party=True)
PMX = pmx("00", f"world.x = {HOME.removeprefix('world = ')}", f"world.y = {HOME.removeprefix('world = ')}")
TMCL = drive("TMCM-3110", "1", HOME.replace("00000", "000"))
FAMILIES = {"mcode": MCODE, "pmx": PMX, "tmcl": TMCL}


@pytest.fixture(params=FAMILIES)
def family(request: pytest.FixtureRequest) -> str:
    """Each family in turn."""
    return str(request.param)


@pytest.fixture
async def session(family: str, tmp_path: Path) -> AsyncIterator[AsyncSession]:
    """A session with one drive of the family."""
    (tmp_path / "cell.toml").write_text(bus("line", FAMILIES[family], baud=0))
    async with connect_async(f"sim:{tmp_path / 'cell.toml'}") as opened:
        yield opened


class Lines:
    """The lines that a session sends, without those that only ask."""

    def __init__(self, session: AsyncSession) -> None:
        self.sent: list[str] = []
        session._shell.subscribe(self._take)

    def _take(self, event: Any) -> None:
        if type(event).__name__ == "Entered" and event.bus and not event.line.startswith("/"):
            self.sent.append(event.line.partition(" ")[2])


EXPECTED: dict[str, dict[str, list[str]]] = {
    "home": {"mcode": ["HM 1"], "pmx": ["HX-"], "tmcl": ["RFS START, 0"]},
    "run": {
        "mcode": ["SL -20000", "SL 0"],
        "pmx": ["HSPDX=20000", "JX-", "STOPX"],
        "tmcl": ["ROR 0, -500", "ROR 0, 0"],
    },
    "output": {"mcode": ["O1=1"], "pmx": ["DO1=1"], "tmcl": ["SIO 1, 2, 1"]},
}


async def test_a_homing_has_a_direction_and_its_end_is_seen(family: str, session: AsyncSession) -> None:
    a, lines = session.drives[0], Lines(session)
    assert await a.homed() is False
    if family == "tmcl":
        with pytest.raises(Diagnostic, match=r"its direction; home\(\) sends RFS START, 0$"):
            await a.home("-")
        await a.write("SEARCH_MODE", 1)
        lines.sent.clear()
        await a.home()
    else:
        for wrong in ("", "left"):
            with pytest.raises(Diagnostic, match=r"direction.*; home\('-'\) sends H\w+.*, home\('\+'\) sends H"):
                await a.home(wrong)
        with pytest.raises(Diagnostic, match=r"no mode nowhere; valid: home"):
            await a.home("-", "nowhere")
        assert lines.sent == []
        await a.home("-")
    assert await a.homed() is False and await a.moving()
    await a.wait()
    assert await a.homed() is True
    assert lines.sent == EXPECTED["home"][family]
    await a.move(10)
    await a.wait()
    assert await a.homed() is True


async def test_runs_at_a_velocity_until_it_is_zero(family: str, session: AsyncSession) -> None:
    a, lines = session.drives[0], Lines(session)
    velocity = -500 if family == "tmcl" else -20000  # units of its chip
    await a.run_at(velocity)
    await asyncio.sleep(0.05)
    assert await a.velocity() and await a.moving()
    await a.run_at(0)
    await a.wait()
    assert await a.position() < 0
    assert lines.sent == EXPECTED["run"][family]
    with pytest.raises(TypeError):
        await a.run_at(0.5)


async def test_the_current_is_switched_and_the_load_is_named(
    family: str, session: AsyncSession, caplog: pytest.LogCaptureFixture
) -> None:
    a = session.drives[0]
    if family == "tmcl":
        for call in (a.enable, a.disable):
            with pytest.raises(Inexpressible, match=r"able\(\): direct mode has no command for it"):
                await call()
        return
    with caplog.at_level(logging.WARNING):
        await a.disable()
    assert [each.message for each in caplog.records] == [
        f"{a.name}: no current: nothing holds the load; a load that hangs may drop"
    ]
    word = "EO1" if family == "pmx" else "DE"
    assert await a.read(word) == 0
    await a.enable()
    assert await a.read(word) == 1


async def test_inputs_outputs_and_limits(family: str, session: AsyncSession) -> None:
    a, lines = session.drives[0], Lines(session)
    await a.set_output(1, True)
    assert lines.sent == EXPECTED["output"][family]
    inputs = await a.inputs()
    assert {each: inputs[each] for each in ("home", "lim+", "lim-")} == {"home": False, "lim+": False, "lim-": False}
    assert set(inputs) - {"home", "lim+", "lim-", "Z"} == set(
        {"pmx": range(1, 9), "tmcl": range(8)}.get(family, range(1, 5))
    )
    assert await a.limits() == Limits(False, False, None)
    await a.home(*(() if family == "tmcl" else ("-",)))
    await a.wait()
    assert (await a.inputs())["home"] in (True, False)


async def test_an_error_is_known_and_only_one_call_clears_it(family: str, session: AsyncSession) -> None:
    a = session.drives[0]
    if family == "tmcl":
        for call in (a.error, a.read_error):
            with pytest.raises(Inexpressible, match=r"no error to read.*AP208"):
                await call()
        return
    assert await a.error() is None and await a.read_error() is None
    if family == "pmx":
        await a.run_at(-20000)
        with pytest.raises(MotionFailed, match="minus limit"):
            await a.wait()
        fault = await a.error()
        assert fault is not None and "limit" in fault.text
        assert await a.error() == fault == await a.read_error()
    else:
        await a.run_at(100000)
        while await a.moving():  # to the limit; a wait would read the error for its reason
            await asyncio.sleep(0.1)
        found = await a.error()
        assert found == Fault(None, "an error is set; read_error() reads and clears its number")
        assert await a.error() == found
        read = await a.read_error()
        assert read is not None and read.code and str(read).startswith(f"error {read.code}: ")
    assert await a.error() is None


async def test_a_wait_for_a_value_is_worded_for_its_call(family: str, session: AsyncSession) -> None:
    a = session.drives[0]
    word = {"pmx": "PX", "tmcl": "AP1"}.get(family, "P")
    await a.move(1000)
    await a.wait_for(f"{word}>=500")
    await a.wait()
    await a.wait_for(f"{word}=1000", timeout=0)
    with pytest.raises(Timeout, match=rf"^wait_for {word}\S*=7: {a.name} still reports 1000 after 0.2 s$") as late:
        await a.wait_for(f"{word}=7", timeout=0.2)
    assert isinstance(late.value, TimeoutError) and isinstance(late.value, DriveError)
    await a.run_at(-100)
    with pytest.raises(Timeout, match=rf"^wait: {a.name} still runs after 0.1 s$"):
        await a.wait(0.1)
    for wrong in ("nonsense", "@b P=1", ""):
        with pytest.raises(Diagnostic, match="no condition"):
            await a.wait_for(wrong)


async def test_parameters_of_tmcl_have_one_meaning_however_they_are_spelled(tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text(bus("line", TMCL, baud=0))
    async with connect_async(f"sim:{tmp_path / 'cell.toml'}") as session:
        a, second = session.drive("1"), session.drive("1", axis="1")
        await a.write(4, 1500)
        await second.write("maximum_velocity", 700)
        for name in (4, "4", "AP4", "ap4", "4_0", "AP4/0", "maximum_velocity", "MaximumVelocity"):
            assert await a.read(name) == 1500, name
        for name in ("4_1", "AP4/1", "maximum_velocity_1"):
            assert await a.read(name) == 700, name
        assert await second.read(4) == 700 and await second.read("4_0") == 1500
        await a.write("G75", 5)
        assert await a.read("pause") == 5 and await second.read("G75") == 5
        assert (await a.parameters.read()).values["4_1"] == 700
        await a.wait_for("AP4_1=700", timeout=0)
        assert await session.send("/wait AP4=1500 1") == []
        for wrong in ("AP256", "nothing", "G75_1"):
            with pytest.raises(Diagnostic, match="no value to read|no line gives"):
                await a.read(wrong)
            with pytest.raises(Diagnostic, match="no value to read|no line gives"):
                await a.write(wrong, 1)
        with pytest.raises(Diagnostic, match="no value to read"):
            await a.read("AP207")  # reading clears it
        with pytest.raises(Diagnostic, match="SGP 66, 0, 3.*address"):
            await a.write("address", 3)


async def test_a_cell_has_the_same_spellings_of_parameters(tmp_path: Path) -> None:
    spelled = "set = { AP4 = 1500, maximum_velocity_1 = 700, pause = 5 }"
    (tmp_path / "cell.toml").write_text(bus("line", drive("TMCM-3110", "1", spelled), baud=0))
    async with connect_async(f"sim:{tmp_path / 'cell.toml'}") as session:
        a = session.drive("1")
        assert [await a.read(name) for name in ("4", "4_1", "G75")] == [1500, 700, 5]
    (tmp_path / "cell.toml").write_text(bus("line", drive("TMCM-3110", "1", "set = { AP4 = 1, 4_0 = 2 }"), baud=0))
    with pytest.raises(Diagnostic, match='"4_0" is given twice'):
        async with connect_async(f"sim:{tmp_path / 'cell.toml'}"):
            pass


async def test_a_quantity_runs_where_the_family_has_a_sign(tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text(
        bus("line", drive("LMDCM", "a", 'units = "5 mm/turn"', party=True)) + bus("pmx", pmx("00"))
    )
    async with connect_async(f"sim:{tmp_path / 'cell.toml'}") as session:
        a, x = session.drive("line:a"), session.drive("pmx:00")
        await a.run_at(-10, "mm/s")
        await asyncio.sleep(1)
        assert await a.velocity() == -102400
        with pytest.raises(Inexpressible, match=r"\{10 mm/s\}: a PMX has speeds without a sign"):
            await x.run_at(10, "mm/s")


def bytes_out(session: AsyncSession) -> list[bytes]:
    """The bytes that go out from now on."""
    found: list[bytes] = []

    def take(event: Any) -> None:
        if isinstance(event, OnBus) and isinstance(event.event, Traffic) and event.event.outgoing:
            found.append(event.event.data)

    session._shell.subscribe(take)
    return found


async def test_a_program_mode_and_a_refused_choice_send_nothing(tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text(bus("line", MCODE, baud=0))
    async with connect_async(f"sim:{tmp_path / 'cell.toml'}") as session:
        a = session.drive("a")
        await a.send("PG 100")
        sent = bytes_out(session)
        calls: list[Any] = [a.homed, a.enable, a.disable, a.inputs, a.limits, a.error, lambda: a.home("-")]
        for call in [*calls[1:], lambda: a.set_output(1, True), lambda: a.run_at(5), a.read_error]:
            with pytest.raises(DriveError, match="program mode"):
                await call()
        assert b"".join(sent) == b""
