"""The language of expressions: what it calculates, and that no text breaks its parser."""

import math
import operator

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from multidrop.dialects import Diagnostic
from multidrop.shell.scripts.expression import (
    LARGEST,
    Name,
    Word,
    evaluate,
    parse,
    parse_check,
    unknowns,
    value_of,
    written,
)

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
        ("P", [Word("P")]),
        ("@a P == VM", [Word("P", "a"), Word("VM", "a")]),
        ("@a P < @press:b P + n", [Word("P", "a"), Word("P", "press:b"), Name("n")]),
        ("[GAP 1, 0] + @00 [PX]", [Word("GAP 1, 0", line=True), Word("PX", "00", line=True)]),
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


@given(st.integers(-LARGEST, LARGEST) | st.floats(-1e6, 1e6))
def test_a_written_number_is_read_as_the_same_number(number):
    text = written(number)
    assert "e" not in text
    assert math.isclose(float(value_of(text)), number, abs_tol=1e-9)
