"""Scripts on simulated drives, in virtual time: blocks, checks, calls, and what their reports say."""

import asyncio
import json
import os
from xml.etree import ElementTree

import pytest

from multidrop.base.errors import Diagnostic, DriveError, Stopped
from multidrop.macros import Macro, MacroStep
from multidrop.shell.batch.report import BatchReport
from multidrop.shell.exit_codes import exit_code
from multidrop.shell.scripts.executor import run_script
from multidrop.shell.scripts.reading import read_script
from multidrop.shell.scripts.use import CheckFailed
from multidrop.shell.streams.stdout import report
from tests.support.automated import automated
from tests.support.cell_session import CellSession, bus, party, pmx

pytestmark = pytest.mark.virtual

FLOOR = (bus("press", party("a"), party("b", VM=700000), baud=0), bus("stages", pmx("00"), baud=0))


class Shop(CellSession):
    """A cell, and a way to run the text of a script on it as `multidrop run` does."""

    def __init__(self, folder):
        super().__init__(folder, *FLOOR)
        self.folder, self.results = folder, []

    async def run(self, text, **values):
        (self.folder / "s.txt").write_text(text, encoding="utf-8")
        script = read_script(str(self.folder / "s.txt"), values, self.session.macros)
        async with automated(self.session):
            await run_script(self.session, self.session.origin, script, self.results.append)

    async def failure(self, text, kind=DriveError, **values):
        """What a failing script says, without the folder."""
        with pytest.raises(kind) as caught:
            await self.run(text, **values)
        return report(caught.value).replace(f"{self.folder}{os.sep}", "")


@pytest.fixture
async def shop(tmp_path):
    async with Shop(tmp_path) as made:
        yield made


@pytest.mark.parametrize(
    ("text", "printed"),
    [
        ("/if VM == 768000\n/print yes\n/else\n/print no\n/end", ["yes"]),
        ("/if @b VM == 768000\n/print yes\n/else\n/print no\n/end", ["no"]),
        ("/if 0\n/print yes\n/end\n/print on", ["on"]),
        ("/set n 0\n/repeat 3\n/set n n + 2\n/if n > 2\n/print {n}\n/end\n/end", ["4", "6"]),
        ("/repeat {COUNT} - 2\n/print {{{COUNT}}}\n/end", ["{4}", "{4}"]),
        ("/set v @b VM / 2\n@a VM={v}\n@a PR VM", ["350000"]),
        ("/set v [PR P, 7]\n/print {v}", ["7"]),
        ("/set third 1 / 3\n/print {third}", ["0.333333333"]),
        ("/print\n/print a  b", ["", "a  b"]),
        ("/set px @stages:00 PX\n/print {px}", ["0"]),
        ("/print 1\n/quit\n/print 2", ["1"]),
        ("/repeat 5\n/print 1\n/quit\n/end", ["1"]),
        ("/set n 0\n/while n < 2\n/set n n + 1\n/print {n}\n/end", ["1", "2"]),
        ("/while 0\n/print never\n/end", []),
        ("/set n 0\n/until n == 2\n/set n n + 1\n/print {n}\n/end", ["1", "2"]),
        ("/until 1\n/print never\n/end", []),
        ("/until @a P >= 200\n@a MR 100\n/wait stopped\n/end\n@a PR P", ["200"]),
        ("/while 1\n/print 1\n/quit\n/end", ["1"]),
    ],
)
async def test_blocks_and_values(text, printed, shop):
    await shop.run(text, **({"COUNT": "4"} if "COUNT" in text else {}))
    assert shop.printed() == printed


@pytest.mark.parametrize(
    "line",
    [
        "P == 0",
        "P == 2 +- 2",
        "@b VM < 700001",
        "@a VM == @b VM + 68000",
        "@b VM + 1 == goal + 1",
        "VR != 6",
        "-5 % 3 == 1",
    ],
)
async def test_a_check_that_holds(line, shop):
    await shop.run(f"/set goal 700000\n/assert {line}\n")
    assert [(each.line.number, each.ok, each.check) for each in shop.results] == [(2, True, True)]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("/assert P == 512000 +- 2", "s.txt:2: /assert P == 512000 +- 2: wanted == 512000 +- 2, seen 0"),
        ("/assert @b VM<@a VM-68000", "s.txt:2: /assert @b VM<@a VM-68000: wanted < 700000, seen 700000"),
        ('/assert P == "x"', 's.txt:2: /assert P == "x": wanted == "x", seen 0'),
        ('/expect "READY"', 's.txt:2: /expect "READY": wanted "READY" within 1 s, seen "going READ"'),
        ('/expect "READY" 2.5', 's.txt:2: /expect "READY" 2.5: wanted "READY" within 2.5 s, seen "going READ"'),
    ],
)
async def test_a_check_that_fails_names_place_wanted_and_seen_and_stops_what_moves(line, said, shop):
    await shop.session.run("@b SL 1000")  # an operator's
    words = await shop.failure(f'@a PR "going READ"\n{line}\nMR 100', CheckFailed)
    assert words == said
    assert exit_code(CheckFailed()) == 1
    assert [each.ok for each in shop.results] == [True, False]
    assert shop.moving() == {"press:b"}


