"""Macros that end early, in virtual time: what is stopped, what runs after it, and reports, JSON and JUnit too."""

from __future__ import annotations

import asyncio
import json
import os
from pathlib import Path

import pytest

from multidrop.base.errors import Diagnostic, DriveError, Refused, Stopped, TransportLost
from multidrop.drives.events import Traffic
from multidrop.shell.batch.report import BatchReport
from multidrop.shell.events import Notified, OnBus
from multidrop.shell.scripts.executor import play, run_script
from multidrop.shell.scripts.model import MacroEnding
from multidrop.shell.scripts.reading import read_script
from multidrop.shell.streams.stdout import report
from tests.support.automated import automated
from tests.support.macro_shop import Shop

pytestmark = pytest.mark.virtual


def short(texts: list[str], shop: Shop) -> list[str]:
    """Without the folder of the macros."""
    return [text.replace(f"{shop.session.macros.folder}{os.sep}", "") for text in texts]


async def test_a_failure_names_macro_step_and_file_and_the_report_what_was_sent_and_where_drives_stand(
    shop: Shop,
) -> None:
    macro = shop.save("m", "@a MA 500", "/wait stopped", "@a PR P", "@press:b SL 3000", "@b QQ 1", "@a MR 9000")
    with pytest.raises(Refused) as caught:
        await shop.play(macro, times=2)
    assert report(caught.value).replace(f"{shop.session.macros.folder}{os.sep}", "") == (
        "macro m, step 5 (m.toml:24): press: b refused 'QQ 1': error 60: unknown command (check the spelling; "
        "/help NAME explains a word)"
    )
    assert short(shop.warned(), shop)[:6] == [
        "macro m, step 5 of 6, round 1 of 2: ended early; its last lines:",
        "  step 1: @a MA 500",
        "  step 2: /wait stopped",
        "  step 3: @a PR P -> 500",
        "  step 4: @press:b SL 3000",
        "  step 5: @b QQ 1 -> FAILED: b refused 'QQ 1': error 60: unknown command (check the spelling; /help NAME "
        "explains a word)",
    ]
    assert shop.warned()[6].startswith("stopped press:b: velocity 0 was read from press:b")
    assert shop.warned()[-1].startswith("press:a is at rest at 500; press:b is at rest at ")
    assert shop.moving() == set() and not shop.session.latched
    assert b"9000" not in shop.written("press")
    (ending,) = shop.endings
    assert (ending.macro, ending.rounds, ending.at) == ("m", 0, "macro m, step 5 of 6, round 1 of 2")
    assert ending.fact()["drives"]["press:a"] == {"position": 500, "velocity": 0}


async def test_the_failure_in_a_called_macro_names_both_and_stops_what_either_moved(shop: Shop) -> None:
    shop.save("inner", "@gantry:c SL 100", "/assert 1 == 2", on_early_end=("/print inner",))
    macro = shop.save("outer", "@press:a SL 100", "/play inner", on_early_end=("/print outer",))
    with pytest.raises(DriveError) as caught:
        await shop.play(macro)
    assert short([report(caught.value)], shop) == [
        "macro outer, step 2 (outer.toml:13): macro inner, step 2 (inner.toml:13): /assert 1 == 2: wanted == 2, seen 1"
    ]
    assert shop.moving() == set()
    assert shop.printed() == ["inner", "outer"]
    assert shop.endings[0].at == "macro outer, step 2 of 2: macro inner, step 2 of 2"


# -- on_early_end


async def test_on_stop_runs_after_a_failure_each_line_whatever_became_of_the_one_before(shop: Shop) -> None:
    after = ("@a VM=-1", "@a PR {n}", "/if 1", "/print yes", "/end")
    macro = shop.save("m", "@a PR {n:int=7}", "/assert 1 == 2", on_early_end=after)
    with pytest.raises(DriveError, match="/assert 1 == 2"):
        await shop.play(macro)
    assert shop.printed() == ["7", "7", "yes"]
    assert any(
        each.startswith("macro m, on_early_end (m.toml:5): a refused 'VM=-1'") for each in short(shop.warned(), shop)
    )


