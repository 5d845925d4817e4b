"""Warnings of `program check` on what a program lacks: ends, calls, holds, trips, uses. None on what people mean."""

from __future__ import annotations

import pytest

from multidrop.families.lexium.manual.program_checker import check
from tests.support.cases import for_each


def warned(program: str, before: str = "VA Q1\n") -> list[tuple[int, str]]:
    """The warnings of a program, lines counted from PG (line 0)."""
    found = check(f"{before}PG 1\n{program}PG\n")
    assert all(each.warning and each.hint for each in found), found
    return [(each.line - 1 - before.count("\n"), each.what) for each in found]


# -- ends and calls


@for_each(
    "program, line, what",
    [
        ("LB G1\nBR G1\nMR 5\nH\nE\n", 3, "never executed: BR G1 in line 4 leads elsewhere"),
        ("LB G1\nE\nVA Q2\nQ2=1\nE\n", 3, "never executed: E in line 4 leads elsewhere"),
        ("LB G1\nCL K1\nE\nLB K1\nRT\nPR 1\nRT\n", 6, "never executed: RT in line 7 leads elsewhere"),
        ("LB G1\nMR 5\nH\n", 3, "the program runs on past this line, its last one"),
        ("LB G1\nE\nLB K1\n", 3, "the program runs on past this line, its last one"),
        ("LB G1\nBR G1,I1=1\n", 2, "the program runs on past this line, its last one"),
        ("LB G1\nPR P\nRT\n", 1, "nothing in this file calls G1, which ends with RT in line 5"),
        ("LB SU\nPR P\nRT\n", 1, "the program that begins here ends with RT in line 5"),
        ("PR P\nRT\n", 1, "the program that begins here ends with RT in line 4"),
        (
            "LB G1\nCL K1\nLB K1\nPR P\nRT\n", 2,
            "the program runs on into the subroutine of line 5, and RT in line 7 then has nothing to return to",
        ),
        (
            "LB G1\nCL K1\nBR K1\nE\nLB K1\nPR P\nRT\n", 3,
            "BR goes into the subroutine K1, and RT in line 9 then has nothing to return to",
        ),
        ("LB G1\nE\nLB K1\nRT\n", 3, "nothing in this file calls K1, which ends with RT in line 6"),
    ],
)  # fmt: skip
def test_a_program_that_does_not_end_as_it_began(program: str, line: int, what: str) -> None:
    assert warned(program) == [(line, what)]


@for_each(
    "program",
    [
        "LB G1\nBR G1\nE\n",  # E as the usual last line
        "LB G1\nCL K1\nE\nLB K1\nRT\nE\n",
        "LB G1\nOE K1\nE\nLB K1\nER=0\nRT\n",
        "LB G1\nTI=1,K1\nTE=1\nLB G2\nBR G2\nLB K1\nRT\n",
        "LB G1\nCL K1\nE\nLB K1\nBR K2,I1=1\nRT\nLB K2\nRT\n",  # two ways out of one subroutine
        "LB G1\nCL K1\nCL K2\nE\nLB K1\nPR 1\nLB K2\nPR 2\nRT\n",  # one subroutine is the end of another
        "LB G1\nCL 100\nE\nPG\nPG 100\nPR 1\nRT\n",
        "LB G1\nBR 7\nPR 1\nE\n",  # an address: which line is there, the text does not show
        "LB G1\nOE 0\nE\nPG\nPG 100\nLB G2\nE\n",
    ],
)
def test_programs_that_end_as_people_write_them(program: str) -> None:
    assert warned(program) == []


def test_each_forgotten_end_is_reported_once() -> None:
    program = "LB SU\nCL K1\nCL K2\nLB K1\nBR K1,I1=1\nRT\nLB K2\nRT\nLB G2\nCL K2\nE\n"
    assert [line for line, _ in warned(program)] == [3]


# -- H


@for_each(
    "program, line, what",
    [
        ("LB G1\nMR 5\nMR -5\nH\nE\n", 2, "MR -5 in line 5 does not wait for the end of this move"),
        ("LB G1\nMR 5\nBR G1\nE\n", 2, "the next MR 5 begins before this one has ended"),
        ("LB G1\nMA 5\nIC Q1\nBR G1,Q1<9\nE\n", 2, "the next MA 5 begins before this one has ended"),
        ("LB G1\nMA 5,0\nPR P\nHM 1\nH\nE\n", 2, "HM 1 in line 6 does not wait for the end of this move"),
        ("LB G1\nHM 1\nP=0\nE\n", 2, "P=0 in line 5 does not wait for the end of this move"),
        ("LB G1\nMR 5\nS\nE\n", 2, "S in line 5 does not wait for the end of this move"),
        ("LB G1\nMR 5\n-5\nH\nE\n", 2, "-5 in line 5 does not wait for the end of this move"),
        (
            "LB G1\nMR 5\nCL K1\nMR 6\nH\nE\nLB K1\nO1=1\nRT\n", 2,
            "MR 6 in line 6 does not wait for the end of this move",
        ),
        ("LB G1\nMR 5\nBR K,I1=1\nR1=1\nLB K\nMA 0\nE\n", 2, "MA 0 in line 8 does not wait for the end of this move"),
    ],
)  # fmt: skip
def test_a_line_that_disturbs_a_move(program: str, line: int, what: str) -> None:
    assert warned(program) == [(line, what)]


