"""What an ordinary run takes of a product of parameters, leaves in the tree, and does where a tool is absent."""

from __future__ import annotations

import re
import subprocess
from collections import Counter
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from multidrop.base.registry import IN_WHEEL
from tests.support import marks
from tests.support.choose_measured import choose
from tests.support.marks import NIGHTLY, is_taken, places
from tests.support.measuring import UNMEASURED
from tests.support.paths import ROOT, THERE
from tests.support.tools import PROMISED, tool


@pytest.mark.parametrize("sizes", [(4, 2, 2, 2), (12, 7), (5, 3, 3), (1, 6)], ids=str)
def test_every_value_and_every_pair_of_extremes_is_taken(sizes: tuple[int, ...]) -> None:
    taken = [at for at in product(*map(range, sizes)) if is_taken(list(zip(at, sizes, strict=True)))]
    for number, size in enumerate(sizes):
        assert {at[number] for at in taken} == set(range(size))
    assert set(product(*({0, size - 1} for size in sizes))) <= set(taken)


@pytest.mark.parametrize("letter", "xyz")
@pytest.mark.parametrize(("number", "name"), [(1, "one"), (2, "two")])
def test_the_place_of_a_test_is_that_of_its_values(
    request: pytest.FixtureRequest, letter: str, number: int, name: str
) -> None:
    assert places(request.node) == [((number - 1), 2), ("xyz".index(letter), 3)]


def test_an_absent_tool_skips_a_test_and_fails_it_where_all_are_promised(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(PROMISED, raising=False)
    with pytest.raises(pytest.skip.Exception, match="no-such-tool is not installed"):
        tool("no-such-tool")
    monkeypatch.setenv(PROMISED, "1")
    with pytest.raises(pytest.fail.Exception, match="no-such-tool is not installed, and MULTIDROP_ALL_TOOLS"):
        tool("no-such-tool")


@pytest.mark.process
def test_a_file_that_is_left_in_the_tree_fails_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if marks.tree(ROOT) is None:
        pytest.skip("the tree is not one of git")
    subprocess.run(["git", "init", "-q", tmp_path], check=True)
    monkeypatch.setattr(marks, "ROOT", tmp_path)
    config = SimpleNamespace(stash=pytest.Stash())
    config.stash[marks.TREE] = marks.tree(tmp_path)
    session: Any = SimpleNamespace(config=config, exitstatus=pytest.ExitCode.OK)
    marks.pytest_sessionfinish(session)
    assert session.exitstatus == pytest.ExitCode.OK
    (tmp_path / "go2.mxt").touch()
    marks.pytest_sessionfinish(session)
    assert (config.stash[marks.LEFT], session.exitstatus) == (["?? go2.mxt"], pytest.ExitCode.TESTS_FAILED)


def test_ci_installs_every_tool_of_the_tests_and_hides_nothing_by_a_setting_of_python() -> None:
    texts = [
        path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("*.py") if path.name != "test_marks.py"
    ]
    calls = [call for text in texts for call in re.findall(r'(?:mark\.needs|\btool)\(((?:"[\w-]+"(?:, )?)+)\)', text)]
    named = {name for call in calls for name in re.findall(r'"([\w-]+)"', call)}
    ci = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    installed = set(re.findall(r"([\w-]+):[\w-]+", ci)) | {"mosquitto_passwd"}
    assert {"mbpoll", "sshd", "fish", "mosquitto"} <= named <= installed
    assert not [text for text in texts if "skipif(shutil.which" in text or "skipif(not shutil.which" in text]
    assert f"export {PROMISED}=1" in ci
    assert "unset" in ci and "${!PYTHON@}" in ci


def test_each_test_that_a_list_names_is_there() -> None:
    gone = []
    deleted = tuple(f"tests/features/{each}/" for each in IN_WHEEL if each not in THERE)
    for name in [*UNMEASURED.read_text(encoding="utf-8").split(), *NIGHTLY]:
        file, _, function = name.partition("[")[0].partition("::")
        path = ROOT / file
        if file.startswith(deleted):
            continue
        if not path.is_file() or f"def {function}(" not in path.read_text(encoding="utf-8"):
            gone.append(name)
    assert gone == [], "take them out of tests/support/unmeasured.txt or nightly.txt"


def test_the_cheapest_tests_that_show_most_are_measured() -> None:
    times = Counter({"cheap": 0.1, "long": 9.0, "longer": 10.0, "alone": 8.0})
    shown = {
        "cheap": {(1, 1, 2)},
        "long": {(1, n, n + 1) for n in range(300)},
        "longer": {(1, n, n + 1) for n in range(300)},
        "alone": {(2, n, n + 1) for n in range(300)},
    }
    assert choose(times, shown) == ["longer"]
