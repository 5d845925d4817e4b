"""The whole program in simulated time: a seed is one history, whatever the order of sets, and the rules hold in it."""

from __future__ import annotations

import subprocess
import sys

import pytest

from soak.simulation.__main__ import verdict
from soak.simulation.judge import broken
from soak.simulation.world import lived
from tests.support.paths import ROOT

SEEDS = (3, 9, 137, 472, 882)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_rules_hold(seed: int) -> None:
    world = lived(seed, range(30))
    assert broken(world) == []
    assert world.history.executed


@pytest.mark.process
def test_a_seed_gives_the_same_history_in_another_process_with_other_hashes() -> None:
    here = verdict(lived(3, range(20)))
    command = (sys.executable, "-m", "soak.simulation", "--seed", "3", "--steps", "20")
    there = subprocess.run(command, cwd=ROOT, env={"PYTHONHASHSEED": "77"}, capture_output=True, text=True, check=True)
    assert there.stdout.splitlines()[-1] == here
