"""Reports of macros: JSON, JUnit, and a script that plays one."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from multidrop.dialects import DriveError, Refused
from multidrop.shell.batch.report import Report
from multidrop.shell.events import Notified
from multidrop.shell.scripts.executor import play, run_script
from multidrop.shell.scripts.reading import read_script
from tests.support.macro_shop import Shop

pytestmark = pytest.mark.virtual


async def test_a_script_that_plays_a_macro_runs_its_on_stop_and_reports_both(tmp_path: Path, shop: Shop) -> None:
    shop.save("m", "@press:a SL 100", "/assert 1 == 2", on_stop=("/print after",))
    (tmp_path / "s.txt").write_text("@gantry:c SL 100\n/play m\n")
    script = read_script(str(tmp_path / "s.txt"), {}, shop.session.macros)
    with pytest.raises(DriveError) as caught:
        async with shop.session.automations.run():
            await run_script(shop.session, script, shop.executed)
    assert [note.partition(" (")[0] for note in caught.value.__notes__] == [
        "macro m, step 2",
        f"{tmp_path}/s.txt:2",
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
        macro = shop.save("m", "@press:a PR 1", '/expect "2" 0', on_stop=("/print x",))
        told = Report("macro m", as_json=True, junit=str(tmp_path / "r.xml"))
        with pytest.raises(DriveError):
            await play(shop.session, macro, {}, times=None, watcher=told)
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