@pytest.mark.parametrize("moves", [True, False])
async def test_on_early_end_moves_only_where_the_file_says_so(moves: bool, shop: Shop) -> None:
    after = ("@press:a MA 0", "/wait stopped")
    macro = shop.save("m", "@press:a MA 5000", "/sleep 1", "XX 1", on_early_end=after, on_early_end_moves=moves)
    if moves:
        with pytest.raises(Refused):
            await shop.play(macro)
        assert shop.warned()[-1].startswith("press:a is at rest at 0")
        return
    with pytest.raises(
        Diagnostic, match=r"a: @press:a MA 0 can start motion; on_early_end_moves = true in its file"
    ) as no:
        await shop.play(macro)
    assert no.value.where.startswith("macro m, on_early_end (") and shop.written("press") == b""


async def test_on_stop_that_is_seen_to_move_only_then_is_refused_then(shop: Shop) -> None:
    macro = shop.save("m", "XX 1", on_early_end=("/use gantry", "MA 7000", "PR P"))
    with pytest.raises(Refused):
        await shop.play(macro)
    assert "on_early_end of macro m would start it, and on_early_end_moves is false" in "".join(shop.warned())
    assert b"7000" not in shop.written("gantry") and shop.printed() == ["0"]


async def test_a_velocity_of_0_is_no_motion(shop: Shop) -> None:
    macro = shop.save("m", "VM=-1", on_early_end=("@press:a SL 0", "/use b", "SL 0", "SL {v:int=0}", "@press:a PR 5"))
    with pytest.raises(Refused):
        await shop.play(macro)
    assert shop.printed() == ["5"] and "on_early_end_moves" not in "".join(shop.warned())


async def test_what_on_early_end_moves_goes_on_unless_a_line_of_it_fails(shop: Shop) -> None:
    for after, moving in (("@press:a SL 100",), {"press:a"}), (("@press:a SL 100", "XX 2"), set()):
        macro = shop.save(f"m{len(after)}", "XX 1", on_early_end=after, on_early_end_moves=True)
        with pytest.raises(Refused):
            await shop.play(macro)
        assert shop.moving() == moving


# -- Stops


async def test_after_the_stop_key_on_stop_is_not_executed_then_or_later_and_that_is_said(shop: Shop) -> None:
    shop.save("m", "@press:a SL 900", "/sleep 9", on_early_end=("@press:a PR 77",))
    playing = asyncio.create_task(shop.session.run("/play m"))
    await asyncio.sleep(1)
    shop.session.stop("Ctrl+X")
    with pytest.raises(Stopped):
        await playing
    assert shop.moving() == set()
    assert "macro m, step 2 of 2: stopped; its last lines:" in shop.warned()
    dropped = "macro m: on_early_end is not executed after a stop: @press:a PR 77; type them if the machine needs them"
    assert dropped in shop.warned()
    assert shop.warned()[-1].startswith("press:a is at rest at ")
    await shop.session.run("/resume")
    assert shop.warned()[-1] == "on_early_end of m was not executed and will not be; type its lines if needed"
    await asyncio.sleep(9)
    assert b"77" not in shop.written("press")
    await shop.session.run("/resume")
    assert shop.told()[-1].startswith("macros and scripts may run again")


@pytest.mark.parametrize("ended", ["interrupt", "/play stop"])
async def test_ended_by_a_person_it_stops_its_drives_and_on_stop_is_executed(ended: str, shop: Shop) -> None:
    await shop.session.run("@gantry:c SL 50")
    shop.save("m", "@press:a SL 900", "/sleep 9", on_early_end=("@press:a PR 77",))
    playing = asyncio.create_task(shop.session.run("/play m"))
    await asyncio.sleep(1)
    if ended == "interrupt":
        shop.session.interrupt()
    else:
        await shop.session.run(ended)
    with pytest.raises(asyncio.CancelledError if ended == "interrupt" else Stopped):
        await playing
    assert shop.moving() == {"gantry:c"} and not shop.session.latched
    assert shop.printed() == ["77"] and shop.session.playing == []


