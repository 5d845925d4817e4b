"""The awaited session: lines and answers, moves, stops, and what its end leaves behind."""

from __future__ import annotations

import asyncio
import logging
from pathlib import Path
from typing import Any

import pytest

from multidrop import Diagnostic, DriveError, Refused, Stopped, TransportLost, connect_async
from tests.support import api_program, behind_api
from tests.support.behind_api import break_off, floor_of
from tests.support.cell_session import ETHERNET, bus, party, pmx
from tests.support.virtual import VirtualLoop

pytestmark = pytest.mark.virtual
FAR = 10**8


@pytest.fixture
def url(tmp_path: Path) -> str:
    """A press with drives a and b, an Ethernet drive, and a PMX, on wires without a baud rate."""
    cell = bus("press", party("a"), party("b"), baud=0) + bus("eth", ETHERNET, baud=0) + bus("pmx", pmx("00"), baud=0)
    (tmp_path / "cell.toml").write_text(cell)
    return f"sim:{tmp_path / 'cell.toml'}"


def moving(session: Any) -> set[str]:
    """The drives that move, in the simulator."""
    return behind_api.moving(floor_of(session))


async def test_lines_words_and_moves(url: str) -> None:
    async with connect_async(f"{url}#press") as session:
        b = session.drive("b")
        assert (b.name, b.address, b.product, repr(b)) == ("b", "b", "LMDCM", "<drive b: LMDCM 6.002, Hw: 3.2>")
        assert [each.name for each in session.drives] == ["a", "b"]
        await b.move(51200)
        assert await b.moving() and await b.velocity() > 0
        await b.wait()
        assert (await b.position(), await b.velocity(), await b.moving()) == (51200, 0, False)
        await b.move_to(-100)
        await b.wait(idle=True)
        assert await b.position() == -100 == (await b.motion()).position
        assert await session.drive("a").position() == 0
        await b.write("VM", 700000)
        assert await b.read("VM") == 700000 and await b.send("PR VM") == ["700000"]
        assert await b.read('[PR "v"]') == "v" and await b.send("P=5") == []
        assert await session.send("@b PR P") == ["5"]
        assert (await session.send("/drives"))[1].split() == ["b", "LMDCM", "6.002,", "Hw:", "3.2"]


async def test_a_typed_program(url: str) -> None:
    assert await api_program.awaited(f"{url}#press") == 100


async def test_two_calls_at_once_get_their_own_lines(url: str) -> None:
    async with connect_async(f"{url}#press") as session:
        a, b = session.drive("a"), session.drive("b")
        printed = await asyncio.gather(*(each.send(f'PR "{n}"') for n in range(5) for each in (a, b)))
        assert [each[0] for each in printed] == [str(n) for n in range(5) for _ in "ab"]


async def test_other_families_move_by_the_same_methods(url: str) -> None:
    async with connect_async(url) as session:
        x, y = session.drive("pmx:00"), session.drive("pmx:00", axis="Y")
        await asyncio.gather(x.move_to(300), y.move(700))  # each with its own mode
        await y.wait()
        assert (await x.position(), await y.position()) == (300, 700)
        await y.write("HSPD", 2000)
        assert await y.read("HSPD") == 2000
        eth = session.drive("eth:")
        assert (eth.name, eth.address) == ("eth", "")
        await eth.move(100)
        await eth.wait()
        assert await eth.position() == 100
        with pytest.raises(Diagnostic, match="no axis q; valid: x, y"):
            await session.drive("pmx:00", axis="q").move(1)
        with pytest.raises(Diagnostic, match="it has one axis"):
            await session.drive("press:a", axis="y").move(1)
        assert moving(session) == set()


async def test_wrong_input_is_one_clear_line_and_sends_nothing(url: str) -> None:
    async with connect_async(f"{url}#press") as session:
        a = session.drive("a")
        with pytest.raises(Diagnostic, match="no drive z; found: a, b"):
            session.drive("z")
        with pytest.raises(Diagnostic, match=r"no drive \*"):
            session.drive("*")
        with pytest.raises(Diagnostic, match="'V M' is not a word of a drive"):
            await a.read("V M")
        with pytest.raises(Diagnostic, match="no line gives 'VM=5 ' a value"):
            await a.write("VM=5 ", 1)
        with pytest.raises(TypeError):
            await a.move(1.5)  # type: ignore[arg-type]
        with pytest.raises(Diagnostic, match="no rate 0"):
            session.telemetry(rate=0)
        with pytest.raises(Refused, match="error 23") as refused:
            await a.write("VM", 5)
        assert refused.value.code == 23
        with pytest.raises(Diagnostic, match="cannot ask, nothing was sent"):
            await a.send("CP")
        await a.move(FAR)
        with pytest.raises(DriveError, match=r"a still runs after 0\.2 s"):
            await a.wait(0.2)
        await a.stop()
        await a.send("PG 100")
        for call in (a.position, a.moving, lambda: a.move(1), lambda: a.read("P"), a.wait):
            with pytest.raises(DriveError, match="program mode"):
                await call()
        await a.send("PG")


