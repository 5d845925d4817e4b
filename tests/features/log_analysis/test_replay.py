"""`log replay`: what of a log is sent again, how answers are compared, and that nothing is left moving."""

from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic, DriveError, Stopped
from multidrop.features.log_analysis.replay import replay
from multidrop.shell.log.files import BEGIN, KINDS, LogEntry, line_of
from multidrop.shell.log.steps import compared, read
from multidrop.shell.log.writer import SessionLog
from tests.support.automated import automated
from tests.support.cell_session import CellSession, bus, party
from tests.support.virtual import in_virtual_time

pytestmark = pytest.mark.virtual

AT = datetime(2026, 11, 22, tzinfo=UTC)
PRESS = bus("press", party("a"), party("b"))


def entry(kind, text, drive="a", bus="press", after=0.0, **more):
    return LogEntry(AT + timedelta(seconds=after), kind, text, bus, drive, **more)


def typed(text, *printed, drive="a", bus="press", failed="", after=0.0, by="operator"):
    yield entry("typed", f"@{drive} {text}", drive, bus, after, by=by)
    yield entry("sent", f"{drive}{text}\n", drive, bus, after)
    yield from (entry("printed", each, drive, bus, after) for each in printed)
    if failed:
        yield entry("failed", failed, drive, bus, after)


def verb(text, after=0.0):
    return [entry("typed", text, "", "", after, by="operator")]


def steps_of(folder, *entries):
    path = folder / "log"
    head = entry("log", f"{BEGIN} of process 1", "", "")
    path.write_bytes(b"".join(map(line_of, (head, *(each for some in entries for each in some)))))
    return read(path)


class Cell(CellSession):
    """A cell whose typed lines are kept."""

    def lines(self):
        return [each.line for each in self.events if type(each).__name__ == "Entered"]


async def taken(cell, folder, *entries, fast=True):
    await replay(cell.session, steps_of(folder, *entries), fast=fast)


@in_virtual_time
async def recorded_and_replayed(tmp_path, fast):
    lines = ("@a PR P", "@b MR 51200", "@b PR P", "/wait stopped", "@b PR P", "@a VM = 300000", "/drives", "@* SL 0")
    (tmp_path / "then").mkdir()
    async with Cell(tmp_path / "then", PRESS) as cell:
        cell.session.log = SessionLog(cell.session, tmp_path / "day.log")
        for line in lines:
            await cell.session.run(line)
        with pytest.raises(DriveError):
            await cell.session.run("@a ZZ 1")
        took = cell.session.now()
    (tmp_path / "now").mkdir()
    async with Cell(tmp_path / "now", PRESS) as cell:
        await replay(cell.session, read(tmp_path / "day.log"), fast=fast)
        assert cell.moving() == set()
        assert [each for each in cell.lines() if "drives" not in each] == [
            f"@press:{each[1:]}" if each[0] == "@" else each for each in (*lines[:6], lines[7], "@a ZZ 1")
        ]
        assert any(each.startswith("8 lines replayed, 0 differ") for each in cell.told())
        assert "not replayed: /drives" in cell.told()
        if not fast:
            assert cell.session.now() >= took - 1.0


@pytest.mark.parametrize("fast", [True, False])
def test_a_log_that_was_written_replays_without_a_difference(tmp_path, fast):
    recorded_and_replayed(tmp_path, fast)


async def test_another_answer_is_shown_and_the_rest_goes_on_and_the_end_is_exit_1(tmp_path, capsys):
    async with Cell(tmp_path, PRESS) as cell:
        with pytest.raises(DriveError, match="1 of 3 lines gave another answer"):
            await taken(cell, tmp_path, typed("PR R1", "5"), typed("PR R2", "0"), typed("PR R3", "0", drive="b"))
        [text] = capsys.readouterr().out.splitlines()
        assert text.endswith("log:2: press:a PR R1: then 5; now 0")


async def test_the_first_difference_in_an_error_ends_it(tmp_path):
    async with Cell(tmp_path, PRESS) as cell:
        with pytest.raises(DriveError, match=r"log:\d+: press:a ZZ 1: then no error; now .*error 60"):
            await taken(cell, tmp_path, typed("ZZ 1"), typed("MR 1000"))
        assert cell.lines() == ["@press:a ZZ 1"]
        with pytest.raises(DriveError, match=r"press:a PR P: then a refused: error 20; now no error"):
            await taken(cell, tmp_path, typed("PR P", failed="a refused: error 20"), typed("MR 1000"))


