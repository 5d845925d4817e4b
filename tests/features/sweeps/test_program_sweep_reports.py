"""What `multidrop program sweep` says on the way and at its end: progress, lost clusters, colours, limits of time."""

from __future__ import annotations

import io
import json
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock
from xml.etree import ElementTree

import pytest

from multidrop.__main__ import main
from multidrop.base.errors import Diagnostic, TransportLost
from multidrop.features.sweeps import command as command
from multidrop.features.sweeps import trial, workers
from multidrop.features.sweeps.trial import Case, TrialJob, TrialResult
from multidrop.shell import configuration
from multidrop.shell.prompt import terminal_input
from tests.support.cases import for_each
from tests.support.cell_session import bus, drive
from tests.support.front_door import Command, Done

GO = "PG 1\nLB SU\n MR 51200\n H\nE\nPG\n"
CELL = bus("line", drive("LMDCM", "b", EE=1), baud=0)
LOADS = ("--vary", "b.load=0..0.2:0.1")
GRID = (*LOADS, "--vary", "b.stall_at=100000,200000,700000")
EXPECT = ("--expect", "position == 51200 +- 2")
Sweep = Callable[..., Done]


@pytest.fixture
def sweep(multidrop: Command, tmp_path: Path) -> Sweep:
    """Runs `program sweep go.mxt --cell cell.toml` in a folder of its own, in this process."""
    (tmp_path / "go.mxt").write_text(GO)
    (tmp_path / "cell.toml").write_text(CELL)
    given = ("program", "sweep", "go.mxt", "--cell", "cell.toml")
    return lambda *arguments: multidrop(*given, *arguments, *EXPECT)


class Terminal(io.StringIO):
    """A stream that is a terminal."""

    def isatty(self) -> bool:
        return True


class Shown:
    """A line of progress, for each text that it showed; `erased`: the number of times."""

    texts: list[str]
    erased: int

    def __init__(self) -> None:
        Shown.texts, Shown.erased = [], 0

    def show(self, text: str) -> None:
        Shown.texts.append(text)

    def erase(self) -> None:
        Shown.erased += 1


