"""Trips: set up, armed, happening, repeated, saved."""

import pytest

from tests.support.cases import for_each
from tests.support.lexium import at, drive, printed, printed_lines, prints_until, say


@pytest.mark.parametrize("way", [1, -1])
def test_a_trip_on_position_beyond_the_turnover_of_a_counter_happens_there(way):
    lines = (f"P={way * 2147483640}", f"TP={-way * 2147483640},K1", "TE=2", f"MR {way * 100}")
    device = drive(*lines, program="PG 1\nLB K1\nPR P\nRT\nPG")
    assert printed_lines(device, 1.0) == [str(-way * 2147483640)]


@pytest.mark.parametrize("before", [0, 5])
def test_a_relative_trip_that_is_set_up_anew_repeats_as_often_as_it_now_says(before):
    device = drive(f"TR=1000,K1,{before}", "TE=16", "MR 3500", program="PG 1\nLB K1\nPR P\nRT\nPG")
    assert prints_until(device, 1) == ["1000", "2000", "3000"]
    say(device, "TR=1000,K1,3", "MR 5000")
    assert prints_until(device, 2) == ["4000", "5000", "6000"] and say(device, "PR TE") == ["0"]


@pytest.mark.parametrize(("trip", "bit"), [("TP=1000,K1", 2), ("TR=1000,K1,1", 16)])
def test_a_place_that_the_encoder_is_pushed_past_trips(trip, bit):
    device = drive("EE=1", trip, f"TE={bit}", program="PG 1\nLB K1\nPR P\nRT\nPG")
    for t, pushed, out in ((1, 12000, []), (2, 1600, ["1063"]), (3, -1600, [])):
        device.world.push(pushed, t - 1)
        device.advance(t - 0.5)
        assert prints_until(device, t) == out
    assert say(device, "PR TE") == ["0"]
    device = drive(trip, f"TE={bit}", program="PG 1\nLB K1\nPR P\nRT\nPG")
    device.world.push(60000, 0)
    device.advance(0.5)
    assert prints_until(device, 1) == [], "without the encoder P has not moved"


PLACES = 'PG 100\nLB K1\nPR "k1 ",TE\nRT\nLB K6\nPR "k6 ",TE\nRT\nPG'
"""K1 is at 100."""


@pytest.mark.parametrize(
    ("line", "printed"),
    [
        ("TI 1,K1", "1, K1"), ("TI=4 , k6", "4, K6"), ("TI=2,100", "2, 100"),
        ("TC=K1", "K1"), ("TC 100", "100"), ("TM=k1", "K1"), ("TM 100", "100"),
        ("TT=10000,K1", "10000, K1"), ("TT 65535,100", "65535, 100"),
        ("TP=51200, K1", "51200, K1"), ("TP -5,100", "-5, 100"),
        ("TR=512000,K1,15", "512000, K1, 15"), ("TR=10000,0,25", "10000, 0, 25"), ("TR 500", "500, 0, 0"),
        ("TR=500,100", "500, 100, 0"), ("TA=4, k6", "4, K6"), ("TA 31,100", "31, 100"),
    ],
)  # fmt: skip
def test_a_trip_takes_labels_and_addresses_in_each_printed_form(line, printed):
    device = drive(program=PLACES)
    word = line[:2]
    assert say(device, f"PR {word}", line, f"PR {word}") == ["0", printed]
    assert say(device, f"IC {word}", word, f"{word}=", f"PR {word}") == ["?26", "?34", "?24", printed]


@for_each(
    ("line", "code"),
    [
        ("TI 5,K1", 10), ("TI 0,K1", 10), ("TI 1,Q1", 30), ("TI 1,99", 42), ("TI 1,VM", 34), ("TI 1", 38),
        ("TI 1,K1,1", 24),
        ("TC=Q1", 30), ("TC=99", 42), ("TC=K1,1", 24), ('TC="a"', 24), ("TM=R1", 34), ("TM=1,K1", 24),
        ("TT=0,K1", 21), ("TT=65536,K1", 21), ("TT 5 K1", 38), ("TT=5,Q1", 30),
        ("TP=51200", 38), ("TP=2147483648,K1", 21), ("TP=5,Q1", 30),
        ("TR=0,K1", 21), ("TR=5,K1,65001", 21), ("TR=5,K1,-1", 21), ("TR=5,K1,1,1", 24), ("TR=5,Q1", 30),
        ("TA=32,K1", 21), ("TA=-1,K1", 21), ("TA=4", 38), ("TA=4,Q1", 30), ("TA=4,99", 42),
    ],
)  # fmt: skip
def test_a_trip_that_cannot_be_is_refused_and_the_one_before_stays(line, code):
    device = drive("TI 1,K1", "TC=K1", "TM=K1", "TT=1,K1", "TP=1,K1", "TR=1,K1", "TA=1,K1", program=PLACES)
    before = say(device, f"PR {line[:2]}")
    assert say(device, line, f"PR {line[:2]}") == [f"?{code}", *before]


