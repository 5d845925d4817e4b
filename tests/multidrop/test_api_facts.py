"""What a drive of the Python API tells without asking, what it asks only once, and what it refuses to send."""

from __future__ import annotations

from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from multidrop import AsyncDrive, AsyncSession, Diagnostic, Inexpressible, Refused, connect_async
from multidrop.drives.events import Traffic
from tests.support.behind_api import floor_of, moving, shell_of
from tests.support.cases import for_each
from tests.support.cell_session import bus, drive, party, pmx

pytestmark = pytest.mark.virtual


@pytest.fixture
async def session(tmp_path: Path) -> AsyncIterator[AsyncSession]:
    """A press with the drives a and b, a PMX, and a TMCL module."""
    home = 'world = { home = -2000 }\nset = { EM = 1, IS = ["1,1,0"] }'
    cell = bus("press", drive("LMDCM", "a", home, party=True), party("b"), baud=0)
    cell += bus("pmx", pmx("00"), baud=0) + bus("tmcl", drive("TMCM-3110", "1"), baud=0)
    (tmp_path / "cell.toml").write_text(cell)
    async with connect_async(f"sim:{tmp_path / 'cell.toml'}") as opened:
        yield opened


class Asked:
    """The number of requests to a bus."""

    def __init__(self, session: AsyncSession, bus: str) -> None:
        self.count, self._bus = 0, bus
        shell_of(session).subscribe(self._take, Traffic)

    def _take(self, event: Any) -> None:
        if event.bus == self._bus and event.event.outgoing:
            self.count += 1

    def since(self) -> int:
        count, self.count = self.count, 0
        return count


def axes(session: AsyncSession) -> dict[str, bool]:
    return {name: session.drive("pmx:00", name).referenced for name in ("", "x", "y", "X", "Y")}


async def test_a_session_that_is_closed_lets_its_drives_go_on(session: AsyncSession) -> None:
    cell: Any = floor_of(session)
    await session.drive("press:b").run_at(1000)
    await session.close()
    assert moving(cell, later=1.0) == {"b"}
    assert repr(session) == "<multidrop: a closed session>"


async def test_a_position_that_does_not_count_is_that_of_its_axis_and_of_the_drive(session: AsyncSession) -> None:
    state = shell_of(session).buses["pmx"].drives["00"].state
    assert all(axes(session).values()) and session.drive("press:a").referenced
    state.reference_lost(["x"])
    assert axes(session) == {"": False, "x": False, "y": True, "X": False, "Y": True}
    state.reference_lost(["x", "y"])
    assert not any(axes(session).values())
    shell_of(session).buses["press"].drives["a"].state.reference_lost([""])
    assert not session.drive("press:a").referenced and session.drive("press:b").referenced
    await session.drive("press:a").accept()
    assert session.drive("press:a").referenced


async def test_a_drive_says_what_it_is(session: AsyncSession) -> None:
    a, y = session.drive("press:a"), session.drive("pmx:00", "y")
    assert (a.name, a.address, a.product, a.axis) == ("press:a", "a", "LMDCM", "")
    assert repr(a) == f"<drive press:a: {a.version}>" and repr(y) == f"<drive pmx:00: {y.version}, axis y>"


async def test_what_a_homing_has_ended_in_is_asked_once(session: AsyncSession) -> None:
    a, asked = session.drive("press:a"), Asked(session, "press")
    assert await a.homed() is False and asked.since() == 0, "it was not homed in this session"
    await a.home("-")
    assert await a.homed() is False and asked.since() > 0
    await a.wait()
    asked.since()
    assert await a.homed() is True and asked.since() == 0, "the wait has seen its end"


async def test_conditions_that_change_slowly_are_read_once_between_commands(session: AsyncSession) -> None:
    a, asked = session.drive("press:a"), Asked(session, "press")
    await a.limits()
    first = asked.since()
    await a.limits()
    second = asked.since()
    assert 0 < second < first
    await a.write("VM", 700000)
    asked.since()
    await a.limits()
    assert asked.since() == first, "a command may have changed them"


@for_each("amount, unit, error, said", [
    (True, "", TypeError, "True is no number of steps"),
    (True, "mm", TypeError, "True is no number of steps"),
    (1.5, "", TypeError, "'float' object cannot be interpreted as an integer"),
    (1, "m m", Diagnostic, 'not a quantity: 1 m m; valid: as in move(12.5, "mm")'),
    (1, "mm}", Diagnostic, 'not a quantity: 1 mm}; valid: as in move(12.5, "mm")'),
    (float("nan"), "mm", Diagnostic, "nan is no value for a line"),
])  # fmt: skip
async def test_a_move_of_no_number_is_refused_and_sends_nothing(
    session: AsyncSession, amount: Any, unit: str, error: type[Exception], said: str
) -> None:
    a, asked = session.drive("press:a"), Asked(session, "press")
    for call in (a.move, a.move_to, a.run_at):
        with pytest.raises(error) as refused:
            await call(amount, unit)
        assert said in str(refused.value) and asked.since() == 0