class Clock:
    """A clock that a test moves, in place of that of the sweep; each case takes `step`."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, step: float) -> None:
        self.now = 1000.0
        self.tries = list[int]()
        monkeypatch.setattr(command, "time", SimpleNamespace(perf_counter=lambda: self.now))
        monkeypatch.setattr(command, "StatusLine", Shown)
        tried = trial.Bench.tried

        def timed(bench: trial.Bench, case: Case) -> TrialResult:
            self.now += step
            self.tries.append(case[0])
            return tried(bench, case)

        monkeypatch.setattr(trial.Bench, "tried", timed)


# Progress


@for_each("step, last, texts", [
    (35.0, 2, ["1 of 9 cases, 1 failed, 4 min 40 s left", "2 of 9 cases, 2 failed, 4 min 5 s left"]),
    (1000.0, 2, ["1 of 9 cases, 1 failed, 2 h 13 min left", "2 of 9 cases, 2 failed, 1 h 56 min left"]),
    (450.0, 1, ["1 of 9 cases, 1 failed, 1 h 0 min left"]),
    (449.9, 1, ["1 of 9 cases, 1 failed, 59 min 59 s left"]),
    (7.5, 1, ["1 of 9 cases, 1 failed, 1 min 0 s left"]),
    (0.625, 3, ["1 of 9 cases, 1 failed, 5 s left", "2 of 9 cases, 2 failed, 4 s left",
                "3 of 9 cases, 2 failed, 4 s left"]),
    (0.0625, 2, ["1 of 9 cases, 1 failed, 0 s left", "3 of 9 cases, 2 failed, 0 s left"]),
])  # fmt: skip
def test_progress_says_what_is_done_and_how_long_the_rest_takes(
    sweep: Sweep, step: float, last: int, texts: list[str]
) -> None:
    with pytest.MonkeyPatch.context() as patched:
        Clock(patched, step)
        done = sweep(*GRID, "--jobs", "1")
    assert Shown.texts[:last] == texts
    cases = [each for each in Shown.texts if " left" in each]
    assert len(cases) == (4 if step < 0.1 else 8), "none for the last case, and ten a second at most"
    assert Shown.erased and done.returncode == 1


def test_the_time_that_is_left_is_that_of_the_cases_which_run_now(
    sweep: Sweep, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sweep(*GRID, "--csv", "all.csv")
    lines = (tmp_path / "all.csv").read_text().splitlines(keepends=True)
    (tmp_path / "all.csv").write_text("".join(lines[:6]))
    Clock(monkeypatch, 10.0)
    done = sweep(*GRID, "--resume", "all.csv", "--jobs", "1")
    assert done.stderr == "5 cases of 9 are in the file already\n"
    assert Shown.texts[:3] == [
        "6 of 9 cases, 4 failed, 30 s left",
        "7 of 9 cases, 5 failed, 20 s left",
        "8 of 9 cases, 6 failed, 10 s left",
    ]


def test_one_case_in_a_file_is_one(sweep: Sweep, tmp_path: Path) -> None:
    sweep(*GRID, "--csv", "all.csv")
    lines = (tmp_path / "all.csv").read_text().splitlines(keepends=True)
    (tmp_path / "all.csv").write_text("".join(lines[:2]))
    assert sweep(*GRID, "--resume", "all.csv").stderr == "1 case of 9 are in the file already\n"


# The search for the simplest worlds


def test_simpler_worlds_are_looked_for_during_ten_seconds(sweep: Sweep, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock(monkeypatch, 3.5)
    stalled = ("--vary", "b.stall_at=100000,110000", *LOADS, "--vary", "b.A=500000,900000")
    done = sweep(*stalled, "--jobs", "1")
    assert clock.tries == [*range(1, 13), 1, 1, 1], "each takes 3.5 s, and the fourth would begin after 10.5 s"
    searches = [each for each in Shown.texts if "left" not in each]
    assert searches == ["12 of 12 cases failed; looking for the simplest worlds"] * 3
    assert done.returncode == 1 and "12 cases, 12 failed, 42.0 s" in done.stdout


def test_after_an_early_end_they_are_looked_for_during_one_second(
    sweep: Sweep, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = Clock(monkeypatch, 0.75)
    timed = trial.Bench.tried

    def interrupted(bench: trial.Bench, case: Case) -> TrialResult:
        if case[0] == 5:
            signal.raise_signal(signal.SIGINT)
        return timed(bench, case)

    monkeypatch.setattr(trial.Bench, "tried", interrupted)
    done = sweep("--vary", "b.stall_at=100000,110000,120000", *LOADS, "--jobs", "1")
    assert done.returncode == 130 and clock.tries == [1, 2, 3, 4, 1, 1]
    assert done.stderr == "ended after 4 cases of 9; the others were not run\n"


def test_a_signal_during_the_search_ends_only_that(sweep: Sweep, monkeypatch: pytest.MonkeyPatch) -> None:
    tried, tries = trial.Bench.tried, list[int]()

    def interrupted(bench: trial.Bench, case: Case) -> TrialResult:
        tries.append(case[0])
        if len(tries) == 10:
            signal.raise_signal(signal.SIGTERM)
        return tried(bench, case)

    monkeypatch.setattr(trial.Bench, "tried", interrupted)
    done = sweep(*GRID, "--jobs", "1")
    assert (done.returncode, len(tries)) == (1, 10)
    assert done.stderr == "interrupted while simpler worlds were looked for\n"
    assert "9 cases, 6 failed" in done.stdout
    tries.clear()
    assert sweep(*GRID, "--jobs", "1", "--json").stderr == "interrupted while simpler worlds were looked for\n"


# Where the cases run


def test_without_a_number_of_jobs_there_are_as_many_as_cores(sweep: Sweep, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[tuple[int, int]] = []

    def results(
        job: TrialJob, cases: Iterator[Case], count: int, jobs: int, *_: object, say: Callable[[str], None]
    ) -> Iterator[list[TrialResult]]:
        seen.append((count, jobs))
        say("the workers cannot start")
        say("the workers cannot start")
        yield [TrialResult(number) for number, _ in cases]

    monkeypatch.setattr(workers, "results", results)
    monkeypatch.setattr(workers, "cores", lambda: 7)
    done = sweep(*GRID)
    assert (done.returncode, done.stderr) == (0, "the workers cannot start\n"), "a line is said once"
    sweep(*GRID, "--jobs", "3")
    assert seen == [(9, 7), (9, 3)]


@pytest.fixture
def cluster(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """A cluster in this process, which fails after some cases if it has a `failure`."""
    found = SimpleNamespace(failure=None, after=3, addresses=[])

    def results(
        job: TrialJob, rounds: Any, address: str, _: object, agree: Callable[[], None]
    ) -> Iterator[list[TrialResult]]:
        agree()
        found.addresses.append(address)
        ready = trial.bench(job)
        for cases in rounds:
            for number, case in enumerate(cases):
                if found.failure is not None and number == found.after:
                    raise found.failure
                yield [ready.tried(case)]

    monkeypatch.setattr(workers, "cluster_results", results)
    return found


CLUSTER = ("--cluster", "tcp://h:1", "--yes")


def test_the_cases_run_on_the_cluster_that_is_named(sweep: Sweep, cluster: SimpleNamespace) -> None:
    done = sweep(*GRID, *CLUSTER, "--json")
    cases = [json.loads(line).get("case") for line in done.stdout.splitlines()]
    assert (done.returncode, done.stderr, cases) == (1, "", [*range(1, 10), None])
    assert cluster.addresses == ["tcp://h:1"]


def test_a_cluster_that_is_lost_leaves_what_is_done(sweep: Sweep, cluster: SimpleNamespace, tmp_path: Path) -> None:
    cluster.failure = TransportLost("tcp://h:1: the scheduler was lost")
    done = sweep(*GRID, *CLUSTER, "--csv", "all.csv", "--junit", "all.xml")
    said = "tcp://h:1: the scheduler was lost\nended after 3 cases of 9; the others were not run\n"
    assert (done.returncode, done.stderr) == (3, said) and "3 cases, 2 failed" in done.stdout
    assert (tmp_path / "all.csv").read_text().count("\n") == 4
    (suite,) = ElementTree.parse(tmp_path / "all.xml").getroot()
    assert (suite.get("tests"), suite.get("failures"), suite.get("errors")) == ("4", "2", "1")
    assert suite[-1].get("name") == "go.mxt" and suite[-1][0].get("message") == "ended after 3 cases of 9"


def test_a_cluster_that_cannot_be_used_leaves_only_its_reason(
    sweep: Sweep, cluster: SimpleNamespace, tmp_path: Path
) -> None:
    cluster.failure, cluster.after = Diagnostic("the workers have another multidrop", "tcp://h:1"), 0
    for more in ((), ("--json",)):
        done = sweep(*GRID, *CLUSTER, "--junit", "all.xml", *more)
        assert (done.returncode, done.stdout, done.stderr) == (2, "", "tcp://h:1: the workers have another multidrop\n")
    (suite,) = ElementTree.parse(tmp_path / "all.xml").getroot()
    assert (suite.get("tests"), suite.get("errors")) == ("1", "1")
    assert suite[0][0].get("message") == "ended after 0 cases of 9"


@for_each("answer, code, said", [
    (None, 2, f"--cluster tcp://h:1: {workers.TRUST}; nothing was connected; --yes agrees to it\n"),
    (False, 2, "--cluster tcp://h:1: the answer was no, so nothing was connected\n"),
    (True, 1, "{conf}: sweep.clusters has tcp://h:1 from now on\n"),
])  # fmt: skip
def test_a_cluster_needs_a_yes_which_is_kept(
    sweep: Sweep, cluster: SimpleNamespace, tmp_path: Path, answer: bool | None, code: int, said: str
) -> None:
    asked: list[str] = []

    async def ask(question: str) -> bool | None:
        asked.append(question)
        return answer

    (tmp_path / "conf").mkdir(exist_ok=True)
    (tmp_path / "conf" / "multidrop.toml").write_text('[sweep]\nclusters = ["tcp://other:2"]\n')
    with mock.patch.object(terminal_input, "ask_outside_a_session", ask):
        done = sweep(*LOADS, "--vary", "b.stall_at=1", "--cluster", "tcp://h:1")
        assert (done.returncode, done.stderr) == (code, said.format(conf=tmp_path / "conf" / "multidrop.toml"))
        assert asked == [f"--cluster tcp://h:1: {workers.TRUST}"]
        if answer:
            again = sweep(*LOADS, "--cluster", "tcp://h:1")
            assert (again.returncode, again.stderr, len(asked)) == (0, "", 1), "it is known from now on"
            with mock.patch.dict(os.environ, MULTIDROP_CONFIG_DIR=str(tmp_path / "conf")):
                assert configuration.load().section("sweep") == ("tcp://other:2", "tcp://h:1")


# Colours


def in_terminal(folder: Path, *arguments: str, **variables: str) -> str:
    """What a command prints to a terminal."""
    out, removed = Terminal(), {"NO_COLOR", "TERM"}
    environ = {name: value for name, value in os.environ.items() if name not in removed} | {"TERM": "xterm"}
    with (
        mock.patch.dict(os.environ, environ | variables, clear=True),
        mock.patch("sys.stdout", out),
        mock.patch("sys.stderr", io.StringIO()),
    ):
        main(["program", "sweep", str(folder / "go.mxt"), "--cell", str(folder / "cell.toml"), *arguments, *EXPECT])
    return out.getvalue()


@pytest.mark.usefixtures("sweep")
def test_the_map_has_colours_on_a_terminal_that_shows_them(tmp_path: Path) -> None:
    coloured = in_terminal(tmp_path, *GRID)
    plain = in_terminal(tmp_path, *GRID, NO_COLOR="")
    assert "\x1b[" in coloured and "\x1b" not in plain
    head = "per cent that passed: b.load down, b.stall_at across"
    assert coloured.count(head) == plain.count(head) == 1, "there is one map"
    assert "\x1b" not in in_terminal(tmp_path, *GRID, TERM="dumb")
    places = [
        coloured.index(each) for each in ("b.load=0 ", head, "\x1b[", "fails from b.stall_at 200000 down", "cases")
    ]
    assert places == sorted(places)


# Reports


def test_a_seed_that_changes_nothing_is_said_to_a_person(sweep: Sweep) -> None:
    said = "seed changes the faults of a wire only, and a program test has no wire\n"
    assert sweep("--vary", "seed=1..2").stderr == said
    assert sweep("--vary", "seed=1..2", "--json").stderr == ""
    assert sweep(*LOADS).stderr == sweep(*LOADS, "--random", "2", "--json").stderr == ""
    assert sweep(*LOADS, "--random", "2").stderr == "2 draws with --seed 1\n"


def test_a_picture_is_made_beside_json_too(sweep: Sweep, tmp_path: Path) -> None:
    done = sweep(*GRID, "--svg", "map.svg", "--json")
    assert done.returncode == 1 and (tmp_path / "map.svg").read_bytes().startswith(b"<svg")
    assert all(line.startswith("{") for line in done.stdout.splitlines())
    for arguments in (LOADS, (*LOADS, "--vary", "b.VM=100000")):
        refused = sweep(*arguments, "--svg", "one.svg")
        what = "--svg one.svg: shows two keys with several values each; vary a second key\n"
        assert (refused.returncode, refused.stdout, refused.stderr) == (2, "", what)
    refused = sweep(*GRID, "--search", "b.load", "--svg", "one.svg")
    assert (refused.returncode, refused.stdout) == (2, "") and "shows two keys" in refused.stderr


def test_a_report_replaces_only_a_report_of_its_kind(sweep: Sweep, tmp_path: Path) -> None:
    for option, sign, kind in (("--svg", "<svg", "picture"), ("--junit", "<testsuite", "JUnit report")):
        (tmp_path / "own").write_text(f"{sign[:-1]}>")
        done = sweep(*GRID, option, "own")
        assert done == Done(2, "", f"own: exists already and is not a {kind}; name a new file for the report\n")
        (tmp_path / "own").write_text(sign)
        assert sweep(*GRID, option, "own").returncode == 1 and (tmp_path / "own").stat().st_size > 100


def fails_for(name: str) -> Callable[[Path, bytes], None]:
    def write(path: Path, data: bytes) -> None:
        assert path.name == name and data
        raise OSError(28, "No space left on device")

    return write


def test_a_picture_that_cannot_be_written_is_said_and_changes_a_good_exit_code_only(
    sweep: Sweep, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(command, "write_atomically", fails_for("map.svg"))
    good = ("--vary", "b.load=0,0.1", "--vary", "b.stall_at=700000,800000", "--svg", "map.svg")
    done = sweep(*good)
    assert (done.returncode, done.stderr) == (2, "map.svg: cannot be written: No space left on device\n")
    assert "4 cases, 0 failed" in done.stdout
    assert sweep(*GRID, "--svg", "map.svg").returncode == 2, "there is no picture, whatever failed"


def test_too_few_cases_for_a_picture_are_said(
    sweep: Sweep, cluster: SimpleNamespace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cluster.failure, cluster.after = TransportLost("tcp://h:1: the scheduler was lost"), 1
    done = sweep(*GRID, *CLUSTER, "--svg", "map.svg")
    assert done.returncode == 3 and done.stderr.splitlines() == [
        "tcp://h:1: the scheduler was lost",
        "map.svg: too few cases ran for a picture",
        "ended after 1 case of 9; the others were not run",
    ]
    assert not (tmp_path / "map.svg").exists()


def cases_of(file: Path) -> Sequence[ElementTree.Element]:
    (suite,) = ElementTree.parse(file).getroot()
    return list(suite)


def test_a_case_without_values_has_its_number_and_an_error_is_no_failure(sweep: Sweep, tmp_path: Path) -> None:
    assert sweep("--junit", "all.xml").returncode == 0
    [only] = cases_of(tmp_path / "all.xml")
    assert (only.get("name"), only.get("classname"), len(only)) == ("case 1", "go.mxt", 0)
    sweep("--vary", "b.VM=2000,9000", "--vary", "b.VI=1500,5000", "--until", "1", "--junit", "all.xml")
    first, refused, *_ = cases_of(tmp_path / "all.xml")
    assert first.get("name") == "case 1: b.VM=2000 b.VI=1500" and first[0].tag == "failure"
    assert refused.get("name") == "case 2: b.VM=2000 b.VI=5000" and refused[0].tag == "error"
    assert "refused by an LMDCM" in (refused[0].get("message") or "")
    repeats = "multidrop program sweep go.mxt --cell cell.toml --vary b.VM=2000 --vary b.VI=5000 --until 1"
    assert refused[1].text == repeats, "what failed before any condition needs none"