async def test_a_wrong_url_and_a_closed_session(url: str) -> None:
    with pytest.raises(Diagnostic, match="no bus"):
        async with connect_async(f"{url}#nowhere"):
            pass
    async with connect_async(f"{url}#press") as session:
        a, telemetry = session.drive("a"), session.telemetry()
    for call in (a.position, lambda: a.send("PR P"), lambda: session.send("/drives"), session.resume):
        with pytest.raises(Diagnostic, match="the session is closed"):
            await call()
    assert {each.drive async for each in telemetry} <= {"a", "b"}
    await session.close()


async def test_the_normal_end_leaves_a_move_alone_and_an_exception_stops_it(url: str, caplog: Any) -> None:
    async with connect_async(url) as watcher:
        async with connect_async(f"{url}#press") as session:
            await session.drive("a").move(FAR)
        assert moving(watcher) == {"a"}
        await watcher.drive("press:a").stop()
        with pytest.raises(KeyError):
            async with connect_async(url) as session:
                await session.drive("eth:").move(FAR)
                await session.drive("pmx:00").read("EO")
                raise KeyError
        assert moving(watcher) == set()
    warnings = [each.message for each in caplog.records if each.levelno >= logging.WARNING]
    heard = [each for each in warnings if each.startswith("pmx: received without a question")]
    assert all("another program uses this line" in each for each in heard), "the other connection is one"
    assert [each for each in warnings if each not in heard] == [
        "stopped eth: velocity 0 was read from eth",
        "program ended, if one was running: eth",
    ]


async def test_an_exception_stops_only_what_this_session_started(url: str) -> None:
    async with connect_async(url) as watcher:
        await watcher.drive("eth:").move(FAR)
        with pytest.raises(KeyError):
            async with connect_async(url) as session:
                await session.drive("pmx:00").move(FAR)
                raise KeyError
        assert moving(watcher) == {"!"}


async def test_a_cancelled_task_stops_what_it_started(url: str) -> None:
    async def work() -> None:
        async with connect_async(f"{url}#press") as session:
            await session.drive("a").move(FAR)
            await session.drive("a").wait()

    async with connect_async(url) as watcher:
        task = asyncio.create_task(work())
        await asyncio.sleep(3)
        assert moving(watcher) == {"a"}
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert moving(watcher) == set()


def test_the_end_of_the_loop_stops_and_says_so(url: str, caplog: Any) -> None:
    async def work() -> None:
        async with connect_async(f"{url}#press") as session:
            await session.drive("a").move(FAR)
            asyncio.get_running_loop().call_later(0.5, end)
            await session.drive("a").wait()

    def end() -> None:
        raise SystemExit(143)  # as the handler of a signal does

    with pytest.raises(SystemExit), asyncio.Runner(loop_factory=VirtualLoop) as runner:
        runner.run(work())
    assert caplog.messages[0] == "stopped a: velocity 0 was read from a"


async def test_what_the_stop_did_not_reach_is_said(url: str, caplog: Any) -> None:
    with pytest.raises(TransportLost):
        async with connect_async(url) as session:
            await session.drive("press:a").move(FAR)
            await session.send("/sim unplug press")
            await session.drive("press:a").position()
    assert "press: stop not sent" in caplog.text and "use the E-stop" in caplog.text


async def test_a_stop_ends_calls_and_refuses_commands_until_resume(url: str) -> None:
    async with connect_async(url) as session:
        a = session.drive("press:a")
        await a.move(FAR)
        waiting = asyncio.create_task(a.wait())
        await asyncio.sleep(0.5)
        stop = session.stop()  # written at once
        with pytest.raises(Stopped):
            await waiting
        report = await stop
        assert report.at_rest and str(report) == "velocity 0 was read from all 4"
        with pytest.raises(Stopped, match="/resume"):
            await a.move(1)
        assert await a.velocity() == 0 and await a.read("MV") == 0
        await session.resume()
        await a.move(FAR)
        assert moving(session) == {"a"}
        report = await a.stop()
        assert report.at_rest and moving(session) == set()
        await a.move(1)