@for_each(
    "program",
    [
        "LB G1\nMR 5\nH\nMR -5\nH\nE\n",
        "LB G1\nMR 5\nH 500\nMR -5\nE\n",  # a time may do
        "LB G1\nMR 5\nE\n",
        "LB G1\nMR 5\nO1=1\nPR P\nE\n",
        "LB G1\nMA 5,0,1\nMA 9,0,1\nH\nE\n",  # they go on turning
        "LB G1\nSL 500\nSL 900\nBR G1\nE\n",
        "LB G1\nMR 5\nSL 0\nH\nE\n",
        "LB G1\nMR 5\nLB W1\nBR W1,MV=1\nMR -5\nH\nE\n",
        "LB G1\nMR 5\nLB W1\nBR W1,I1=0\nMR -5\nH\nE\n",  # the part has come
        "LB G1\nMR 5\nLB W1\nR1=MV\nBR W1,R1=1\nMR -5\nH\nE\n",
        "LB G1\nMR 5\nCL K1\nMR -5\nCL K1\nE\nLB K1\nH\nPR P\nRT\n",
        "LB G1\nMR 5\nCL K1\nMR -5\nH\nE\nLB K1\nCL K2\nRT\nLB K2\nH\nRT\n",
    ],
)
def test_moves_that_are_waited_for_or_need_not_be(program: str) -> None:
    assert warned(program) == []


# -- trips, variables


@for_each(
    "program, line, what",
    [
        ("LB G1\nTI=1,K1\nE\nLB K1\nRT\n", 2, "TI is set up, but TE never enables it"),
        ("LB G1\nTP=500,K1\nTE=1\nTI=1,K1\nE\nLB K1\nRT\n", 2, "TP is set up, but TE never enables it"),
        ("LB G1\nTE=2\nE\n", 2, "TE enables TP, which nothing in this file sets up"),
        ("LB G1\nTI=1,K1\nTE=11\nTE=3\nE\nLB K1\nRT\n", 3, "TE enables TP, TT, which nothing in this file sets up"),
        ("LB G1\nVA Q2=5\nPR P\nE\n", 2, "the variable Q2 is never used"),
    ],
)  # fmt: skip
def test_what_is_set_up_and_never_used(program: str, line: int, what: str) -> None:
    assert warned(program) == [(line, what)]


@for_each(
    "program",
    [
        "LB G1\nTT=500,K1\nTE=8\nE\nLB K1\nTE 8\nRT\n",
        "LB G1\nTI=1,K1\nTR=500,K1\nTE=17\nE\nLB K1\nRT\n",
        "LB G1\nTI=1,K1\nTE=Q1\nE\nLB K1\nRT\n",
        "LB G1\nTE=0\nPR TE\nE\n",
        "LB G1\nVA Q2\nIC Q2\nE\n",
    ],
)
def test_trips_and_variables_in_use(program: str) -> None:
    assert warned(program) == []


@for_each(
    "line, valid",
    [
        ("H 99999", "H takes 1 to 65000"),
        ("VM=9999999999", "VM takes 2 to 2560000"),
        ("MS=7", "MS takes 1, 2, 4, 5, 8, 10, 16, 25, 32, 50, 64, 100, 108, 125, 127, 128, 180, 200, 250, 256"),
        ("O1=2", "O1 takes 0 to 1"),
    ],
)
def test_a_number_that_is_refused_when_its_line_runs(line: str, valid: str) -> None:
    (only,) = check(f"PG 1\nLB G1\n{line}\nE\nPG\n", "LMDCM")
    assert only.warning and only.line == 3 and only.hint == valid and "(error 21)" in only.what
    assert check(f"PG 1\nLB G1\n{line.rstrip('0123456789')}\nE\nPG\n", "LMDCM") == []


def test_of_a_product_that_no_table_lists_nothing_is_concluded() -> None:
    assert check("PG 1\nLB G1\nVM=9999999999\nCF\nE\nPG\n", "LMDAM") == []


def test_a_global_variable_may_be_the_hosts() -> None:
    assert warned("LB G1\nE\n", "VA Q1\nVA Q2=7\n") == []


# -- beside errors


@pytest.mark.parametrize(
    "program",
    [
        "LB G1\nTI=1,K1\nTE=1)\nE\nLB K1\nRT\n",
        "LB G1\nCL K1)\nE\nLB K1\nRT\n",
        "LB G1\nMR 5\nH)\nMR -5\nH\nE\n",
        "LB G1\nBR K9\nPR 1\nE\n",
        "LB G1\nMR 5\nH\nE(\n",
        "LB G1\nVA Q2\nQ2=5)\nE\n",
    ],
)
def test_what_a_line_with_an_error_may_have_is_not_missed(program: str) -> None:
    (only,) = check(f"PG 1\n{program}PG\n")
    assert not only.warning


def test_errors_and_warnings_are_reported_in_one_round_by_place() -> None:
    found = check("PG 1\nLB G1\nMR 5\nMR 6\nQ9=1\nBR G1\nPR 1\nPG\n")
    assert [(each.line, each.warning) for each in found] == [(3, True), (5, False), (7, True)]


def test_ctrl_c_in_a_print_of_a_program_is_named() -> None:
    told = [(2, "it prints Ctrl+C: every drive of the party line that hears it resets")]
    assert warned('LB G1\nPR "a\\c"\nE\n') == told and warned('LB G1\nPR "a\\\\c"\nE\n') == []