async def test_numbers_of_a_drive_that_may_move_are_not_compared_until_a_wait(tmp_path, capsys):
    async with Cell(tmp_path, PRESS) as cell:
        moving = [typed("MR 5000"), typed("PR P", "17"), typed("PR P", "3", drive="b"), verb("/wait stopped")]
        with pytest.raises(DriveError, match="2 of 5"):
            await taken(cell, tmp_path, *moving, typed("PR P", "4999"))
        assert [each.partition(": ")[2] for each in capsys.readouterr().out.splitlines()] == [
            "press:b PR P: then 3; now 0",
            "press:a PR P: then 4999; now 5000",
        ]


async def test_what_it_moved_is_stopped_at_the_end(tmp_path):
    async with Cell(tmp_path, PRESS) as cell:
        async with automated(cell.session):
            await taken(cell, tmp_path, typed("SL 20000"))
        assert cell.moving() == set() and "SL 20000" in cell.lines()[0]


async def test_the_pauses_of_the_log_are_kept_unless_it_is_fast(tmp_path):
    lines = [typed("PR R1", "0"), typed("PR R1", "0", after=100.0)]
    async with Cell(tmp_path, PRESS) as cell:
        for fast, least, most in ((True, 0, 5), (False, 99, 105)):
            began = cell.session.now()
            await taken(cell, tmp_path, *lines, fast=fast)
            assert least <= cell.session.now() - began < most
            lines = [typed("PR R1", "0"), typed("PR R1", "0", after=100.0)]


async def test_a_stop_in_the_log_is_a_stop_and_automation_goes_on(tmp_path):
    async with Cell(tmp_path, PRESS) as cell:
        await taken(cell, tmp_path, typed("SL 20000"), [entry("stop", "stop", "", "")], typed("PR V", "0"))
        assert cell.session.stops == 1 and not cell.session.latched and cell.moving() == set()


async def test_a_stop_of_a_person_ends_it_for_good(tmp_path):
    async with Cell(tmp_path, PRESS) as cell:
        cell.session.stop()
        with pytest.raises(Stopped):
            await taken(cell, tmp_path, [entry("stop", "stop", "", "")], typed("SL 20000"))
        with pytest.raises(Stopped):
            await taken(cell, tmp_path, typed("SL 20000"))
        assert cell.moving() == set()


async def asked(tmp_path, answer, *entries):
    """What is asked and announced before a real drive, and the lines that were run."""
    async with Cell(tmp_path, PRESS) as cell:
        cell.session.questions.agreed = False
        record = cell.session.of(cell.session.bus())
        opened, record.opened = record.opened, replace(record.opened, floor=None)
        questions = []

        async def ask(question):
            questions.append(question)
            return answer

        cell.session.front.ask = ask
        try:
            await taken(cell, tmp_path, *entries)
        except Diagnostic as problem:
            questions.append(str(problem))
        record.opened = opened
        return questions, cell.told(), cell.lines()


async def test_real_drives_and_what_moves_them_are_listed_and_asked_about(tmp_path):
    log = [typed("MR 100"), typed("PR R1", "0"), typed("PR R1", "0", drive="b"), verb("/sim push a 5")]
    (question, refusal), told, lines = await asked(tmp_path, False, *log)
    assert question == "3 lines are sent; 1 of them can start motion or ask first" and "the answer was no" in refusal
    assert [each.split()[:2] for each in told[1:3]] == [["drive", "press:a:"], ["drive", "press:b:"]]
    assert told[0] == "not replayed: /sim" and told[3].endswith("log:2: press:a MR 100") and lines == []
    _, _, lines = await asked(tmp_path, True, typed("MR 100"))
    assert lines == ["@press:a MR 100"]


