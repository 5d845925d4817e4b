"""The whole program in simulated time: the rules hold in the history of each seed, and a seed has one history."""

from __future__ import annotations

import random
import re
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from soak.languages import LANGUAGES
from soak.simulation import living, shrinking, story, world
from soak.simulation.__main__ import main
from soak.simulation.acts.act import Act
from soak.simulation.judges.departures import under_way
from soak.simulation.judges.judge import RULES, Judgement, broken
from soak.simulation.judges.outcomes import OUTCOMES
from soak.simulation.judges.rule import Granted, Rule
from soak.simulation.living import lived
from soak.simulation.records.climate import FAULTS
from soak.simulation.records.commands import Command, Outcome
from soak.simulation.records.history import Damage, Executed, Held, History, Shown, Stop
from soak.simulation.records.places import Place
from soak.simulation.records.told import Fact
from soak.simulation.runs import STEPS, derived, lives, result, run
from soak.simulation.seeds import DERIVED, EVERY, FIXED, LAST
from soak.simulation.shrinking import Life, shrunk
from soak.simulation.story import AFTER, CREW, FIRST_JOB, WORKSHOP, drawn, every_act, whole
from soak.simulation.system.process import Killed
from soak.simulation.trace import readable
from tests.support.paths import ROOT
from tests.support.until import PATIENCE

pytestmark = pytest.mark.fork

SAFETY = (ROOT / "docs" / "safety.md").read_text()


@pytest.mark.parametrize("seed", sorted({*EVERY, *[*FIXED][-LAST:]}) + derived(DERIVED))
def test_the_rules_hold(seed: int) -> None:
    world = lived(seed, whole(seed, STEPS))
    assert broken(world) == []
    assert world.history.commands


def test_the_seeds_of_every_run_draw_every_act() -> None:
    steps = [(seed, step) for seed in EVERY for step in whole(seed, STEPS)]
    assert {drawn(seed, step, random.Random(f"{seed} step {step}")).name for seed, step in steps} == every_act()


@pytest.mark.nightly
@pytest.mark.parametrize("seed", [*FIXED][:-LAST])
def test_the_rules_hold_where_they_once_broke(seed: int) -> None:
    assert broken(lived(seed, whole(seed, STEPS))) == []


def test_the_acts_of_several_callers_follow_a_story_that_is_the_same_without_them() -> None:
    seed = next(seed for seed in range(100) if CREW in whole(seed, 4))
    histories = [lived(seed, steps, keep=True).history for steps in (whole(seed, 4), range(4))]
    with_crews, without = ([(*row, text.replace(each.folder, "~")) for *row, text in each.lines] for each in histories)
    first = next(at for at, (_, kind, text) in enumerate(with_crews) if kind == "step" and text.startswith(f"{CREW}: "))
    assert first > 20
    assert with_crews[:first] == without[:first]


def test_the_jobs_of_a_workshop_follow_a_story_that_is_the_same_without_them() -> None:
    seed = next(seed for seed in range(100) if FIRST_JOB in whole(seed, 4) and CREW not in whole(seed, 4))
    told = [lived(seed, steps, keep=True).history.lines for steps in (whole(seed, 4), range(4))]
    first = next(at for at, (_, _, text) in enumerate(told[0]) if text.startswith(f"{FIRST_JOB}: workshop, "))
    rows = [[(kind, re.sub(r"simulate-\w+", "", text)) for _, kind, text in lines[:first]] for lines in told]
    assert first > 20
    assert rows[0] == rows[1]


