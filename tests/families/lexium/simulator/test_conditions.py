"""Conditions of BR and CL."""

import pytest

from tests.support.lexium import drive, run


@pytest.mark.parametrize(
    ("condition", "holds"),
    [("AF&128", True), ("AF&2", False), ("Q1", True), ("Q1&2", False), ("Q1-25", False), ("I1", False), ("F1", True)],
)
@pytest.mark.parametrize("word", ["BR", "CL"])
def test_a_condition_may_be_a_value_that_holds_while_it_is_not_0(word, condition, holds):
    device = drive()
    program = [f"{word} X1,{condition}", 'PR "n"', "E", "LB X1", 'PR "y"', "E"]
    assert run(device, "VA Q1=25", "F1=0.5", "PG 1", *program, "PG", "EX 1", 1.0) == ["y" if holds else "n"]


def test_a_text_is_no_condition():
    assert run(drive(), "PG 1", 'BR X1,"a"', 'CL X1,"a"=1', "PG") == ["?24", "?24"]


def test_a_condition_divides_whole_numbers_where_there_is_no_floating_point():
    program = ["BR AA,F1/2=3", 'PR "n"', "E", "LB AA", 'PR "y"', "E"]
    assert run(drive(personality="MDI"), "VA F1=7", "PG 1", *program, "PG", "EX 1", 1.0) == ["y"]
