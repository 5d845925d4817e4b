"""A script is checked whole before anything is sent: every error in one round, each with its place."""

import io
import math
import operator
import sys

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.macros import Macro, MacroStep, MacroStore
from multidrop.shell.scripts.expression import (
    LARGEST_NUMBER,
    DriveQuestion,
    Name,
    evaluate,
    parse,
    parse_check,
    unknowns,
    value_of,
    written,
)
from multidrop.shell.scripts.reading import WrongScript, read_script


@pytest.fixture
def check(tmp_path, monkeypatch):
    """Returns the errors of a script, and can write others beside it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ok.txt").write_text("/print {x}\n")
    (tmp_path / "loop.txt").write_text("/call loop.txt\n")
    (tmp_path / "round.txt").write_text("/call s.txt\n")
    (tmp_path / "bad.txt").write_text("/slep 1\n")
    (tmp_path / "both").write_text("")
    store = MacroStore(tmp_path / "macros")
    for name in ("say", "both"):
        store.save(Macro(name, (MacroStep(0.0, 'PR "{word}"'),)))

    def run(text, **values):
        (tmp_path / "s.txt").write_text(text)
        try:
            read_script("s.txt", values, store)
        except WrongScript as wrong:
            return [str(each) for each in wrong.problems]
        return []

    return run


@pytest.mark.parametrize("word", ["exit", "quit", "help", "?", " Help"])
def test_a_bare_word_is_refused_before_the_first_line_is_sent(check, word):
    found = check(f"MR 100\n{word}\n")
    assert len(found) == 1 and found[0].startswith("s.txt:2: ") and "not a command of a drive" in found[0]
    assert check(f"@a {word}\n") == check(f"PG 1\n{word}\nPG\n") == check(f"/raw on\n{word}\n") == []


@pytest.mark.parametrize(
    "text",
    [
        "/set n 1\nMR {n}\n",
        "/if 1\n/set n 1\n/else\n/set n 2\n/end\nMR {n}\n",
        "/repeat 2\n/set n 1\n/end\nMR {n}\n",
        "/call ok.txt x=1\n/call say word=1\n/play say word=1\n",
        "/call {FILE}.txt x=1\n",
        '/expect "a b" .5\n/expect now\n',
        "/if P > 1\n/if I1\n/repeat {N}\n/end\n/end\n/end",
        "/if {MODE} == 5\n/end\n@{ADDR} P 1",
        "/wait stopped\n/wait idle {N}\n/wait I{N}={MODE} 9\n/wait 'a b' .5\n/sleep {N}",
        "/set s P\n/sleep {s}\n/wait {s} 4\n/repeat {s} - 1\n/end",
    ],
)
def test_a_right_script(text, check):
    values = {"FILE": "ok", "N": "2", "MODE": "5", "ADDR": "a"}
    assert check(text, **{name: value for name, value in values.items() if f"{{{name}}}" in text}) == []
    with pytest.raises(Diagnostic, match="no line takes the value odd"):
        check(text, odd="1", **{name: value for name, value in values.items() if f"{{{name}}}" in text})


def test_a_value_that_no_line_takes_is_refused_with_what_its_lines_take(check):
    with pytest.raises(Diagnostic) as caught:
        check("MR {STEPS}\n/if N > 1\n/end\n", STEPS="1", N="2", STEP="3", M="4")
    assert str(caught.value) == "s.txt: no line takes the values STEP, M; its lines take N, STEPS"
    assert check("MR {STEPS}\n/call ok.txt\n", STEPS="1", x="2") == [], "called files have the values, too"
    assert check("/call ok.txt y=1 x=2\n") == ["s.txt:1: ok.txt: no line takes the value y; its lines take x"]
    with pytest.raises(Diagnostic, match="its lines take no value"):
        check("MR 5\n", STEPS="1")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("/set\n", "s.txt:1: /set: usage: /set NAME EXPR"),
        ("/set a-b 1\n", "s.txt:1: /set: invalid name a-b; usage: /set NAME EXPR"),
        (
            "/set P 1\n",
            "s.txt:1: /set: P is a word of drives; use another name, or small letters; usage: /set NAME EXPR",
        ),
        ("/if\n/end", "s.txt:1: /if: usage: /if EXPR"),
        ("/if 1\n", "s.txt:1: /if has no /end"),
        ("/sleep soon", "s.txt:1: /sleep: no time soon; valid: 0 to 86400 seconds; usage: /sleep SECONDS"),
        ("/repeat -1\n/end", "s.txt:1: /repeat: no number of repetitions -1; valid: 0 to 1000000000; usage: /repeat N"),
        ("/end\n", "s.txt:1: /end without a block"),
        ("/else\n", "s.txt:1: /else without /if"),
        ("/repeat 2\n/else\n/end", "s.txt:2: /else does not belong to the /repeat of line 1"),
        ("/if 1\n/end x\n", "s.txt:2: /end: usage: /end"),
        ("/assert P\n", "s.txt:1: /assert: P is not one comparison; valid: [@ADDR] EXPR OP EXPR [+- N]"),
        ("/assert P = 1\n", "s.txt:1: /assert: = at column 3 is not part of an expression; == compares"),
        ("/assert P < 1 +- 2\n", "s.txt:1: /assert: +- is out of place"),
        ("/assert @* P == 1\n", "s.txt:1: /assert: @* is every drive"),
        ("/expect\n", "s.txt:1: /expect: usage"),
        ('/expect "a\n', "s.txt:1: /expect: a quotation mark is not closed"),
        ('/expect "a" soon\n', "s.txt:1: /expect: no time soon"),
        ("MR {n}\n/set n 1\n", "s.txt:1: no value for {n}"),
        ("/if 1\n/set n 1\n/end\nMR {n}\n", "s.txt:4: no value for {n}"),
        ("/repeat {N}\n/set n 1\n/end\nMR {n}\n", "s.txt:4: no value for {n}"),
        ("/call gone.txt\n", "s.txt:1: gone.txt: cannot be read: No such file"),
        ("/call gone\n", "s.txt:1: /call: no file and no macro gone"),
        ("/call both\n", "s.txt:1: /call: both is a file and a macro"),
        ("/call ok.txt x\n", "s.txt:1: /call: x is not NAME=VALUE"),
        ("/call ok.txt\n", "ok.txt:1: no value for {x}"),
        ("/call say\n", "s.txt:1: macro say, step 1: no value for {word}"),
        ("/call bad.txt\n", "bad.txt:1: no verb /slep; try /sleep"),
        ("/call loop.txt\n", "loop.txt:1: /call: loop.txt would call itself"),
        ("/call round.txt\n", "round.txt:1: /call: s.txt would call itself"),
        ("/set f 1\n/call {f}.txt\n", "s.txt:2: /call: the file must be known before the first line is sent"),
        ("/if 1\n" * 51 + "/end\n" * 51, "s.txt:51: blocks are nested deeper than 50"),
        ("/print {\n", "s.txt:1: a lone { at column 8"),
    ],
)
def test_what_is_wrong_is_said_with_its_place(text, said, check):
    (found,) = check(text, N="2")
    assert found.startswith(said)


@pytest.mark.parametrize("text", ["stoped", "stopped x", "I1", "I1=on", '"done" -1', "stopped 1 2", "{HOW} 2"])
def test_a_wait_for_nothing_that_there_is_is_found_beforehand(text, check):
    (said,) = check(f"MR 1\n/wait {text}\n", HOW="halted")
    assert said.startswith("s.txt:2: /wait: ") and "usage: /wait stopped|idle|ended [SECONDS]" in said


def test_every_error_is_said_at_once(check):
    found = check("/slep\n/if\nMR {x}\n/call bad.txt\n/assert\n/end\n/end\n@a")
    assert [each.partition(": ")[0] for each in found] == [
        *("s.txt:1", "s.txt:2", "s.txt:3", "bad.txt:1", "s.txt:5", "s.txt:7", "s.txt:8")
    ]


def test_a_value_of_set_that_is_a_word_of_a_drive_is_not_guessed(check):
    assert check("MR {P}\n/assert {P} == 1", P="5") == []
    (found,) = check("/assert P == 1", P="5")
    assert found.startswith("s.txt:1: /assert: P is a value of --set and a word of drives; write {P} for the value")


def test_a_flood_of_calls_is_refused(tmp_path, check):
    for n in range(12):
        (tmp_path / f"f{n}.txt").write_text(f"/call f{n + 1}.txt\n/call f{n + 1}.txt\n")
    (tmp_path / "f12.txt").write_text("")
    assert "more than 1000 calls" in check("/call f0.txt")[0]


def test_a_script_from_standard_input(monkeypatch):
    class Stdin:
        buffer = io.BytesIO(b"/print 1\n/slep\n")

    monkeypatch.setattr(sys, "stdin", Stdin)
    with pytest.raises(Diagnostic, match=r"^-:2: no verb /slep"):
        read_script("-", {})


# Expressions


SIGNS = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "%": operator.mod,
    "<": operator.lt,
    ">=": operator.ge,
}


def value(text, **names):
    tree = parse(text, names)
    return evaluate(tree, {each: names[each.name] for each in unknowns(tree)})


@pytest.mark.parametrize(
    ("text", "result"),
    [
        ("2 + 3 * 4 - 1", 13),
        ("(2 + 3) * -4", -20),
        ("10 / 4", 2.5),
        ("10 / 5", 2),
        ("7 - 3 - 2", 2),
        ("1 == 1 and 2 > 3 or not 0", 1),
        ("not 1 == 2", 1),
        ("5 == 7 +- 2", 1),
        ("5 != 7 +- 1.5", 1),
        ('"a" == "a"', 1),
        ('"1" == 1', 0),
        ("x + 1", 6),
        ("- - 5", 5),
        ("5 + -3", 2),
    ],
)
def test_values(text, result):
    assert value(text, x=5) == result


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("P", [DriveQuestion("P")]),
        ("@a P == VM", [DriveQuestion("P", "a"), DriveQuestion("VM", "a")]),
        ("@a P < @press:b P + n", [DriveQuestion("P", "a"), DriveQuestion("P", "press:b"), Name("n")]),
        ("[GAP 1, 0] + @00 [PX]", [DriveQuestion("GAP 1, 0", line=True), DriveQuestion("PX", "00", line=True)]),
    ],
)
def test_the_words_of_drives(text, words):
    assert list(unknowns(parse(text, {"n"}))) == words


@given(st.text(st.sampled_from(' "[]@aP1.+-*/%()<>=!_notdr{#\té'), max_size=40))
@example("(" * 5000)
@example("- " * 5000 + "1")
@example("1+" * 5000 + "1")
def test_any_text_is_an_expression_or_one_clear_line(text):
    for parser in (parse, parse_check):
        try:
            tree = parser(text, {"n"})
            evaluate(tree, {each: 1 for each in unknowns(tree)})
        except Diagnostic as problem:
            assert "\n" not in str(problem)


TREES = st.recursive(
    st.integers(-99, 99), lambda inner: st.tuples(inner, st.sampled_from(sorted(SIGNS)), inner), max_leaves=6
)


def shown(tree):
    return str(tree) if isinstance(tree, int) else f"({shown(tree[0])} {tree[1]} {shown(tree[2])})"


def worked_out(tree):
    return tree if isinstance(tree, int) else int(SIGNS[tree[1]](worked_out(tree[0]), worked_out(tree[2])))


@given(TREES)
def test_it_calculates_as_python_does(tree):
    try:
        expected = worked_out(tree)
    except ZeroDivisionError:
        with pytest.raises(Diagnostic, match="has no result"):
            value(shown(tree))
    else:
        assert value(shown(tree)) == expected


@given(st.integers(-LARGEST_NUMBER, LARGEST_NUMBER) | st.floats(-1e6, 1e6))
def test_a_written_number_is_read_as_the_same_number(number):
    text = written(number)
    assert "e" not in text
    assert math.isclose(float(value_of(text)), number, abs_tol=1e-9)