async def test_an_expectation_sees_what_comes_by_itself_and_not_the_scripts_own_words(shop):
    program = '@a PG 100\n@a LB G1\n@a H 1500\n@a PR "READY"\n@a E\n@a PG\n'
    await shop.run(f'{program}@a EX G1\n/print READY\n/expect "READY" 5\n/expect "READY"')
    assert shop.session.now() > 1.5
    assert shop.printed() == ["READY"]
    assert shop.results[-2].printed == ("READY",)


@pytest.mark.parametrize("at", [0.5, 1.5])
@pytest.mark.parametrize("line", ['@b PR "READY"', "/play ready", "/play print"])
async def test_an_expectation_does_not_see_what_others_print_meanwhile(line, at, shop):
    shop.session.macros.save(Macro("ready", (MacroStep(0.0, '@b PR "READY"'),)))
    shop.session.macros.save(Macro("print", (MacroStep(0.0, "/print READY"),)))
    checking = asyncio.create_task(shop.failure('@a PR "going"\n/sleep 1\n/expect "READY" 2', CheckFailed))
    await asyncio.sleep(at)
    await shop.session.run(line)
    assert any("READY" in each for each in shop.printed())
    assert await checking == 's.txt:3: /expect "READY" 2: wanted "READY" within 2 s, seen nothing'
    assert [(each.drive, each.printed) for each in shop.results] == [("a", ("going",)), ("", ()), ("", ())]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("/set n 1 / (2 - 2)", "s.txt:1: 1 / 0 has no result"),
        (
            "/repeat 1.5\n/end",
            "s.txt:1: /repeat: no number of repetitions 1.5; valid: 0 to 1000000000; usage: /repeat N",
        ),
        ('/if "x" > 1\n/end', 's.txt:1: "x" is not a number'),
        ("/assert @stages:00 X1000 == 1", "s.txt:1: stages:00: X1000 has no value to read"),
        ("/assert @stages:00 [X1000] == 1", "s.txt:1: stages:00: @stages:00 [X1000] can start motion"),
        ("/assert @press:a [MR 100] == 1", "s.txt:1: press:a: @press:a [MR 100] can start motion"),
        ("/assert @lost:a P == 1", "s.txt:1: no bus lost"),
        ("/set n 999999999\n/repeat 9\n/set n n * n\n/end", "s.txt:3: 999999999 * 999999999 is beyond 1e+15"),
    ],
)
async def test_what_only_shows_when_it_is_executed_sends_nothing(text, said, shop):
    assert (await shop.failure(text, Diagnostic)).startswith(said)
    assert not shop.moving()


async def test_a_drive_in_program_mode_is_not_asked(shop):
    said = await shop.failure("@a PG 100\n/assert @a P == 0")
    assert "s.txt:2: press:a is in program mode" in said


async def test_a_called_file_has_the_values_given_to_it_and_those_of_the_command_line(tmp_path, shop):
    called = tmp_path / "c.txt"
    called.write_text("/print {x} {all}\n/set x 7\n/if x > 6\n/assert P == {y}\n/end")
    said = await shop.failure(f'/set x 1\n/repeat 2\n/call {called} x="a b" y={{x}}\n/end', CheckFailed, all="*")
    assert said == "s.txt:3: c.txt:4: /assert P == 1: wanted == 1, seen 0"
    assert shop.printed() == ["a b *"]


async def test_a_called_macro_is_played(shop):
    shop.session.macros.save(Macro("say", (MacroStep(0.0, 'PR "{word}"'),)))
    await shop.run("/set w 5\n/call say word={w}")
    assert shop.printed() == ["5"]
    assert "no line takes the value wrod" in await shop.failure("/call say wrod=5", Diagnostic)