@pytest.mark.parametrize("job", WORKSHOP, ids=lambda job: job.name)
def test_each_job_of_a_workshop_compares_and_what_a_session_promises_holds(
    job: Act, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(story, "WORKSHOP", (job,))
    world = lived(5, (FIRST_JOB,))
    assert world.history.told.facts
    assert broken(world) == []


def test_what_a_job_found_breaks_its_rule() -> None:
    world = lived(1, ())
    assert not broken(world)
    world.history.told.facts += [Fact("units", "shown in mm", False), Fact("asked", "asked once", True)]
    [[rule, words]] = broken(world)
    assert (rule.name, words) == ("units", "shown in mm")


@pytest.mark.parametrize(
    ("seed", "act", "times"),
    [(2, "second host at USB", 1), (7, "second host at USB", 0), (7, "same question", 1), (3, "same question", 0)],
)
def test_what_ends_the_story_of_the_crews_happens_where_the_machine_has_it(seed: int, act: str, times: int) -> None:
    life = Life(seed, (0, AFTER, AFTER + 1))
    assert lived(seed, life.steps).history.counts.get(act, 0) == times
    assert not result(life).breaches


@pytest.mark.nightly
def test_the_rules_hold_in_fresh_seeds() -> None:
    first = random.SystemRandom().randrange(1 << 24)
    assert [each.breaches for each in run(lives(range(first, first + 400)), jobs=1) if each.breaches] == [], first


@pytest.mark.parametrize(("first", "logs"), [(1, 8), pytest.param(1000, 50, marks=pytest.mark.nightly)])
def test_the_logs_of_simulated_sessions_break_no_rule(first: int, logs: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(world, "LOGGED", 1.0)
    judged, seed = 0, first
    while judged < logs:
        history = lived(seed, range(30)).history
        assert history.logged == [], seed
        judged, seed = judged + history.counts["logs judged"], seed + 1


@pytest.mark.parametrize("seed", [81, 122])
def test_a_seed_gives_the_same_history_each_time(seed: int) -> None:
    assert len({lived(seed, range(30)).history.trace for _ in range(3)}) == 1


def test_a_seed_gives_the_same_history_in_a_folder_with_a_longer_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    here = lived(9, range(30)).history.trace
    (longer := tmp_path / ("further" * 9)).mkdir()
    monkeypatch.setattr(living, "place_of_state", lambda: nullcontext(longer))
    assert lived(9, range(30)).history.trace == here


@pytest.mark.process
@pytest.mark.nightly
def test_a_seed_gives_the_same_history_in_another_process_with_other_hashes() -> None:
    here = result(Life(3, whole(3, 20))).line
    command = (sys.executable, "-m", "soak.simulation", "--seed", "3", "--steps", "20")
    there = subprocess.run(command, cwd=ROOT, env={"PYTHONHASHSEED": "77"}, capture_output=True, text=True, check=True)
    assert there.stdout.splitlines()[-1] == here


# Rules


def _promised(where: str) -> bool:
    """Whether docs/safety.md has a heading or a line in bold of this name, or a decision this number."""
    if re.fullmatch(r"\d{4}", where):
        return bool(list((ROOT / "docs" / "decisions").glob(f"{where}-*.md")))
    return f"## {where}\n" in SAFETY or f"**{where}.**" in SAFETY


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.name)
def test_each_rule_and_each_of_its_exceptions_is_written_where_it_says(rule: Rule) -> None:
    assert _promised(rule.promise), rule.promise
    for grant in rule.grants:
        assert _promised(grant.by), grant.by


def test_docs_list_every_rule_by_its_name_and_its_sentence() -> None:
    assert [f"| {rule.name} | {rule.sentence} |" for rule in RULES] == re.findall(
        r"^\| [^|]+ \| [^|]+\. \|$", SAFETY[SAFETY.index("## The judge of a simulated session") :], re.M
    )


def found(history: History, checksum: int = 1, *astray: tuple[float, str]) -> dict[str, list[str | Granted]]:
    """What the rules of commands and values find on a line of two drives, `a` and `b`."""
    place = Place("l", "mcode", ("a", "b"), 1, checksum, 9600, True)
    network = SimpleNamespace(doubled=[], astray=astray, overtaken=[(at - 1.0, at, host) for at, host in astray])
    calm = SimpleNamespace(calm=False)
    world: Any = SimpleNamespace(history=history, network=network, cut={}, place=lambda line: place, climate=calm)
    return {rule.name: list(rule.check(world)) for rule in OUTCOMES if list(rule.check(world))}


def told(
    outcome: Outcome, executions: int, noise: tuple[bytes, bytes] | None = None, heard: bytes = b'0"a"\r\n'
) -> History:
    """A command from 1 s to 2 s, executed so often; `noise`: what it changed meanwhile; `heard`: what came."""
    command = Command("MR 7", "l", "a", 0.9, 0, outcome, began=1.0, ended=2.0)
    history = History(commands={"@l:a MR 7": command}, executed=[Executed(1.5, "l", "a", "MR 7")] * executions)
    history.received["l"] = [(1.6, heard)]
    if noise is not None:
        history.damage["l"] = [Damage(1.4, *noise)]
    return history


def shown(text: str, drive: str = "a", restarts: int = 0) -> History:
    """A value that was shown as a drive's from 5 s to 6 s: `a` held 70000001, then 70000002; `b` 70000003."""
    history = History(shown=[Shown("l", drive, text, "v{}", 5.0, 6.0, restarts)])
    for drive, number, at in (("a", "70000001", 1.0), ("b", "70000003", 1.0), ("a", "70000002", 4.0)):
        history.holds(Held("l", drive, number, at, 0))
    return history


@pytest.mark.parametrize(
    ("rule", "history"),
    [
        ("twice", told(Outcome.UNKNOWN, 2)),
        ("denied", told(Outcome.NOT_SENT, 1)),
        ("refused", told(Outcome.REFUSED, 1)),
        ("lost", told(Outcome.OK, 0)),
    ],
)
def test_a_breach_about_a_command_is_seen(rule: str, history: History) -> None:
    [[name, [breach]]] = found(history).items()
    assert (name, type(breach)) == (rule, str)
    history.damage["l"] = [Damage(9.0, b"1", b"2")]
    assert found(history, checksum=0) == {rule: [breach]}, "noise at another time excepts nothing"


@pytest.mark.parametrize(
    ("history", "checksum", "grant"),
    [
        (told(Outcome.UNKNOWN, 2, (b"\x06", b"\x15")), 1, "a NAK of noise"),
        (told(Outcome.UNKNOWN, 2, (b"8", b"7")), 0, "a damaged command without a checksum"),
        (told(Outcome.NOT_SENT, 1, (b"8", b"7")), 0, "a damaged command without a checksum"),
        (told(Outcome.REFUSED, 1, (b">", b"?")), 0, "a refusal of noise, without a checksum"),
        (told(Outcome.OK, 0, (b"7", b"8")), 0, "a damaged command without a checksum"),
        (told(Outcome.OK, 0, (b"", b"\x06")), 1, "an ACK of noise"),
    ],
)
def test_what_no_host_can_know_is_granted(history: History, checksum: int, grant: str) -> None:
    [[each]] = found(history, checksum).values()
    assert isinstance(each, Granted)
    assert each.grant.name == grant


@pytest.mark.parametrize("what", [told(Outcome.OK, 0), shown("v70000001")], ids=["lost", "credited"])
def test_a_datagram_that_arrives_late_or_twice_is_granted(what: History) -> None:
    [[each]] = found(what, 1, (1.2 if what.commands else 5.2, "l.plant")).values()
    assert isinstance(each, Granted)
    assert each.grant.name == "a datagram that arrives twice or late"
    [[each]] = found(what, 1, (9.0, "l.plant"), (5.2, "m.plant"), (1.2, "m.plant")).values()
    assert isinstance(each, str)


@pytest.mark.parametrize("late", [b'PR "~41",DN\r\n~41"b"\r\n', b'PR R1,DN\r\nv70000003"b"\r\n', b"50000001\r\n"])
def test_a_value_that_another_print_cut_in_two_is_granted_without_a_checksum(late: bytes) -> None:
    history = shown("0002")
    history.received["l"] = [(5.5, b"PR R1,DN\r\nv7000" + late + b'0002"a"\r\n')]
    [[each]] = found(history, checksum=0).values()
    assert isinstance(each, Granted)
    assert each.grant.name == "a damaged value without a checksum"
    [[each]] = found(history).values()
    assert isinstance(each, str)


@pytest.mark.parametrize("heard", [b'v70000002"a"\r\n', b'v7000PR "~41",DN\r\n0002"a"\r\n', b'0002"a"\r\n'])
def test_the_end_of_a_value_that_nothing_cut_in_two_is_a_breach(heard: bytes) -> None:
    history = shown("0002")
    history.received["l"] = [(4.5, b'PR "~41",DN\r\n~41"b"\r\n'), (5.5, b"PR R1,DN\r\n" + heard)]
    [[each]] = found(history, checksum=0).values()
    assert isinstance(each, str)


@pytest.mark.parametrize(
    ("at", "said", "begun"),
    [
        (9.5, "l0: the stop of 1, 2 was sent first (the loss kept it from the drives)", True),
        (5.0, "l0: the stop of 1, 2 was sent first (the loss kept it from the drives)", False),
        (9.5, "l1: the stop of 1, 2 was sent first (the loss kept it from the drives)", False),
        (9.5, "l0 is back after 6.8 s", False),
        (9.5, "/stop: stop sent to every drive; macros and scripts wait for /resume", True),
        (5.0, "/stop: stop sent to every drive; macros and scripts wait for /resume", False),
        (10.0, "Ctrl+X: stop sent to every drive; macros and scripts wait for /resume", False),
    ],
)
def test_a_key_goes_on_with_a_typed_stop_or_one_that_a_line_was_owed(at: float, said: str, begun: bool) -> None:
    """Otherwise what leaves is a stop of an automation, which holds up no key."""
    own = {"l0": (1, 0)}
    stop = Stop(10.0, {"l0": (b"stop",)}, written=1, own=own, parts={"l0": (b"stop",)})
    history = History(stops=[Stop(1.0, {}), stop], written=[(9.9, "l0", b"stop")])
    history.notices.append((at, said))
    world: Any = SimpleNamespace(history=history, place=lambda line: Place("l0", "tmcl", ("1",), 1, 0, 9600, True))
    assert under_way(world, "l0", stop) is begun
    history.opened.append((9.0, "l0", 0))
    assert under_way(world, "l0", stop) is (begun or said.startswith("l0: the stop")), "each connection begins with it"


def test_with_a_checksum_noise_alone_excepts_nothing() -> None:
    inserted = told(Outcome.UNKNOWN, 2, (b"", b"\x15"))  # and the ACK was there
    unread = told(Outcome.UNKNOWN, 2, (b"\x06", b"\x15"), b'10"a"\r\n')  # ER was not read as 0
    for history in (inserted, unread, told(Outcome.NOT_SENT, 1, (b"8", b"7")), told(Outcome.OK, 0, (b"7", b"8"))):
        [[each]] = found(history).values()
        assert isinstance(each, str)


def test_a_command_that_became_another_one_with_a_right_checksum_is_granted() -> None:
    history = told(Outcome.OK, 0)
    history.executed.append(Executed(1.5, "l", "a", "MR 8"))
    [[each]] = found(history).values()
    assert isinstance(each, Granted)
    assert each.grant.name == "a checksum of seven or eight bits"


def test_a_value_of_the_drive_at_that_time_is_right() -> None:
    assert not found(shown("v70000002"))
    assert not found(shown("v0", restarts=1))


@pytest.mark.parametrize(("saved", "restarts", "right"), [(2.0, 1, True), (2.0, 0, False), (4.5, 1, False)])
def test_a_restarted_drive_holds_what_it_saved(saved: float, restarts: int, right: bool) -> None:
    history = shown("v70000001", restarts=restarts)
    history.executed.append(Executed(saved, "l", "a", "S"))
    assert (not found(history)) is right


@pytest.mark.parametrize("text", ["v70000001", "v70000003", "tick 50000012", "70000002", "v0", "v7000000"])
def test_any_other_value_is_a_breach(text: str) -> None:
    [[each]] = found(shown(text)).values()
    assert isinstance(each, str)


def test_a_damaged_value_is_granted_without_a_checksum_and_where_the_checksum_is_right() -> None:
    history = shown("v70000009")
    history.damage["l"] = [Damage(5.5, b"2", b"9")]
    [[bare]] = found(history, checksum=0).values()
    [[wrong]] = found(history).values()
    line = b"v70000009"
    history.received["l"] = [(5.5, line[:4]), (5.6, line[4:] + bytes([-sum(line) & 0x7F | 0x80]) + b"\r\n\x06")]
    [[right]] = found(history).values()
    assert [type(each) for each in (bare, wrong, right)] == [Granted, str, Granted]


def test_the_end_of_a_value_is_granted_where_it_came_before_its_beginning() -> None:
    for text, kind in (("02", Granted), ("03", str)):
        [[each]] = found(shown(text), 0, (6.5, "l.plant")).values()
        assert isinstance(each, kind)
    [[each]] = found(shown("02"), 0, (6.5, "m.plant")).values()
    assert isinstance(each, str)


def test_the_end_of_a_value_is_granted_where_a_program_printed_in_the_middle_of_it() -> None:
    history = shown("02")
    history.received["l"] = [(5.5, b'v70000050000007\r\n02"a"\r\n')]
    [[bare]] = found(history, checksum=0).values()
    [[checked]] = found(history).values()
    history.received["l"] = [(5.5, b'v700000\r\n02"a"\r\n')]
    [[other]] = found(history, checksum=0).values()
    assert [type(each) for each in (bare, checked, other)] == [Granted, str, str]


# Runs


def test_a_failure_is_shrunk_to_the_steps_and_faults_that_it_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    rule = RULES[0]
    monkeypatch.setattr(
        shrinking, "judged", lambda world: Judgement([(rule, "")] if len(world.history.stops) > 1 else [])
    )
    seed = next(seed for seed in range(1, 50) if len(lived(seed, range(20)).history.stops) > 2)
    life = shrunk(Life(seed, tuple(range(20))), rule.name, seconds=PATIENCE * 4)
    assert len(life.steps) == 2
    assert not set(lived(seed, ()).climate.chances) - set(life.without)
    assert life.command.startswith(f"make simulate SEED={seed} ONLY={life.steps[0]},{life.steps[1]}")


def test_a_trace_shows_keys_and_bytes_as_text_and_in_hex_and_both_records() -> None:
    rows = "\n".join(readable(Life(1, tuple(range(10))).live(keep=True).history))
    assert re.search(r"^ +\d+\.\d{6} key +'.*\\r' +[0-9a-f ]+$", rows, re.M)
    assert re.search(r"^ +\d+\.\d{6} > l\d +'.*' +[0-9a-f ]+$", rows, re.M)
    assert re.search(r"^l\d:.* '.*', typed at .*; the host: ok.*; the drive executed at \d", rows, re.M)


@pytest.mark.process
def test_a_run_is_taken_up_again(tmp_path: Path) -> None:
    todo, file = lives(range(1, 6), 5), tmp_path / "results"
    whole = [each.line for each in run(todo, jobs=1, resume=file)]
    rows = file.read_text().splitlines(keepends=True)
    file.write_text("".join(rows[:3]) + rows[3][:40])
    assert [each.line for each in run(todo, jobs=2, resume=file)] == whole
    assert len(file.read_text().splitlines()) == len(rows)
    with pytest.raises(ValueError, match="results of another run"):
        list(run(lives(range(1, 6), 6), resume=file))


@pytest.mark.process
def test_files_of_results_are_added_up_with_the_words_by_language(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = [str(tmp_path / name) for name in "ab"]
    for file, first in zip(files, (1, 4), strict=True):
        list(run(lives(range(first, first + 3), 5), jobs=1, resume=Path(file)))
    assert main(["--sum", *files]) == 0
    rows = capsys.readouterr().out.splitlines()
    assert rows[0].startswith("6 seeds, 0 broke a rule; ")
    head, _, commands, *words = [row.strip("|").split("|") for row in rows if row.startswith("|")]
    assert set(map(str.strip, head[1:])) <= {
        f"{name} with{out} a checksum" for name in LANGUAGES for out in ("", "out")
    }
    for total, *parts in zip(commands[1:], *(row[1:] for row in words), strict=True):
        assert int(total) == sum(map(int, parts)) > 0
    (tmp_path / "c").write_text("{}\n")
    assert main(["--sum", str(tmp_path / "c")]) == 2


def test_a_seed_ends_with_its_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--seed", "3", "--steps", "5"]) == 0
    line = capsys.readouterr().out
    assert re.fullmatch(r"seed 3: held, \d+\.\d virtual s, \d+ commands, trace [0-9a-f]{16}\n", line)
    assert main(["--seed", "3", "--only", "0,1,2,3,4", "--without", next(iter(FAULTS))]) in (0, 1)
    assert result(Life(3, whole(3, 5))).line == line.strip()


def test_a_kind_of_fault_that_does_not_exist_is_refused() -> None:
    with pytest.raises(SystemExit):
        main(["--seed", "3", "--without", "rain"])


def test_a_kill_that_leaves_a_story_is_an_error_with_its_seed(monkeypatch: pytest.MonkeyPatch) -> None:
    """As it is, it would end a worker of a range and not the range, which would wait for ever."""

    def killed(life: Life, keep: bool = False) -> world.World:
        raise Killed

    monkeypatch.setattr(Life, "live", killed)
    with pytest.raises(RuntimeError, match="seed 7: a kill ended the story"):
        list(run(lives([7, 8]), jobs=1))
