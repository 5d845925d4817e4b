"""`multidrop program sweep` as a process of its own: on two cores, interrupted, and on a Dask cluster."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from shell.sweeps import cluster as cluster_of_cases
from tests.support.front_door import Command
from tests.support.front_door import multidrop as multidrop
from tests.support.paths import ROOT
from tests.support.processes import WAIT, environment

pytestmark = pytest.mark.process

GO = "PG 1\nLB SU\n MR 4000\n H\nE\nPG\n"
SLOW = "PG 1\nLB SU\nLB K1\n H 10\n BR K1\nE\nPG\n"
CELL = '[[bus]]\nname = "line"\n[[bus.drive]]\npersonality = "LMDCM"\nname = "b"\nset = { EE = 1 }\n'
WALLS = ("--cell", "cell.toml", "--vary", "b.stall_at=20000,90000", "--vary", "seed=1..60", "--expect", "errors == []")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a program that ends, one that does not, and a cell."""
    for name, text in {"go.mxt": GO, "slow.mxt": SLOW, "cell.toml": CELL}.items():
        (tmp_path / name).write_text(text)
    return tmp_path


def gone(pid: int) -> bool:
    """Whether a process has no children any more."""
    return not subprocess.run(["pgrep", "-P", str(pid)], capture_output=True, text=True).stdout.strip()


@pytest.mark.skipif(sys.platform == "win32", reason="no such signals")
def test_an_interrupted_sweep_reports_what_is_done_and_leaves_no_process(folder: Path) -> None:
    command = ["program", "sweep", "slow.mxt", "--vary", "seed=1..5000", "--jobs", "2", "--json", "--junit", "r.xml"]
    with open(folder / "errors", "wb") as log:
        process = subprocess.Popen(
            [sys.executable, "-m", "multidrop", *command],
            stdout=subprocess.PIPE,
            stderr=log,
            text=True,
            cwd=folder,
            env=environment(folder),
            start_new_session=True,
        )
    assert process.stdout is not None
    lines = [process.stdout.readline() for _ in range(20)]
    os.killpg(process.pid, signal.SIGINT)
    lines += process.stdout.readlines()
    process.stdout.close()
    *cases, last = [json.loads(line) for line in lines]
    assert process.wait(WAIT) == 130
    errors = (folder / "errors").read_text()
    assert errors.startswith("ended after ") and errors.count("\n") == 1
    assert 20 <= len(cases) == last["summary"]["cases"] < 5000
    assert f"ended after {len(cases)} cases of 5000" in (folder / "r.xml").read_text()
    assert gone(process.pid)


@pytest.mark.slow
def test_a_cluster_runs_the_same_cases(folder: Path, multidrop: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed", reason="the extra cluster is not installed")
    script = ROOT / "tests" / "support" / "dask_cluster.py"
    address = folder / "address"
    with open(folder / "cluster.log", "wb") as log:
        cluster = subprocess.Popen(
            [sys.executable, str(script), str(address), "2"],
            stdin=subprocess.PIPE,
            stdout=log,
            stderr=log,
            env=environment(folder),
        )
    try:
        until = time.monotonic() + WAIT
        while not (address.exists() and address.read_text()):
            assert cluster.poll() is None and time.monotonic() < until, (folder / "cluster.log").read_text()
            time.sleep(0.05)
        there = multidrop("program", "sweep", "go.mxt", *WALLS, "--json", "--cluster", address.read_text())
    finally:
        assert cluster.stdin is not None
        cluster.stdin.close()
        cluster.wait(WAIT)
    here = multidrop("program", "sweep", "go.mxt", *WALLS, "--json", "--jobs", "1")
    assert (there.returncode, there.stderr) == (1, "")
    assert there.stdout.splitlines()[:-1] == here.stdout.splitlines()[:-1] and there.stdout.count("\n") == 121
    monkeypatch.setattr(cluster_of_cases, "PATIENCE", 0.2)
    lost = multidrop("program", "sweep", "go.mxt", *WALLS, "--cluster", address.read_text())
    assert lost.returncode == 3 and lost.stdout == "" and "no scheduler replies" in lost.stderr
    assert lost.stderr.count("\n") == 2  # and the one about the seed


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
    absent = multidrop("program", "sweep", "go.mxt", "--cluster", "tcp://127.0.0.1:1", "--json")
    assert (absent.returncode, absent.stdout, absent.stderr.count("\n")) == (2, "", 1)
    assert "not installed; pip install 'multidrop[cluster]'" in absent.stderr
