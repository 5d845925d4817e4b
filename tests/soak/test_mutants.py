"""Mutants: each patch applies to the tree, each rule has one, and some seed catches each."""

from __future__ import annotations

import re
import shutil
from contextlib import nullcontext
from types import SimpleNamespace

import pytest

from soak.simulation import mutants
from soak.simulation.__main__ import main
from soak.simulation.judges.judge import RULES
from soak.simulation.mutants import TEST, Caught, applied, caught, head, names
from tests.support.paths import ROOT

pytestmark = pytest.mark.fork

NAMES = {rule.name for rule in RULES}
SEEDS = range(1, 2001)


@pytest.mark.process
@pytest.mark.skipif(not (shutil.which("git") or shutil.which("patch")), reason="neither git nor patch is here")
def test_each_mutant_applies_to_the_tree() -> None:
    assert {name: why for name in names() if (why := applied(name, ROOT, check=True))} == {}


def test_there_are_30_mutants_and_one_for_each_rule() -> None:
    assert len(names()) >= 30
    assert {head(name)[1] for name in names() if not TEST.match(head(name)[1])} == NAMES


def test_a_test_that_sees_a_mutant_is_there() -> None:
    named = [head(name)[1].split("::") for name in names() if TEST.match(head(name)[1])]
    gone = [each for file, each in named if not re.search(rf"def {each}\(|dialogue_tests\(", (ROOT / file).read_text())]
    assert named and gone == []


def test_a_mutant_that_is_missing_is_named_with_its_reason() -> None:
    missing = re.findall(r"^- `([a-z-]+)`: ", (mutants.PATCHES / "README.md").read_text(), re.M)
    assert missing
    assert not {*missing} & {*names()}


def test_no_mutant_of_that_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--mutant", "nothing"]) == 2
    assert capsys.readouterr().err.startswith("no mutant nothing; valid: all, ")


@pytest.mark.parametrize(
    ("found", "code", "row"),
    [
        (Caught("guard-passed", "asked", 4, 4, 1.25, "seed 4: broke asked"), 0, "asked              4      4     1.2"),
        (Caught("guard-passed", "", 0, 100, 9.0, "100 seeds"), 1, "NOT CAUGHT              100     9.0"),
    ],
)
def test_a_row_for_each_and_the_exit_code(
    found: Caught, code: int, row: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(mutants, "caught", lambda *_: found)
    assert main(["--mutant", "guard-passed"]) == code
    assert capsys.readouterr().out.splitlines() == [
        mutants.TITLE,
        f"{'guard-passed':36}{row}",
        found.said,
        f"{1 - code} of 1 mutants caught",
    ]


def test_a_seed_that_breaks_a_rule_without_the_mutant_too_does_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mutants, "planted", lambda name: nullcontext(ROOT))
    monkeypatch.setattr(mutants, "_lived", lambda tree, left, *_: (f"seed {left.start + 1}: broke ends, 3 s", ""))
    monkeypatch.setattr(mutants, "result", lambda life: SimpleNamespace(breaches=["ends"] * (life.seed < 6)))
    found = caught("guard-passed", range(1, 9), steps=30)
    assert (found.rule, found.seed, found.tried) == ("ends", 6, 6)
    assert not caught("guard-passed", range(1, 3), steps=30).rule


@pytest.mark.process
def test_the_seeds_are_lived_in_the_copy_which_has_the_mutant() -> None:
    """The copy comes first on the path, its links lead into it, and the tree stays as it is."""
    with mutants.planted("guard-passed") as tree:
        text = (tree / "multidrop" / "shell" / "line_path.py").read_text()
    assert text != (ROOT / "shell" / "line_path.py").read_text()


@pytest.mark.process
@pytest.mark.nightly
@pytest.mark.parametrize("name", names())
def test_a_seed_catches_each_mutant(name: str) -> None:
    found = caught(name, SEEDS, steps=30)
    assert found.rule, found.said