def test_a_trip_on_hmt_is_switched_off_by_a_mask_of_0():
    device = drive("TA=4,K1", "TE=32", program=PLACES)
    assert say(device, "TA=0", "PR TA", "PR TE", "TE=32") == ["0", "0", "?27"]


def test_what_is_armed_must_be_set_up_and_fit_together():
    device = drive(program=PLACES)
    assert say(device, *(f"TE={bit}" for bit in (1, 2, 4, 8, 16, 32, 64)), "PR TE") == ["?27"] * 7 + ["0"]
    say(device, "TI 1,K1", "TC=K1", "TM=K1", "TT=60000,K1", "TP=1,K1", "TR=1,K1", "TA=1,K1")
    assert say(device, "TE=4", "IS=1,12,0", "TE=127", "TE=18", "TE=128", "TE=-1") == ["?12", "?39", "?39", "?21", "?21"]
    assert say(device, "TE=109", "PR TE", "TE=0", "PR TE") == ["109", "0"]


def test_a_trip_loses_its_own_bit_only_and_may_be_armed_anew():
    program = PLACES.removesuffix("PG") + "LB G1\nTI=1,K1\nTT=500,K6\nTE=9\nH 2000\nTE=1\nH 1000\nPR TE\nE\nPG"
    device = drive("EX G1", program=program, inputs=((1.0, 1, 0), (1.5, 1, 1), (2.2, 1, 0)))
    assert prints_until(device, 5) == ["k6 1", "k1 0", "k1 0", "0"]


def test_a_position_trip_counts_in_encoder_counts_and_a_relative_one_from_the_last():
    device = drive("EE=1", "TP=1000,K1", "TE=2", "MA 2000", program="PG 1\nLB K1\nPR P\nRT\nPG")
    assert prints_until(device, 1) == ["1000"]
    say(device, "TR=500,K1,3", "TE=16", "MR -2000")
    assert prints_until(device, 3) == ["1500", "1000", "500"]
    assert at(device, 3, "TE", "PC") == ["0", "0"]


def test_power_loss_trips_with_the_position_captured():
    device = drive("TM=K1", "TE=64", "SL 5000", program='PG 1\nLB K1\nPR "lost ",PC\nRT\nPG')
    device.advance(1)
    device.supply(False, 1.0)
    assert prints_until(device, 2) == ["lost 4992"]
    assert say(device, "PR ER", "PR VT", "PR VT,1", "PR VT 2", "MR 5") == ["79", "2, 12, 0", "2, 12", "2, 0", "?96"]


def test_set_up_trips_are_saved_and_not_armed_at_power_up():
    device = drive("TI=1,K1", "TP=5,K1", "TE=3", "S", program=PLACES)
    device.power(False, 1)
    device.power(True, 2)
    assert say(device, "PR TI", "PR TP", "PR TE", "FD", "PR TI", "TE=1") == ["1, K1", "5, K1", "0", "0", "?27"]


SUBROUTINE = ("PG 1", "LB K1", 'PR "trip"', "RT", "PG")


def test_save_keeps_trips_but_does_not_keep_them_armed():
    device = drive(*SUBROUTINE, "TP=100,K1", "TE=2", "S")
    device.reset(1.0)
    assert say(device, "PR TP", "PR TE", "TE=2", "MR 500", 1.0) == ["100, K1", "0"]
    assert printed(device).endswith("trip\r\n")


def test_initialising_takes_saved_trips_back_and_disarms_those_that_are_gone():
    device = drive(*SUBROUTINE, "TP=100,K1", "S", "TP=200,K1", "TT=500,K1", "TE=10", "IP")
    assert say(device, "PR TP", "PR TT", "PR TE") == ["100, K1", "0", "2"]


def test_factory_defaults_forget_trips():
    assert say(drive(*SUBROUTINE, "TP=100,K1", "S", "FD"), "PR TP", "TE=2") == ["0", "?27"]


@pytest.mark.parametrize(
    ("lines", "expression", "found"),
    [
        (["TP=51200,K1"], "TP", "51200"), (["TT=500,1"], "TT/5", "100"), (["TI=3,K1"], "TI", "3"),
        (["TR=-8,K1"], "TR", "-8"), (["TA=4,K1"], "TA", "4"), ([], "TP", "0"),
    ],
)  # fmt: skip
def test_a_trip_is_computed_with_as_the_first_number_of_its_set_up(lines, expression, found):
    assert say(drive(*SUBROUTINE, *lines), f"R1={expression}", "PR R1") == [found]
