"""Mutants that are drawn: each changes one place, the same seed draws the same ones, and what saw one is named."""

from __future__ import annotations

import ast
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from soak.drawn import rooms, tests_of, trial
from soak.drawn.operators import Mutant, functions, mutants, valid
from soak.drawn.tests_of import Map, MeasuredTest

SOURCE = b'''"""A docstring: 1 < 2."""
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    import x

Kind = Literal["a", "b"]
LIMIT: "int" = 3


class Line:
    """Another one."""

    def take(self, data: bytes, most: int = 2) -> bool:
        """Return something."""
        if data and not self.busy:
            self.times += 1
            self.log(data, most)
            return data.endswith(b"\\r\\n")
        for each in data:
            if each == "x" or most - 1 < 5:
                continue
            raise ValueError(f"wrong: {each + 1}")
        return self.busy is True
'''


def changes(source: bytes = SOURCE) -> set[tuple[str, str]]:
    return {(each.before, each.after) for each in mutants("line.py", source)}


def test_every_kind_of_change_is_found() -> None:
    assert changes() >= {
        ("data and not self.busy", "((data) or (not self.busy))"),
        ("data and not self.busy", "(not (data and not self.busy))"),
        ("not self.busy", "(self.busy)"),
        ("self.times += 1", "pass"),
        ("1", "2"),
        ("self.log(data, most)", "pass"),
        ("data, most", "most, data"),
        ('data.endswith(b"\\r\\n")', "None"),
        ('b"\\r\\n"', "b'\\r'"),
        ('each == "x"', 'each != "x"'),
        ('"x"', "'x?'"),
        ("most - 1", "(most + 1)"),
        ("most - 1 < 5", "most - 1 <= 5"),
        ("continue", "break"),
        ('raise ValueError(f"wrong: {each + 1}")', "pass"),
        ("self.busy is True", "self.busy is not True"),
        ("True", "False"),
        ("2", "3"),
        ("3", "4"),
    }


def test_what_is_no_behaviour_is_not_changed() -> None:
    places = {each.line for each in mutants("line.py", SOURCE)}
    lines = SOURCE.decode().splitlines()
    left_out = {
        number for number, line in enumerate(lines, 1) if '"""' in line or "import" in line or "Literal" in line
    }
    assert left_out and not places & left_out
    assert not [each for each in mutants("line.py", SOURCE) if each.before in ("int", "bytes", "each + 1")]


def test_the_assertion_in_a_zip_is_no_behaviour() -> None:
    assert changes(b"def f(a, b):\n    g(zip(a, strict=True), sort(a, reverse=True))\n") >= {("True", "False")}
    assert changes(b"def f(a):\n    for x in zip(a, strict=True):\n        h = x\n") == set()


def test_the_lesser_of_two_values_is_the_same_in_any_order() -> None:
    assert {after for _, after in changes(b"def f(a, b):\n    return [min(a, b), g(a, b)]\n")} == {"None", "b, a"}
    assert len(mutants("line.py", b"def f(a, b):\n    return [min(a, b), g(a, b)]\n")) == 2


def test_errors_that_are_caught_or_suppressed_are_the_same_in_any_order() -> None:
    source = b"def f(a):\n    try:\n        with suppress(A, B), contextlib.suppress(C, D):\n            b = a\n"
    source += b"    except (A, B):\n        b = isinstance(a, (A, B)) or isinstance(a, C)\n"
    assert changes(source) == {
        ("isinstance(a, (A, B)) or isinstance(a, C)", "((isinstance(a, (A, B))) and (isinstance(a, C)))")
    }


def test_each_mutant_is_another_program_and_names_its_function() -> None:
    whole = ast.dump(ast.parse(SOURCE))
    for each in mutants("line.py", SOURCE):
        planted = each.planted(SOURCE)
        assert valid(planted) and ast.dump(ast.parse(planted)) != whole, each.words
        assert each.function == ("" if each.line < 11 else "Line.take")
        assert SOURCE[each.start : each.end].decode() == each.before and f"line.py:{each.line}" in each.words
    assert list(functions(SOURCE)) == [("Line.take", 14, 24)]
    hidden = (
        b"class A:\n    if not CHECKED:\n        def f(self):\n            pass\n    else:\n        def g(self): ...\n"
    )
    assert list(functions(hidden)) == [("A.f", 3, 4), ("A.g", 6, 6)]


@pytest.mark.parametrize("room", rooms.ROOMS)
def test_a_seed_draws_the_same_mutants_of_a_room_one_a_line(room: str) -> None:
    drawn = rooms.draw(room, 12, 7)
    assert drawn == rooms.draw(room, 12, 7) != rooms.draw(room, 12, 8)
    assert len({(each.path, each.line) for each in drawn}) == 12
    assert {each.path for each in drawn} <= set(rooms.files(room))


def test_a_marked_mutant_is_not_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    first = rooms.draw("macros", 1, 7)[0]
    marked = {(first.path, first.function, first.before, first.after)}
    monkeypatch.setattr(rooms, "equivalent", lambda: marked)
    assert first not in rooms.draw("macros", 50, 7)


def test_every_mark_is_of_a_mutant_that_there_is() -> None:
    for path, function, before, after in rooms.equivalent():
        found = mutants(path, (rooms.ROOT / path).read_bytes())
        assert (function, before, after) in {(each.function, each.before, each.after) for each in found}, (path, before)