async def test_the_report_of_a_stop_names_the_bus_where_two_are_open(tmp_path: Path) -> None:
    (tmp_path / "two.toml").write_text(bus("press", party("a"), baud=0) + bus("eth", ETHERNET, baud=0))
    for buses, name in ((("press", "eth"), "press:a"), (("press",), "a")):
        async with connect_async(*(f"sim:{tmp_path / 'two.toml'}#{each}" for each in buses)) as session:
            assert str(await session.drive(name).stop()) == f"velocity 0 was read from {name}"


async def test_a_stop_without_await_is_repeated_and_confirmed_before_the_end(url: str, caplog: Any) -> None:
    async with connect_async(f"{url}#eth") as session:
        await session.drive().move(FAR)
        session.stop()
    assert caplog.messages[-1] == "stop: velocity 0 was read from eth"


async def test_an_interruption_stops_and_the_session_goes_on(url: str) -> None:
    async with connect_async(url) as session:
        a = session.drive("press:a")
        for _ in range(2):
            await a.move(FAR)
            waiting = asyncio.create_task(a.wait())
            await asyncio.sleep(0.5)
            await break_off(session)
            with pytest.raises(Stopped, match="interrupted"):
                await waiting
            assert moving(session) == set()
        assert await a.velocity() == 0


async def test_a_call_during_an_interruption_sends_nothing(url: str) -> None:
    async with connect_async(f"{url}#press") as session:
        a = session.drive("a")
        await a.move(FAR)
        interrupting = asyncio.create_task(break_off(session))
        await asyncio.sleep(0)
        with pytest.raises(Stopped, match="nothing was sent"):
            await a.move(FAR)
        await interrupting
        assert moving(session) == set()
        await a.move(FAR)
        closing = asyncio.create_task(session.close(stop=True))
        await asyncio.sleep(0)
        with pytest.raises(Diagnostic, match="closed"):
            await a.move(FAR)
        await closing


async def test_a_script_runs_and_its_failure_names_the_line(url: str, tmp_path: Path) -> None:
    (tmp_path / "turn.txt").write_text("@a MR {steps}\n/wait stopped\n@a PR P\n/assert @a P == {goal}\n")
    async with connect_async(f"{url}#press") as session:
        run = await session.run(str(tmp_path / "turn.txt"), steps=200, goal=200)
        assert run.printed == ["200"] and [each.ok for each in run.results] == [True] * 4
        with pytest.raises(DriveError, match="wanted == 200, seen 400") as failed:
            await session.run(str(tmp_path / "turn.txt"), steps=200, goal=200)
        assert failed.value.__notes__ == [f"{tmp_path / 'turn.txt'}:4"]
        with pytest.raises(Diagnostic, match="steps"):
            await session.run(str(tmp_path / "turn.txt"))
        with pytest.raises(DriveError, match="wanted == 1"):  # a value may have any name
            (tmp_path / "file.txt").write_text((tmp_path / "turn.txt").read_text().replace("goal", "file"))
            await session.run(str(tmp_path / "file.txt"), file=1, steps=1)
        with pytest.raises(Diagnostic, match="no line takes the value step;"):
            await session.run(str(tmp_path / "turn.txt"), step=1, steps=1, goal=1)


MACRO = """name = "go"
on_early_end = ["@a R1=5"]
[[step]]
after = 0.0
line = "@a SL 1000"
[[step]]
after = 0.0
line = "/wait stopped"
"""


async def test_an_interrupted_macro_executes_its_last_lines(
    url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(tmp_path))
    (tmp_path / "macros").mkdir()
    (tmp_path / "macros" / "go.toml").write_text(MACRO)
    async with connect_async(f"{url}#press") as session:
        playing = asyncio.create_task(session.send("/play go"))
        await asyncio.sleep(2)
        assert moving(session) == {"a"}
        await break_off(session)
        with pytest.raises(Stopped, match="interrupted"):
            await playing
        assert moving(session) == set() and await session.drive("a").read("R1") == 5
        await session.drive("a").move(FAR)
        await break_off(session)
        assert moving(session) == set()


async def test_a_text_that_a_program_prints_is_waited_for(url: str) -> None:
    async with connect_async(f"{url}#press") as session:
        a = session.drive("a")
        await a.programs.download("p.mxt", 'PG 1\nLB G1\n H 1500\n PR "done"\n E\nPG\n', run="G1")
        with pytest.raises(DriveError, match="not printed within 1 s"):
            await session.send('/wait "done" 1')
        await session.send('/wait "done" 5')
