"""`multidrop program sweep` as a process of its own: on two cores, interrupted, and on a Dask cluster."""

from __future__ import annotations

import errno
import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from multidrop.features.sweeps import workers
from multidrop.shell.prompt import terminal_input
from tests.support.front_door import Command, Home
from tests.support.paths import ROOT
from tests.support.processes import environment
from tests.support.until import PATIENCE

pytestmark = pytest.mark.process

GO = "PG 1\nLB SU\n MR 4000\n H\nE\nPG\n"
SLOW = "PG 1\nLB SU\nLB K1\n H 10\n BR K1\nE\nPG\n"
CELL = '[[bus]]\nname = "line"\n[[bus.drive]]\npersonality = "LMDCM"\nname = "b"\nset = { EE = 1 }\n'
WALLS = ("--cell", "cell.toml", "--vary", "b.stall_at=20000,90000", "--vary", "seed=1..60", "--expect", "errors == []")


@pytest.fixture
def folder(home: Home) -> Path:
    """A folder with a program that ends, one that does not, and a cell."""
    for name, text in {"go.mxt": GO, "slow.mxt": SLOW, "cell.toml": CELL}.items():
        home.file(name, text)
    return home.folder


def gone(pid: int) -> bool:
    """Whether a process has no children any more."""
    return not found("-P", str(pid))


@pytest.mark.fork
def test_an_interrupted_sweep_reports_what_is_done_and_leaves_no_process(folder: Path, home: Home) -> None:
    command = ["program", "sweep", "slow.mxt", "--vary", "seed=1..5000", "--jobs", "2", "--json", "--junit", "r.xml"]
    with open(folder / "errors", "wb") as log:
        process = home.start(*command, stderr=log, start_new_session=True)
    assert process.stdout is not None
    lines = [process.stdout.readline() for _ in range(20)]
    os.killpg(process.pid, signal.SIGINT)
    lines += process.stdout.readlines()
    process.stdout.close()
    *cases, last = [json.loads(line) for line in lines]
    assert process.wait(PATIENCE) == 130
    errors = (folder / "errors").read_text()
    assert errors.startswith("ended after ") and errors.count("\n") == 1
    assert 20 <= len(cases) == last["summary"]["cases"] < 5000
    assert f"ended after {len(cases)} cases of 5000" in (folder / "r.xml").read_text()
    assert gone(process.pid)


def test_where_no_process_can_be_started_one_line_says_so_and_this_one_runs_all_cases(
    folder: Path, multidrop: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    def absent(*arguments: object) -> None:
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT))

    monkeypatch.setattr(workers, "WORTH", 0.0)
    monkeypatch.setattr("multiprocessing.synchronize._multiprocessing.SemLock", absent)  # as without /dev/shm
    ended = multidrop("program", "sweep", "go.mxt", "--vary", "seed=1..40", "--jobs", "2", "--json")
    said = [line for line in ended.stderr.splitlines() if "process" in line]
    assert said == [
        "no other process can be started (No such file or directory), so all cases run in this one, which takes longer"
    ]
    assert ended.returncode == 0 and json.loads(ended.stdout.splitlines()[-1])["summary"]["cases"] == 40


@pytest.mark.fork
def test_a_killed_sweep_leaves_a_table_and_goes_on_with_it(folder: Path, home: Home) -> None:
    sweep = ["program", "sweep", "slow.mxt", "--vary", "seed=1..40", "--jobs", "2", "--json"]
    process = home.start(*sweep, "--csv", "t.csv")
    until = time.monotonic() + PATIENCE
    while (table := (folder / "t.csv")).exists() is False or table.read_bytes().count(b"\n") < 3:
        assert process.poll() is None and time.monotonic() < until
        time.sleep(0.01)
    process.kill()
    process.wait(PATIENCE)
    kept = table.read_bytes().count(b"\n") - 1
    whole = home.process(*sweep, "--resume", "t.csv")
    assert whole.returncode == 1 and f"{kept} cases of 40 are in the file already" in whole.stderr, whole
    cases = [json.loads(line).get("case") for line in whole.stdout.splitlines()]
    assert cases == [*range(1, 41), None] and table.read_bytes().count(b"\n") == 41


def found(*arguments: str) -> list[str]:
    """The numbers of processes."""
    return subprocess.run(["pgrep", *arguments], capture_output=True, text=True).stdout.split()


@contextmanager
def cluster(folder: Path, script: str, *arguments: str) -> Iterator[str]:
    """Run a cluster of `tests/support`; yield the address of its scheduler."""
    address = folder / "address"
    with open(folder / "cluster.log", "wb") as log:
        process = subprocess.Popen(
            [sys.executable, str(ROOT / "tests" / "support" / script), str(address), *arguments],
            stdin=subprocess.PIPE,
            stdout=log,
            stderr=log,
            env=environment(folder),
        )
    try:
        until = time.monotonic() + PATIENCE
        while not (address.exists() and address.read_text()):
            assert process.poll() is None and time.monotonic() < until, (folder / "cluster.log").read_text()
            time.sleep(0.05)
        yield address.read_text()
    finally:
        assert process.stdin is not None
        process.stdin.close()
        process.wait(PATIENCE)