async def test_an_axis_that_a_drive_does_not_have_is_named_with_those_that_it_has(session: AsyncSession) -> None:
    for name, axis, said in (
        ("pmx:00", "z", "pmx:00: no axis z; valid: x, y"),
        ("press:a", "x", "press:a: no axis x; it has one axis"),
    ):
        with pytest.raises(Diagnostic) as refused:
            await session.drive(name, axis).position()
        assert str(refused.value) == said
    assert await session.drive("pmx:00", "Y").position() == 0


async def test_words_that_are_none_are_refused_and_send_nothing(session: AsyncSession) -> None:
    a, asked = session.drive("press:a"), Asked(session, "press")
    for name in ("P V", "1X", "", "[", "P]", "é"):
        with pytest.raises(Diagnostic, match="is not a word of a drive; valid: as in read"):
            await a.read(name)
        with pytest.raises(Diagnostic, match=r"no line gives .* a value; send\(\) takes any line of the drive"):
            await a.write(name, 1)
    assert asked.since() == 0
    assert await a.read("[PR VM]") == await a.read("VM") == await a.read("vm")
    await a.write("R1", "0007")
    assert await a.read("R1") == 7
    with pytest.raises(Diagnostic, match="is 0 with nine decimal places"):
        await a.write("R1", 1e-12)


async def test_in_program_mode_nothing_is_asked_that_the_drive_would_store(session: AsyncSession) -> None:
    a = session.drive("press:a")
    await a.send("PG 100")
    asked = Asked(session, "press")
    calls: list[Any] = [
        lambda: a.write("VM", 7), lambda: a.move(5), lambda: a.move_to(5), lambda: a.run_at(5), lambda: a.home("-"),
        a.enable, a.disable, lambda: a.set_output(1, True), a.inputs, a.limits, a.error, a.position, a.velocity,
        a.motion, a.moving, lambda: a.position_in("mm"),
    ]  # fmt: skip
    for call in calls:
        with pytest.raises(Refused, match="press:a is in program mode and would store this; PG ends it"):
            await call()
    assert asked.since() == 0
    await a.send("PG")
    assert await a.position() == 0


async def test_a_wait_has_a_limit_that_is_a_time(session: AsyncSession) -> None:
    a = session.drive("press:a")
    wrong: Any
    for wrong in (-1, float("nan"), "5", None):
        with pytest.raises(Diagnostic, match=r"wait: no timeout .*valid: 0 or more seconds; math.inf: no limit"):
            await a.wait(wrong)
        with pytest.raises(Diagnostic, match=r"wait_for: no timeout"):
            await a.wait_for("P=0", wrong)
    for condition in ("", "P", "P=", "stopped", "b.P=0", "=1"):
        with pytest.raises(Diagnostic, match=r"no condition .*valid: as in wait_for\('I1=1'\)"):
            await a.wait_for(condition)
    await a.wait_for("P=0", 0.5)


async def test_a_drive_without_errors_to_read_says_so(session: AsyncSession) -> None:
    module = session.drive("tmcl:1")
    for call in (module.error, module.read_error):
        with pytest.raises(Inexpressible, match="^tmcl:1: "):
            await call()
    a: AsyncDrive = session.drive("press:a")
    assert await a.error() is None and await a.read_error() is None


async def test_a_backup_to_a_file_that_exists_asks_nothing(session: AsyncSession, tmp_path: Path) -> None:
    a, asked = session.drive("press:a"), Asked(session, "press")
    with pytest.raises(Diagnostic, match="exists already"):
        await a.parameters.backup(str(tmp_path / "cell.toml"))
    assert asked.since() == 0


async def test_telemetry_reads_fifty_times_a_second_unless_it_is_told(session: AsyncSession) -> None:
    read = shell_of(session).buses["press"].telemetry
    begin: Any
    for begin, rate in (
        (session.drive("press:a").telemetry, 50),
        (lambda: session.telemetry("press:a", rate=20), 20),
        (lambda: session.telemetry("press:a"), 50),
    ):
        opened = begin()
        assert read.period("a") == 1 / rate
        opened.close()