async def test_a_drive_or_bus_that_is_not_there_is_named_before_anything_is_sent(tmp_path):
    async with Cell(tmp_path, PRESS, bus("line", party("x"))) as cell:
        for place, text in ((("c", "press"), "drive press:c"), (("a", "other"), "bus other")):
            both = f"drives of the log: press:a, {place[1]}:{place[0]}; open: press:a, press:b, line:x$"
            with pytest.raises(Diagnostic, match=f"the log has a {text}; {both}"):
                await taken(cell, tmp_path, typed("MR 100"), typed("MR 100", drive=place[0], bus=place[1]))
        await taken(cell, tmp_path, typed("PR R1", "0", drive="c", bus="line"))
        assert cell.lines() == ["@line:x PR R1"]


def test_lines_of_a_macro_are_sent_once_and_polls_raw_text_and_unsent_lines_never(tmp_path):
    found = steps_of(
        tmp_path,
        verb("/play shuttle"),
        typed("MR 1", by="macro"),
        [entry("sent", "aPR V\n", poll=True)],
        [entry("typed", "ATZ", "", "modem", by="operator", raw=True)],
        [entry("typed", "@a FD", by="operator"), entry("failed", "a: FD resets; the answer was no")],
        verb("/open tcp://***@x"),
        verb("/sleep 2"),
    )
    assert [each.text for each in found.steps] == ["MR 1", "/sleep 2"]
    assert list(found.skipped) == ["lines in raw mode", "/open"] and found.unsent == 1


def test_only_the_last_session_is_replayed_over_its_parts(tmp_path):
    def head(word):
        return entry("log", f"{word} of process 1", "", "")

    older = [head(BEGIN), *typed("MR 1"), head(BEGIN), *typed("MR 2")]
    (tmp_path / "log.1").write_bytes(b"".join(map(line_of, older)))
    (tmp_path / "log").write_bytes(b"".join(map(line_of, [head("part"), *typed("MR 3")])))
    assert [each.text for each in read(tmp_path / "log").steps] == ["MR 2", "MR 3"]


def test_a_secret_or_a_file_of_another_kind_is_refused(tmp_path):
    with pytest.raises(Diagnostic, match=r"log:2: holds a secret"):
        steps_of(tmp_path, typed("token = x"))
    with pytest.raises(Diagnostic, match=r"log:2: holds control characters"):
        steps_of(tmp_path, typed("PR P\nMR 1000"))
    (tmp_path / "text").write_text("hello\n")
    with pytest.raises(Diagnostic, match="text: is not a session log"):
        read(tmp_path / "text")


@pytest.mark.parametrize(
    ("then", "now", "moving", "same"),
    [
        (["5"], ["5"], False, True),
        (["5"], ["6"], False, False),
        (["5"], ["6"], True, True),
        (["5"], ["-6.5"], True, True),
        (["5"], ["x"], True, False),
        (["5"], ["5", "6"], True, False),
        ([], [], False, True),
    ],
    ids=str,
)
def test_answers_are_compared(tmp_path, then, now, moving, same):
    [step] = steps_of(tmp_path, typed("PR P", *then)).steps
    assert (compared(step, now, "", moving) == "") is same


async def test_a_log_that_cannot_be_opened_leaves_the_one_that_runs(tmp_path):
    async with Cell(tmp_path, PRESS) as cell:
        await cell.session.run(f"/log {tmp_path / 'day.log'}")
        with pytest.raises(Diagnostic):
            await cell.session.run(f"/log {tmp_path / 'gone' / 'day.log'}")
        await cell.session.run("PR P")
        assert "PR P" in (tmp_path / "day.log").read_text() and cell.session.log is not None
        await cell.session.run("/log on")
        assert cell.session.log.path.parent == tmp_path / "state" / "logs"
        await cell.session.run("/log off")
        assert cell.session.log is None and cell.told()[-1] == "log: off"


WORDS = st.sampled_from(["", "@", "@a", "@a PR P", "/", "/wait", "/sleep 1", "PR P", "/open x", "a error 20"])
NAMES = st.sampled_from(["", "a", "press", "*"])


@given(st.lists(st.builds(LogEntry, st.just(AT), st.sampled_from([*KINDS]), WORDS, NAMES, NAMES, raw=st.booleans())))
def test_any_log_is_read_or_refused_in_one_line(entries):
    with TemporaryDirectory() as folder, suppress(Diagnostic):
        found = steps_of(Path(folder), entries)
        assert all(each.sent and (each.text or each.failed == "") for each in found.steps)