async def test_on_stop_is_executed_when_a_person_quits(shop: Shop) -> None:
    shop.save(
        "m",
        "@press:a SL 900",
        "/sleep 9",
        on_early_end=("@press:a PR 77", "/sleep 3", "/repeat 2", "@press:a PR 78", "/end"),
    )
    shop.session.start("/play m")
    await asyncio.sleep(1)
    shop.session.quit()
    shop.session.interrupt()
    said: list[str] = []
    await shop.session.automations.over(said.append)
    assert shop.printed() == ["77", "78", "78"] and shop.moving() == set()
    assert said == ["waiting 10 s at most for the end of macro m"]


async def test_a_stop_before_on_stop_drops_it_and_says_so(shop: Shop) -> None:
    shop.save("m", "@press:a SL 900", "/sleep 1", "XX 1", on_early_end=("@press:a PR 77",))
    playing = asyncio.create_task(shop.session.run("/play m"))
    while not any("ended early" in text for text in shop.warned()):
        await asyncio.sleep(0.001)
    shop.session.stop("Ctrl+X")
    with pytest.raises(Stopped):
        await playing
    assert shop.moving() == set() and shop.printed() == []
    assert any(text.startswith("macro m: on_early_end is not executed after a stop") for text in shop.warned())
    with pytest.raises(Stopped, match="/resume"):
        await shop.play(shop.session.macros.load("m"))
    assert len(shop.endings) == 0 and shop.printed() == []


async def test_a_stop_ends_on_stop_and_what_it_moved(shop: Shop) -> None:
    after = ("@press:a SL 500", "/sleep 9", "@press:a PR 77")
    shop.save("m", "XX 1", on_early_end=after, on_early_end_moves=True)
    playing = asyncio.create_task(shop.session.run("/play m"))
    await asyncio.sleep(3)
    assert shop.moving() == {"press:a"}
    shop.session.stop("Ctrl+X")
    with pytest.raises(Stopped):
        await playing
    assert shop.moving() == set() and shop.printed() == []
    assert any(text.startswith("macro m: on_early_end is not executed after a stop") for text in shop.warned())


async def test_a_second_interruption_ends_on_stop_and_stops_what_it_moved(shop: Shop) -> None:
    shop.save("m", "/sleep 5", on_early_end=("@press:a SL 500", "/sleep 9", "@press:a PR 77"), on_early_end_moves=True)
    playing = asyncio.create_task(shop.session.run("/play m"))
    await asyncio.sleep(1)
    shop.session.interrupt()
    await asyncio.sleep(3)
    assert shop.moving() == {"press:a"}
    shop.session.interrupt()
    with pytest.raises(asyncio.CancelledError):
        await playing
    await asyncio.sleep(1)
    assert shop.moving() == set() and shop.printed() == []


async def test_a_lost_connection_ends_it_and_on_stop_reaches_the_other_line(shop: Shop) -> None:
    after = ("@gantry:c PR 1", "@press:a PR 2")
    lines = ("@gantry:c SL 50", "@press:a SL 70", "/sleep 0.6", "@gantry:c PR P")
    shop.save("m", *lines, on_early_end=after)
    playing = asyncio.create_task(shop.session.run("/play m"))
    await asyncio.sleep(0.5)
    shop.world("/sim unplug gantry")
    with pytest.raises(TransportLost) as caught:
        await playing
    assert short(caught.value.__notes__, shop) == ["macro m, step 4 (m.toml:24)"]
    assert shop.moving() == {"gantry:c"} and shop.printed() == ["2"]
    assert "gantry:c not known (the connection is lost); press:a is at rest at " in shop.warned()[-1]
    assert any("gantry: stop not sent" in text and "E-stop" in text for text in shop.warned())


@pytest.mark.parametrize(("reconnect", "kind"), [(False, "macro"), (True, "macro"), (False, "script")])
async def test_a_connection_that_is_lost_while_no_line_uses_it_ends_it_at_once(
    reconnect: bool, kind: str, tmp_path: Path
) -> None:
    async with Shop(tmp_path, reconnect=reconnect) as shop:
        lines = ("@press:a SL 70", "@gantry:c PR P", "/sleep 1000")
        macro = shop.save("m", *lines, on_early_end=("@press:a PR 2",))
        (tmp_path / "s.txt").write_text("\n".join(lines))
        script = read_script(str(tmp_path / "s.txt"), {})
        work = shop.play(macro) if kind == "macro" else run_script(shop.session, shop.session.origin, script)
        playing = asyncio.create_task(work)
        await asyncio.sleep(0.5)
        shop.world("/sim unplug gantry")
        with pytest.raises(TransportLost, match="gantry was lost") as caught:
            await asyncio.wait_for(playing, 9)
        place = "macro m, step 3 (m.toml:17)" if kind == "macro" else f"{tmp_path}{os.sep}s.txt:3"
        assert short(caught.value.__notes__, shop) == [place]
        assert shop.moving() == set() and shop.printed() == ["0"] + ["2"] * (kind == "macro")