@pytest.mark.slow
def test_a_cluster_runs_the_same_cases(folder: Path, multidrop: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed", reason="the extra cluster is not installed")
    with cluster(folder, "dask_cluster.py", "2") as address:
        there = multidrop("program", "sweep", "go.mxt", *WALLS, "--json", "--yes", "--cluster", address)
    here = multidrop("program", "sweep", "go.mxt", *WALLS, "--json", "--jobs", "1")
    assert (there.returncode, there.stderr) == (1, "")
    assert there.stdout.splitlines()[:-1] == here.stdout.splitlines()[:-1] and there.stdout.count("\n") == 121
    monkeypatch.setattr(workers, "SCHEDULER_TIMEOUT", 0.2)
    lost = multidrop("program", "sweep", "go.mxt", *WALLS, "--yes", "--cluster", address)
    assert lost.returncode == 3 and lost.stdout == "" and "no scheduler replies" in lost.stderr
    assert lost.stderr.count("\n") == 2  # and the one about the seed


@pytest.mark.slow
@pytest.mark.parametrize("who", ["worker", "scheduler"])
def test_nothing_of_a_hostile_cluster_runs_here_before_a_person_has_agreed_to_it(
    folder: Path, multidrop: Command, who: str
) -> None:
    pytest.importorskip("distributed", reason="the extra cluster is not installed")
    proof = folder / "proof"
    ran_here = folder / f"proof.{os.getpid()}"
    with cluster(folder, "hostile_cluster.py", str(proof), who) as address:
        refused = multidrop("program", "sweep", "go.mxt", "--vary", "VM=20000,30000", "--cluster", address)
        assert refused.returncode == 2 and refused.stdout == "" and refused.stderr.count("\n") == 1
        assert "can run any code on this computer" in refused.stderr and "--yes agrees to it" in refused.stderr
        assert not ran_here.exists()
        multidrop("program", "sweep", "go.mxt", "--vary", "VM=20000,30000", "--cluster", address, "--yes")
    assert ran_here.exists()  # the sentence is true: agreeing lets their code run


@pytest.mark.slow
@pytest.mark.fork
@pytest.mark.parametrize("who", ["workers", "scheduler"])
def test_a_cluster_of_which_a_part_hangs_is_lost_after_a_time_that_is_named(
    folder: Path, multidrop: Command, monkeypatch: pytest.MonkeyPatch, who: str
) -> None:
    """What was done before is in the table, and a sweep of this machine goes on with it."""
    pytest.importorskip("distributed", reason="the extra cluster is not installed")
    monkeypatch.setattr(workers, "WORKER_TIMEOUT", 2.0)
    monkeypatch.setattr(workers, "CHECK_PERIOD", 0.2)
    monkeypatch.setattr(workers, "SCHEDULER_TIMEOUT", 1.0)
    work = workers._Work
    wait = work._wait
    stopped: list[str] = []

    with cluster(folder, "dask_cluster.py", "1") as address:
        hanging = found("-f", str(folder / "address"))
        hanging = found("-P", hanging[0]) if who == "workers" else hanging

        def struck(self: object, done: object) -> None:
            if not stopped:
                stopped.extend(hanging)
                for each in hanging:
                    os.kill(int(each), signal.SIGSTOP)
            wait(self, done)

        monkeypatch.setattr(work, "_wait", struck)
        lost = multidrop("program", "sweep", "go.mxt", *WALLS, "--yes", "--cluster", address, "--csv", "some.csv")
        for each in stopped:
            os.kill(int(each), signal.SIGCONT)
    assert lost.returncode == 3 and "no worker gave a sign of life for 2 s" in lost.stderr, lost
    whole = multidrop("program", "sweep", "go.mxt", *WALLS, "--jobs", "1", "--resume", "some.csv")
    assert whole.returncode == 1 and "120 cases, 60 failed" in whole.stdout and "in the file already" in whole.stderr


def test_an_address_is_asked_for_once_at_a_terminal_and_a_yes_is_kept(
    folder: Path, multidrop: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed", reason="the extra cluster is not installed")
    questions: list[str] = []
    answer = False

    async def ask(question: str) -> bool:
        questions.append(question)
        return answer

    monkeypatch.setattr(terminal_input, "ask_outside_a_session", ask)
    monkeypatch.setattr(workers, "SCHEDULER_TIMEOUT", 0.2)
    with socket.create_server(("127.0.0.1", 0)) as scheduler:
        scheduler.setblocking(False)
        address = f"tcp://127.0.0.1:{scheduler.getsockname()[1]}"
        sweep = ("program", "sweep", "go.mxt", "--vary", "VM=20000,30000", "--cluster", address)
        no = multidrop(*sweep)
        assert no.returncode == 2 and no.stderr.endswith("the answer was no, so nothing was connected\n")
        with pytest.raises(BlockingIOError):
            scheduler.accept()
    answer = True
    yes = multidrop(*sweep)
    assert yes.returncode == 3 and f"sweep.clusters has {address} from now on" in yes.stderr
    assert multidrop(*sweep).returncode == 3 and len(questions) == 2
    assert "can run any code on this computer with your rights" in questions[0]
    assert f'clusters = ["{address}"]' in multidrop("config", "show").stdout


def test_a_wrong_address_and_an_extra_that_is_absent_are_one_line(
    folder: Path, multidrop: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    wrong = multidrop("program", "sweep", "go.mxt", "--cluster", "pc", "--json")
    assert (wrong.returncode, wrong.stdout, wrong.stderr.count("\n")) == (
        2,
        "",
        1,
    ) and "tcp://HOST:8786" in wrong.stderr
    monkeypatch.setitem(sys.modules, "distributed", None)
    absent = multidrop("program", "sweep", "go.mxt", "--cluster", "tcp://127.0.0.1:1", "--json", "--yes")
    assert (absent.returncode, absent.stdout, absent.stderr.count("\n")) == (2, "", 1)
    assert "not installed; pip install 'multidrop[cluster]'" in absent.stderr
