"""PR and the listings of parameters and variables: what may be printed and how it is written."""

import pytest

from tests.support.lexium import drive, printed_lines, run, say


def test_al_is_for_immediate_use_only():
    device = drive()
    assert [device.execute(line, 0.0).refused for line in ("PG 1", "PR AL", 'PR "AL"', "PG")] == [0, 1, 0, 0]
    assert say(device, "PR ER", "L") == ["24", '1  PR "AL"']


@pytest.mark.parametrize("what", ["5.50", "1e3", "-0.5"])
def test_print_takes_no_number_with_a_fraction(what):
    assert say(drive(), f"PR {what}") == ["?35"]


@pytest.mark.parametrize("line", ["PR ,P", "PR P,", "PR P,,V", "PR ,", "PR P,;", "PRP,", "PR=,P", "PR P, 'remark"])
def test_a_comma_of_a_print_stands_between_two_things(line):
    assert say(drive(), line) == ["?24"]


def test_a_print_may_go_without_commas_or_have_them_in_a_text():
    device = drive(program='PG 1\nLB G1\nPR "a,",P," ,"\nE\nPG')
    assert say(device, 'PR P V", ",P', "PRP,V", 'PR "x",P;', "PR", "PR=P,V 'no, really", "EX G1") == [
        "00, 0", "00", "", "00",
    ]  # fmt: skip
    assert printed_lines(device, 1.0) == ["a,0 ,"]
    assert say(device, "PG 1") == []
    assert device.execute("PR P,", device.now).refused
    assert device.programming == 1


def test_all_parameters_include_the_trips():
    device = drive()
    run(device, "PG 1", "LB T1", "RT", "PG", "TI=2,T1", "TC=T1")
    rows = run(device, "PR AL")
    assert {"TI = 2, T1", "TC = T1", "TP = 0", "TE = 0"} <= set(rows)
    assert sorted(rows) == rows[-1:] + rows[:-1] and rows[-1] == ""
