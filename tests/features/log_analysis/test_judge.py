"""The judge of a session log: a good log breaks no rule, and each planted breach is found at its line."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from multidrop.features.log_analysis.judge import RULES, judged
from multidrop.shell.log import files
from multidrop.shell.log.files import LogEntry, line_of

Rows = list[dict[str, Any]]
STOP = {"kind": "stop", "text": "stop of every drive"}
ESC = {"kind": "sent", "bus": "l", "text": "\x1b", "stop": True}


def typed(text: str, drive: str = "a", by: str = "operator") -> dict[str, Any]:
    return {"kind": "typed", "bus": "l", "drive": drive, "text": f"@l:{drive} {text}", "by": by}


def command(text: str, drive: str = "a", reply: str = "\x06") -> Rows:
    sent = {"kind": "sent", "bus": "l", "drive": drive, "text": f"{drive}{text}\n", "command": text}
    return [sent, {"kind": "received", "bus": "l", "drive": drive, "text": reply}]


def asked(text: str, reply: str, drive: str = "a") -> Rows:
    sent = {"kind": "sent", "bus": "l", "drive": drive, "text": f"{drive}PR {text},DN\n"}
    return [sent, {"kind": "received", "bus": "l", "drive": drive, "text": f'{reply}"{drive}"\r\n'}]


def said(text: str, kind: str = "notice") -> dict[str, Any]:
    return {"kind": kind, "bus": "l", "text": text}


DENIED = {**said("a: stopped; 'SL 7' was not sent", "failed"), "drive": "a"}
READ = asked("BY,P", "0512") * 2
HEAD: Rows = [
    {"kind": "log", "text": "session of process 7", "marks": True},
    {"kind": "bus", "bus": "l", "text": "p: a"},
]
GOOD: Rows = [
    *HEAD,
    typed("MR 100"),
    *command("MR 100"),
    typed("PR P"),
    *asked("P", "384112"),
    {"kind": "printed", "bus": "l", "drive": "a", "text": "384112"},
    typed("SL 7"),
    STOP,
    ESC,
    DENIED,
    *READ,
    said("l: a: stopped, velocity 0 at 512"),
    typed("MR 200"),
    *command("MR 200", reply="\x15"),
    *asked("ER", "0"),
    *command("MR 200"),
    typed("MR 100"),
    *command("MR 100"),
]


def found(rows: Rows, tmp_path: Path, apart: float = 10.0) -> list[tuple[str, int]]:
    path = tmp_path / "day.jsonl"
    entries = (LogEntry(datetime.fromtimestamp(at * apart, UTC), **row) for at, row in enumerate(rows))
    path.write_bytes(b"".join(map(line_of, entries)))
    return [(each.rule, each.line.number) for each in judged(files.whole(path)).breaches]


def at(row: dict[str, Any], rows: Rows = GOOD) -> int:
    return rows.index(row)


def test_a_good_log_breaks_no_rule(tmp_path: Path) -> None:
    assert found(GOOD, tmp_path) == []


def again(rows: Rows) -> int:
    """The command goes out once more, without a NAK."""
    where = at(typed("PR P"))
    rows[where:where] = command("MR 100")
    return where


def again_without_a_question(rows: Rows) -> int:
    where = at(asked("ER", "0")[0])
    del rows[where : where + 2]
    return where


def five_times(rows: Rows) -> int:
    where = at(typed("MR 100"), GOOD[5:]) + 5
    rows[where:where] = [*command("MR 200", reply="\x15"), *asked("ER", "0")] * 3
    rows[where - 1]["text"] = "\x15"
    rows[where:where] = asked("ER", "0")
    return where + 2 + 8


def denied(rows: Rows) -> int:
    where = at(typed("SL 7"))
    rows[where + 1 : where + 1] = command("SL 7")
    return at(DENIED, rows)


def denied_and_then_sent(rows: Rows) -> int:
    rows += [said("not sent, as 'MR 9' failed: @l:a MR 300"), *command("MR 300")]
    return len(rows) - 2


def after_a_stop(rows: Rows) -> int:
    where = at(ESC)
    rows[where + 1 : where + 1] = command("SL 7")
    return where + 1


def question_first(rows: Rows) -> int:
    where = at(ESC)
    rows[where:where] = asked("P", "1")
    return where


def one_reading(rows: Rows) -> int:
    where = at(READ[0])
    del rows[where : where + 2]
    return at(said("l: a: stopped, velocity 0 at 512"), rows)


def readings_of_another(rows: Rows) -> int:
    where = at(READ[0])
    rows[where : where + 2] = asked("BY,P", "0512", "b")
    return at(said("l: a: stopped, velocity 0 at 512"), rows)


def value_of_another(rows: Rows) -> int:
    where = at(typed("PR P"))
    rows[where + 2] = {**rows[where + 2], "text": '384112"b"\r\n'}
    return where + 3


def value_of_nobody(rows: Rows) -> int:
    where = at(typed("PR P"))
    rows[where + 3] = {**rows[where + 3], "text": "384113"}
    return where + 3


def silence(rows: Rows) -> int:
    where = at(typed("PR P"))
    del rows[where - 1]
    return where - 1


PLANTED: dict[str, list[Callable[[Rows], int]]] = {
    "twice": [again, again_without_a_question, five_times],
    "not sent": [denied, denied_and_then_sent],
    "after a stop": [after_a_stop],
    "first": [question_first],
    "stopped": [one_reading, readings_of_another],
    "credited": [value_of_another, value_of_nobody],
    "silence": [silence],
}


@pytest.mark.parametrize(("rule", "plant"), [(rule, each) for rule, plants in PLANTED.items() for each in plants])
def test_a_planted_breach_is_found_at_its_line(rule: str, plant: Callable[[Rows], int], tmp_path: Path) -> None:
    rows = [{**row} for row in GOOD]
    where = plant(rows)
    assert (rule, where + 1) in found(rows, tmp_path)
    assert {each for each, _ in found(rows, tmp_path)} <= {rule, "not sent"}


def test_each_rule_has_a_planted_breach() -> None:
    assert [*PLANTED] == [*RULES]


@pytest.mark.parametrize("gap", [{"kind": "missing", "text": "3 entries are missing here"}, HEAD[0]])
def test_a_gap_or_a_new_session_begins_anew(gap: dict[str, Any], tmp_path: Path) -> None:
    rows = [{**row} for row in GOOD]
    where = after_a_stop(rows)
    rows.insert(where, gap)
    rows.insert(where + 1, HEAD[1])
    assert ("after a stop", where + 3) not in found(rows, tmp_path)


def test_the_end_of_a_longer_value_of_another_drive_is_not_taken_for_the_printed_one(tmp_path: Path) -> None:
    sent = {"kind": "sent", "bus": "l", "drive": "b", "text": 'bPR R1,"~b"\n'}
    received = {"kind": "received", "bus": "l", "drive": "b", "text": "0~b\r\n"}
    printed = {"kind": "printed", "bus": "l", "drive": "b", "text": "0"}
    assert found([*HEAD, typed("PR R1", "b"), sent, received, *asked("BY,P", "0110"), printed], tmp_path) == []
    assert found([*HEAD, typed("PR R1", "b"), sent, received, *asked("EF", "0"), printed], tmp_path) == []


def test_a_reply_to_what_was_typed_before_the_log_began_is_not_judged(tmp_path: Path) -> None:
    printed = {"kind": "printed", "bus": "l", "drive": "a", "text": "384112"}
    assert found([*HEAD, *asked("V", "0"), printed], tmp_path) == []
    assert found([*HEAD, typed("PR P"), *asked("V", "0"), printed], tmp_path) == [("credited", 6)]


def test_a_line_feed_within_a_received_line_is_no_part_of_it(tmp_path: Path) -> None:
    sent = {"kind": "sent", "bus": "l", "drive": "03", "text": "@03V1\r"}
    received = {"kind": "received", "bus": "l", "drive": "03", "text": "97:2\n3082\r"}
    printed = {"kind": "printed", "bus": "l", "drive": "03", "text": "97:23082"}
    assert found([*HEAD, typed("V1", "03"), sent, received, printed], tmp_path) == []
    other = {**printed, "text": "97:23083"}
    assert found([*HEAD, typed("V1", "03"), sent, received, other], tmp_path) == [("credited", 6)]


@pytest.mark.parametrize(("of", "breaches"), [("session", ["credited"]), ("part", [])])
def test_a_reply_to_what_was_sent_before_the_log_began_is_not_judged(
    of: str, breaches: list[str], tmp_path: Path
) -> None:
    head = {**HEAD[0], "text": f"{of} of process 7"}
    heard = {"kind": "received", "bus": "l", "drive": "a", "text": '384112"a"\r\n'}
    printed = {"kind": "printed", "bus": "l", "drive": "a", "text": "384112"}
    rows = [head, HEAD[1], typed("SL 7", by="script"), heard, asked("MV", "0")[0], printed]
    assert [rule for rule, _ in found(rows, tmp_path)] == breaches


def test_what_another_origin_types_meanwhile_is_no_silence(tmp_path: Path) -> None:
    rows = [*HEAD, typed("MR 1", by="macro"), command("MR 1")[0], typed("MR 2"), said("a does not reply", "failed")]
    assert found([*rows, typed("MR 3", by="macro")], tmp_path) == []


def test_a_line_of_another_tab_is_typed_while_the_one_before_waits_for_its_reply(tmp_path: Path) -> None:
    sent, reply = command("MR 1")
    rows = [*HEAD, typed("MR 1"), sent, typed("MR 2")]
    assert found([*rows, reply, *command("MR 2")], tmp_path, apart=0.1) == []
    assert found([*rows, *command("MR 2")], tmp_path, apart=0.1) == [("silence", 6)]


def test_a_computer_that_stands_still_may_ask_late_what_became_of_a_command(tmp_path: Path) -> None:
    question, reply = asked("EF", "0")
    rows = [*HEAD, typed("MR 1"), command("MR 1")[0], question, typed("MR 2")]
    assert found([*rows, reply, *command("MR 2")], tmp_path, apart=3.0) == []
    assert found([*rows, *command("MR 2")], tmp_path, apart=3.0) == [("silence", 7)]


@pytest.mark.parametrize(("readings", "breaches"), [(1, ["stopped"]), (2, [])])
def test_an_earlier_stop_may_be_confirmed_as_another_one_comes(
    readings: int, breaches: list[str], tmp_path: Path
) -> None:
    first = [STOP, ESC, typed("R2=1"), command("R2=1")[0], said("a: late", "failed")]
    rows = [*HEAD, *first, *asked("BY,P", "0512") * readings, STOP, said("l: a: stopped, velocity 0 at 512"), ESC]
    assert [rule for rule, _ in found(rows, tmp_path, apart=0.01)] == breaches
    assert [rule for rule, _ in found(rows, tmp_path)] == ["stopped"]


@pytest.mark.parametrize(("of", "breaches"), [("session", ["stopped"]), ("part", [])])
def test_a_log_that_begins_in_the_middle_may_have_the_end_of_a_stop_before_it(
    of: str, breaches: list[str], tmp_path: Path
) -> None:
    rows = [{**HEAD[0], "text": f"{of} of process 7"}, HEAD[1], STOP, ESC, said("l: a: stopped, velocity 0 at 512")]
    assert [rule for rule, _ in found(rows, tmp_path, apart=0.01)] == breaches
    assert [rule for rule, _ in found(rows, tmp_path)] == ["stopped"]


@pytest.mark.parametrize(("by", "breaches"), [("operator", ["silence"]), ("macro", []), ("script", [])])
def test_of_several_macros_or_scripts_that_run_at_once_one_may_wait_for_its_reply(
    by: str, breaches: list[str], tmp_path: Path
) -> None:
    rows = [*HEAD, typed("MR 1", by=by), command("MR 1")[0], typed("MR 2", by=by)]
    assert [rule for rule, _ in found(rows, tmp_path)] == breaches


def test_frames_name_the_drive_that_replied(tmp_path: Path) -> None:
    def frame(*data: int) -> str:
        return bytes((*data, sum(data) & 0xFF)).decode("latin-1")

    question = {"kind": "sent", "bus": "l", "drive": "1", "text": frame(1, 6, 1, 0, 0, 0, 0, 0)}
    printed = {"kind": "printed", "bus": "l", "drive": "1", "text": "7"}
    for module, breaches in ((1, []), (2, [("credited", 6)])):
        reply = {"kind": "received", "bus": "l", "drive": "1", "text": frame(2, module, 100, 6, 0, 0, 0, 7)}
        assert found([*HEAD, typed("GAP 1, 0", "1"), question, reply, printed], tmp_path) == breaches
    question["text"], reply["text"] = "\0\7\0\0\0\6\1\3\0\x21\0\1", "\0\6\0\0\0\5\1\3\2\0\7"
    assert found([*HEAD, typed("PR P", "1"), question, reply, printed], tmp_path) == [("credited", 6)]
    reply["text"] = "\0\7\0\0\0\5\1\3\2\0\7"
    assert found([*HEAD, typed("PR P", "1"), question, reply, printed], tmp_path) == []


def test_the_page_lists_the_rules() -> None:
    page = (Path(__file__).parents[3] / "docs" / "log.md").read_text(encoding="utf-8")
    for rule, sentence in RULES.items():
        assert f"| `{rule}` | {sentence} |" in page


def test_a_session_whose_commands_are_not_marked_is_not_judged(tmp_path: Path) -> None:
    rows = [{**row} for row in GOOD]
    del rows[0]["marks"]
    after_a_stop(rows)
    assert found(rows, tmp_path) == []
    assert "marks" not in json.loads(line_of(LogEntry(datetime.now(UTC), "log", "session")))


def test_a_velocity_behind_the_mark_of_a_drive_alone_names_no_drive(tmp_path: Path) -> None:
    sent = {"kind": "sent", "bus": "l", "drive": "!", "text": 'PR BY,P,"~",V\r'}
    heard = {"kind": "received", "bus": "l", "drive": "!", "text": "00~0\r\n"}
    asks = {**sent, "text": 'PR R1 R4,"~"\r'}
    reply = {**heard, "text": "00~\r\n"}
    shown = {"kind": "printed", "bus": "l", "drive": "!", "text": "00"}
    assert found([*HEAD, typed("PR R1 R4", "!"), sent, heard, asks, reply, shown], tmp_path) == []


@pytest.mark.parametrize(("first", "breaches"), [([], []), ([typed("EM=0")], ["not sent"])])
def test_what_multidrop_sends_by_itself_may_be_stopped_and_come_again(
    first: Rows, breaches: list[str], tmp_path: Path
) -> None:
    failed = {**said("a: stopped; 'EM=0' was not sent", "failed"), "drive": "a"}
    noted = {**said("a: its echo mode may be EM=0 now: a does not reply: 'EM=0' was not sent"), "drive": "a"}
    for each in (failed, noted):
        rows = [*HEAD, *first, typed("PG 1"), each, typed("PG 1"), *command("EM=0")]
        assert [rule for rule, _ in found(rows, tmp_path)] == breaches


def test_a_checksum_behind_the_mark_of_a_drive_alone_names_no_drive(tmp_path: Path) -> None:
    sent = {"kind": "sent", "bus": "l", "drive": "!", "text": 'PR "v",R1,"~"\u00b5\r'}
    heard = {"kind": "received", "bus": "l", "drive": "!", "text": "\u0006v73882858~\u00db\r\n"}
    shown = {"kind": "printed", "bus": "l", "drive": "!", "text": "v73882858"}
    assert found([*HEAD, typed('PR "v",R1', "!"), sent, heard, shown], tmp_path) == []


@pytest.mark.parametrize("first", ["stop", "command"])
def test_a_clock_that_was_set_back_keeps_the_stop_before_what_came_after_it(first: str, tmp_path: Path) -> None:
    sent = {"stop": [ESC, *READ], "command": [command("R2=1")[0], ESC]}[first]
    rows = [*HEAD, STOP, *sent, typed("MR 1"), *command("MR 1")]
    path = tmp_path / "day.jsonl"
    hours = [12, 12, 12, *([11] * (len(rows) - 5)), 12, 12]
    entries = (
        LogEntry(datetime(2026, 3, 2, hour, at, tzinfo=UTC), **row)
        for at, (hour, row) in enumerate(zip(hours, rows, strict=True))
    )
    path.write_bytes(b"".join(map(line_of, entries)))
    assert [each.rule for each in judged(files.whole(path)).breaches] == {"stop": [], "command": ["first"]}[first]


@pytest.mark.parametrize(
    ("drive", "report"), [("a", "l: a X"), ("a", "l: a motor 0"), ("", "l"), ("", "l X"), ("", "l motor 0")]
)
def test_the_report_of_the_stop_of_one_axis_is_of_its_drive(drive: str, report: str, tmp_path: Path) -> None:
    rows = [*HEAD, STOP, ESC, *asked("BY,P", "0512", drive) * 2, said(f"{report}: stopped, velocity 0 at 512")]
    assert found(rows, tmp_path, apart=0.01) == []
    del rows[4:6]
    assert [rule for rule, _ in found(rows, tmp_path, apart=0.01)] == ["stopped"]