def test_the_tests_of_a_line_are_those_that_executed_it_the_fast_ones_first(tmp_path: Path) -> None:
    path = "base/atomic.py"
    name, first, last = next(functions((rooms.ROOT / path).read_bytes()))
    with closing(sqlite3.connect(tmp_path / "data")) as data, data:
        data.execute("create table context (id, context)")
        data.execute("create table file (id, path)")
        data.execute("create table arc (file_id, context_id, fromno, tono)")
        data.executemany(
            "insert into context values (?, ?)",
            [(0, ""), (1, "t.py::slow[1]|run"), (2, "t.py::fast|run"), (3, "t.py::process|run")],
        )
        data.execute("insert into file values (1, ?)", (str(rooms.ROOT / "multidrop" / path),))
        arcs = [(1, 0, first, last), (1, 1, -1, first), (1, 1, first, last), (1, 2, first, -1), (1, 3, first, last)]
        data.executemany("insert into arc values (?, ?, ?, ?)", arcs)
    data.close()
    durations = "1.20s call     t.py::slow[1]\n0.30s setup    t.py::slow[2]\n0.02s call     t.py::fast\n"
    durations += "0.01s call     t.py::process\n"
    made = tests_of.measured(tmp_path / "data", durations, ["t.py::fast"])
    slow, fast = MeasuredTest("t.py::slow", 1.5, False), MeasuredTest("t.py::fast", 0.02, True)
    process = MeasuredTest("t.py::process", 0.01, False)
    source = (rooms.ROOT / path).read_bytes()
    assert made.of(path, first, source) == [fast, process, slow], "those of make quick first"
    assert made.of(path, last, source) == [process, slow]
    assert made.of(path, first, b"\n\n" + source) == [fast, process, slow], "a new line elsewhere moves nothing"
    own = MeasuredTest("tests/base/test_atomic.py::own", 9.0, True)
    again = Map([*made.tests, own], {path: {name: [([0], [0, 1, 2, 3])]}})
    assert again.of(path, first, source) == [own, fast, process, slow], "those of the module before them"
    assert name in made.blocks[path] and made.of("macros/model.py", 1, b"") == []


def test_what_is_measured_anew_replaces_all_that_was_known_of_a_test_file() -> None:
    a, old, other = (
        MeasuredTest("a.py::a", 1.0, True),
        MeasuredTest("b.py::old", 2.0, True),
        MeasuredTest("c.py::c", 3.0, False),
    )
    b = MeasuredTest("b.py::b", 0.5, True)
    before = Map([a, old, other], {"x.py": {"f": [([0, 1], [0, 1]), ([2], [2])], "g": [([0], [1])]}})
    made = tests_of.joined(before, Map([b], {"x.py": {"f": [([1, 3], [0])]}}))
    source = b"def f():\n    1\n    2\n    3\n"
    assert [made.of("x.py", line, source) for line in (1, 2, 3, 4)] == [[a], [b, a], [other], [b]]
    assert [each.node for each in made.tests] == ["a.py::a", "b.py::b", "c.py::c"]


def test_a_trial_has_time_for_the_fast_tests_and_for_one_at_least() -> None:
    slow = [MeasuredTest("a", 100.0, True), MeasuredTest("b", 0.1, True)]
    assert trial.chosen(slow) == slow[:1]
    fast = [MeasuredTest(str(number), 1.0, True) for number in range(100)]
    assert trial.chosen(fast) == fast[: int(trial.BUDGET)]


TESTED = """
import line

def test_right():
    assert line.add(1, 2) == 3

def test_wrong_anyway():
    assert line.add(0, 0) == 1
"""


@pytest.mark.process
@pytest.mark.slow
def test_what_sees_a_mutant_is_named_and_a_test_that_fails_anyway_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root, folder = tmp_path / "root", tmp_path / "folder"
    root.mkdir()
    (root / "line.py").write_text("def add(a, b):\n    return a + b\n\n\ndef spare():\n    return [1]\n")
    (root / "test_line.py").write_text(TESTED)
    monkeypatch.setattr(trial, "_lived", lambda tree: "")
    sum_, spare = (each for each in mutants("line.py", (root / "line.py").read_bytes()) if each.after == "None")
    tests = [
        MeasuredTest(f"test_line.py::{name}", 0.1, name == "test_right") for name in ("test_right", "test_wrong_anyway")
    ]

    class Known(Map):
        def of(self, path: str, line: int, source: bytes) -> list[MeasuredTest]:
            return tests if line < 4 else tests[1:]

    told = list[trial.Verdict]()
    found = trial.tried([sum_, spare], Known(tests, {}), 1, told.append, root)
    assert [each.by for each in told] == ["test_line.py::test_right", "test_line.py::test_wrong_anyway", ""]
    assert [(each.mutant, each.by, each.quick) for each in found] == [
        (sum_, "test_line.py::test_right", True),
        (spare, "", False),
    ]
    assert (root / "line.py").read_text().count("return") == 2 and not folder.exists()


def test_the_changed_file_is_whole_again_after_a_trial(tmp_path: Path) -> None:
    root = tmp_path / "root"
    root.mkdir()
    (root / "line.py").write_text("x = 1\n")
    mutant = Mutant("line.py", "", 1, 4, 5, "1", "2")
    copies = trial.Copies(root, tmp_path / "copies", 1)
    with copies.one(mutant) as tree:
        assert (tree / "line.py").read_text() == "x = 2\n"
    with copies.one() as tree:
        assert (tree / "line.py").read_text() == "x = 1\n"