@pytest.mark.parametrize("head", ["/repeat 1000000000", "/while 1", "/until 0"])
async def test_a_stop_ends_a_loop_that_sends_nothing(head, shop):
    running = asyncio.create_task(shop.session.tasks.run(shop.run(f"{head}\n/set x 1\n/end")))
    await asyncio.sleep(0)
    for _ in range(20):
        await asyncio.sleep(0)
    shop.session.stop()
    with pytest.raises(Stopped):
        await running
    with pytest.raises(Stopped):
        await shop.run("/assert P == 0")


async def test_the_reports_agree(tmp_path, capsys):
    text = '@a PR "é<\\x1b"\n/set n 1\n/assert @b P != "\uffff"\n@a XX\n'
    async with Shop(tmp_path) as shop:
        whole = BatchReport("s.txt", as_json=True, junit=str(tmp_path / "j.xml"))
        whole.begin()
        before = ElementTree.parse(tmp_path / "j.xml").getroot()
        await shop.failure(text.replace("é", "e"))
        for each in shop.results:
            whole.executed(each)
        assert whole.finish(1) == 1
    assert before[0].attrib["errors"] == "1"
    facts = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [(each.get("line"), each.get("ok")) for each in facts] == [(1, True), (3, True), (4, False), (None, None)]
    assert facts[0]["printed"] == ["e<\\x1b"]
    assert (facts[1]["bus"], facts[1]["drive"]) == ("press", "b")
    assert (facts[2]["bus"], facts[2]["drive"]) == ("press", "a")
    assert "refused" in facts[2]["error"]
    assert (facts[3]["summary"]["lines"], facts[3]["summary"]["failed"]) == (3, 1)
    suites = ElementTree.parse(tmp_path / "j.xml").getroot()
    counts = [(suite.attrib["tests"], suite.attrib["failures"], suite.attrib["errors"]) for suite in suites]
    assert counts == [("0", "0", "0"), ("2", "0", "1")]


@pytest.mark.parametrize("name", ["script.txt", ".", pytest.param("pipe", marks=pytest.mark.fork)])
def test_a_report_replaces_nothing_but_a_report(name, tmp_path):
    if name == "pipe":
        os.mkfifo(tmp_path / name)
    (tmp_path / "script.txt").write_text("MR 100")
    report = BatchReport("s.txt", junit=str(tmp_path / name))
    with pytest.raises(Diagnostic, match="is no") as caught:
        report.begin()
    report.refused(caught.value)  # the end of the command does not write there, either
    assert (tmp_path / "script.txt").read_text() == "MR 100"


async def test_a_verify_that_does_not_hold_goes_on_and_fails_the_end(shop):
    text = "/verify P == 5\n/repeat 2\n/verify P == 0\n/verify P < 0\n/end\n/print on"
    said = await shop.failure(text, CheckFailed)
    assert shop.printed() == ["on"]
    assert said == "3 times a /verify did not hold: s.txt:1, s.txt:4; the rest was done"
    assert [(each.line.number, each.ok, each.check) for each in shop.results if each.check] == [
        (1, False, True),
        (3, True, True),
        (4, False, True),
        (3, True, True),
        (4, False, True),
    ]


async def test_what_moves_goes_on_after_a_verify_that_did_not_hold(shop):
    said = await shop.failure("@a SL 1000\n/verify @a P < 0", CheckFailed)
    assert said == "a /verify did not hold: s.txt:2; the rest was done"
    assert shop.session.automations.interrupted == []
    await shop.session.run("@a PR V")
    assert shop.printed()[-1] == "1000"


async def test_a_verify_whose_question_fails_ends_the_script(shop):
    said = await shop.failure("/verify QQ9 == 1\n/print on")
    assert said.startswith("s.txt:1: ") and shop.printed() == []


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("/while 1\n/print a", "s.txt:1: /while has no /end"),
        ("/until\n/end", "s.txt:1: /until: usage: /until EXPR"),
        ("/while 1\n/else\n/end", "s.txt:2: /else does not belong to the /while of line 1"),
        ("/verify P", "s.txt:1: /verify: P is not one comparison; valid: [@ADDR] EXPR OP EXPR [+- N]"),
        ("/while {n} < 1\n/set n 1\n/end", "s.txt:1: "),
        ("/until 1\n/set n 1\n/end\n/print {n}", "s.txt:4: "),
    ],
)
async def test_a_wrong_loop_or_check_is_told_before_the_first_line(text, said, shop):
    assert (await shop.failure(text, Diagnostic)).startswith(said)
    assert shop.results == []
