"""`multidrop features`: every feature with where it is from, and its state."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import multidrop as package
from multidrop.base.registry import FAMILIES, IN_WHEEL
from tests.support.front_door import Command
from tests.support.own_features import forget_loaded, own


@pytest.fixture(autouse=True)
def unloaded(monkeypatch: pytest.MonkeyPatch) -> None:
    forget_loaded(monkeypatch)


GOOD = 'from multidrop.base.feature import Feature\nFEATURE = Feature("clamp", "holds things")\n'


def test_a_persons_own_features_follow_those_of_the_wheel(multidrop: Command, tmp_path: Path) -> None:
    clamp, bad = own(tmp_path, "clamp", GOOD), own(tmp_path, "bad", "raise SystemExit(3)")
    done = multidrop("features", "--json")
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 0 and done.stderr == ""
    assert [each["name"] for each in rows if each["source"] == "multidrop"] == [*FAMILIES, *IN_WHEEL]
    assert {each["version"] for each in rows if each["source"] == "multidrop"} == {package.__version__}
    assert [each for each in rows if each["source"] == str(clamp)] == [
        {"name": "clamp", "source": str(clamp), "version": "", "state": "ready", "meaning": "holds things"}
    ]
    [failed] = [each for each in rows if each["source"] == str(bad)]
    assert failed["state"] == "cannot be loaded: SystemExit: 3"
    lines = multidrop("features").stdout.splitlines()
    assert any(line.split() == ["clamp", str(clamp), "ready", "holds", "things"] for line in lines)


def test_without_the_configuration_ones_own_files_are_not_listed(multidrop: Command, tmp_path: Path) -> None:
    own(tmp_path, "clamp", GOOD)
    assert "clamp" not in multidrop("features", "--no-config").stdout
    assert "clamp" in multidrop("features").stdout


VERB = """
from multidrop.base.feature import Feature
from multidrop.shell.operations.operation import Operation

async def work(call):
    call.session.output("hi")

FEATURE = Feature("{name}", "says hi", adds=(Operation(work, verb="{verb}", help="Say hi."),))
"""


def test_one_whose_verb_is_taken_is_not_ready(multidrop: Command, tmp_path: Path) -> None:
    own(tmp_path, "taken", VERB.format(name="taken", verb="/stop"))
    assert "cannot be loaded: /stop is taken" in multidrop("features").stdout


def test_a_script_is_checked_with_the_verbs_of_others(multidrop: Command, tmp_path: Path) -> None:
    own(tmp_path, "hello", VERB.format(name="hello", verb="/hello"))
    (tmp_path / "s.txt").write_text("/hello\n/helo\n")
    refused = multidrop("run", "s.txt", "--on", "sim:#press")
    assert refused.returncode == 2 and "s.txt:2: no verb /helo; try /hello" in refused.stderr
    (tmp_path / "s.txt").write_text("/hello\n")
    assert multidrop("run", "s.txt", "--on", "sim:#press")[:2] == (0, "hi\n")