async def test_a_lost_connection_that_it_does_not_use_is_nothing_to_it(shop: Shop) -> None:
    playing = asyncio.create_task(shop.play(shop.save("m", "@press:a PR P", "/sleep 5")))
    await asyncio.sleep(0.5)
    shop.world("/sim unplug gantry")
    await playing
    assert shop.endings == [MacroEnding("m", 1)]


async def test_nothing_is_asked_of_a_drive_to_which_nothing_was_sent(shop: Shop) -> None:
    shop.session.questions.agreed = False
    with pytest.raises(Diagnostic, match="a macro cannot ask"):
        await shop.play(shop.save("m", "@press:a CP"))
    assert not [each for each in shop.events if isinstance(each, OnBus) and isinstance(each.event, Traffic)]
    assert shop.endings == [MacroEnding("m", 0, "macro m, step 1 of 1")]


async def test_a_script_that_plays_a_macro_runs_its_on_stop_and_reports_both(tmp_path: Path, shop: Shop) -> None:
    shop.save("m", "@press:a SL 100", "/assert 1 == 2", on_early_end=("/print after",))
    (tmp_path / "s.txt").write_text("@gantry:c SL 100\n/play m\n")
    script = read_script(str(tmp_path / "s.txt"), {}, shop.session.macros)
    with pytest.raises(DriveError) as caught:
        async with automated(shop.session):
            await run_script(shop.session, shop.session.origin, script, shop.executed)
    assert [note.partition(" (")[0] for note in caught.value.__notes__] == [
        "macro m, step 2",
        f"{tmp_path}{os.sep}s.txt:2",
    ]
    assert shop.moving() == set() and shop.printed() == ["after"]
    assert [(each.line.macro, each.ok) for each in shop.results] == [
        ("", True),
        ("m", True),
        ("m", False),
        ("m", True),
    ]


async def test_the_json_of_a_macro_names_macro_step_and_round_and_its_end(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    async with Shop(tmp_path) as shop:
        macro = shop.save("m", "@press:a PR 1", '/expect "2" 0', on_early_end=("/print x",))
        told = BatchReport("macro m", as_json=True, junit=str(tmp_path / "r.xml"))
        with pytest.raises(DriveError):
            await play(
                shop.session, shop.session.origin, macro, {}, times=None, executed=told.executed, ended=told.ended
            )
        assert told.finish(1) == 1
        objects = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    first, second, third, last = objects
    assert (first["macro"], first["step"], first["round"], first["printed"]) == ("m", 1, 1, ["1"])
    assert (first["line"], first["file"]) == (9, str(shop.session.macros.path("m"))) and not second["ok"]
    assert third["on_stop"] is True and "step" not in third
    drives = {"press:a": {"position": 0, "velocity": 0}}
    summary = {"lines": 3, "failed": 1, "macro": "m", "rounds": 0, "at": "macro m, step 2 of 2, round 1"}
    assert last["summary"].items() >= (summary | {"drives": drives}).items()
    xml = (tmp_path / "r.xml").read_text()
    assert xml.count("<testsuite ") == 1 and 'name="macro m"' in xml and "step 2" in xml


async def test_warnings_of_the_report_are_lines_for_a_person(shop: Shop) -> None:
    macro = shop.save("m", *["@a PR 1"] * 7, "XX 1")
    with pytest.raises(Refused):
        await shop.play(macro)
    texts = [event.text for event in shop.events if isinstance(event, Notified) and event.text.startswith("  step")]
    assert [text[:8] for text in texts] == [f"  step {number}" for number in (4, 5, 6, 7, 8)]
