"""Section 5 on the simulated drive, QD to WT: errors in their order, trips in every form, what S keeps."""

import pytest

from tests.support.moving import at, drive, say

PLACES = 'PG 100\nLB K1\nPR "k1 ",TE\nRT\nLB K6\nPR "k6 ",TE\nRT\nPG'
"""K1 is at 100."""


def told(device, t):
    """What was printed by itself up to a time."""
    device.advance(t)
    return [text.strip() for _, text in device.prints()]


# QD, R1 to R4, RA, RC, RD


@pytest.mark.parametrize(
    ("word", "default", "good", "bad"),
    [
        ("QD", "0", ("1", "0"), ("2", "-1")),
        ("R4", "0", ("2147483647", "-2147483648", "12345"), ("2147483648", "-2147483649", "12345678901")),
        ("RA", "1", ("0", "1"), ("2", "-1")),
        ("RC", "25", ("1", "75", "100"), ("0", "101")),
        ("RD", "0", ("1", "0"), ("2", "-1")),
        ("SF", "15", ("0", "20", "65000"), ("-1", "65001")),
        ("SM", "0", ("1", "0"), ("2", "-1")),
        ("TD", "1", ("0", "1"), ("2", "-1")),
        ("TQ", "25", ("1", "50", "100"), ("0", "101")),
        ("TS", "0", ("46512", "51200", "2560000"), ("46511", "2560001", "0")),
        ("VF", "0", ("0", "500", "1000"), ("-1", "1001")),
        ("WT", "80", ("0", "75", "84"), ("-1", "85")),
    ],
)
def test_a_setting_has_the_printed_default_and_range_and_keeps_its_value_when_refused(word, default, good, bad):
    device = drive()
    assert say(device, f"PR {word}") == [default]
    for value in good:
        assert say(device, f"{word}={value}", f"PR {word}", f"{word} {value}", f"pr {word}") == [value, value]
    for value in bad:
        assert say(device, f"{word}={value}", f"PR {word}") == ["?21", good[-1]]
    nonsense = [word, f"{word}=", f"{word}=1,2", f"{word}=1 2", f'{word}="1"', f"{word}=Q9"]
    assert say(device, *nonsense, f"PR {word}") == ["?34", "?24", "?24", "?38", "?21", "?30", good[-1]]


@pytest.mark.parametrize("word", ["SF", "SM", "ST", "TA", "TD", "TQ", "TS", "VF"])
def test_an_open_loop_drive_lacks_encoder_and_hmt(word):
    assert say(drive(personality="LMDOM"), f"PR {word}", f"{word}=1", f"IC {word}") == ["?37"] * 3


def test_the_queue_is_for_serial_drives_and_the_step_angle_for_the_module():
    assert say(drive(personality="LMDOE"), "QD=1", "PR QD") == ["?37", "?37"]
    assert say(drive(), "SA=0.9", "PR SA") == ["?37", "?37"]
    assert say(drive(personality="LMM"), "SC 1", "TQ=5") == ["?37", "?37"]


def test_the_direction_is_not_turned_on_the_way():
    device = drive("MR 51200")
    assert say(device, "RD=1", "PR RD") == ["?95", "0"]
    device.advance(2)
    say(device, "RD=1", "SL 1000")
    assert say(device, "RD=0", "PR RD") == ["?95", "1"]


# RS, RT, S


PAUSED = 'PG 1\nLB G1\nMR 512000\nH\nPR "done"\nE\nPG'


def test_resuming_what_is_not_paused_tells_whether_a_program_runs():
    device = drive(program=PAUSED)
    assert say(device, "RS", "EX G1", "RS", "RS=1", "RS 1") == ["?40", "?41", "?33", "?24"]
    device.advance(0.2)
    assert say(device, "PS", "RS") == []


def test_a_resumed_move_goes_on_with_the_ramp_that_is_set_by_then():
    device = drive("EX G1", program=PAUSED)
    device.advance(0.2)
    say(device, "PS")
    assert at(device, 1.5, "MV", "BY") == ["0", "1"]
    say(device, "A=100000", "RS")
    assert at(device, 1.8, "V") == ["31000"]  # VI and 0.3 s of A
    assert told(device, 20) == ["done"] and at(device, 20, "P") == ["512000"]


def test_a_return_is_for_programs_and_needs_a_call():
    device = drive(program="PG 1\nLB G1\nRT\nPR 1\nE\nPG")
    assert say(device, "RT", "EX G1") == ["?46"]
    assert told(device, 1) == [] and say(device, "PR ER") == ["43"]


@pytest.mark.parametrize("move", ["MA 100000", "MR -100000"])
def test_nothing_is_saved_during_a_move(move):
    device = drive("RC=50", "S", "RC=60", move)
    assert say(device, "S") == ["?73"]
    device.advance(2)
    assert say(device, "IP", "PR RC", "RC=60", "S", "IP", "PR RC") == ["50", "60"]


def test_a_drive_that_is_saved_disabled_comes_up_disabled():
    device = drive("DE=0", "S")
    device.power(False, 1)
    device.power(True, 2)
    assert say(device, "PR DE", "MR 100", "DE=1", "MR 100") == ["0", "?94"]
    device.reset(3)
    assert say(device, "PR DE", "FD", "PR DE") == ["0", "1"]


def test_initializing_restores_the_saved_enable():
    device = drive("DE=0")
    assert say(device, "IP", "PR DE", "MR 100") == ["1"]


# The order of errors: what the drive cannot do at all comes first


@pytest.mark.parametrize("word", ["HM 1", "HI 1", "HF 1", "MA 1", "MR 1", "SL 1"])
def test_a_disabled_drive_refuses_every_motion_with_94(word):
    assert say(drive("DE=0"), word, "PR MV") == ["?94", "0"]


def test_without_its_supply_homing_is_refused_before_the_switch_is_looked_for():
    device = drive()
    device.supply(False, 0.0)
    assert say(device, "HM 1") == ["?96"]
    device.supply(True, 0.0)
    assert say(device, "HM 1", "HM 7") == ["?80", "?81"]


@pytest.mark.parametrize("word", ["ER", "ST", "IF"])
def test_what_may_be_cleared_is_not_read_only_but_is_not_stepped(word):
    assert say(drive(), f"IC {word}", f"DC {word}", f"{word}=0") == ["?26", "?26"]
    assert say(drive(), "IC V", "IC VC", "IC VR") == ["?25"] * 3


# SA, SC


def test_the_step_angle_takes_the_angles_of_the_table_only():
    device = drive(personality="LMM")
    for angle in ("0.45", "0.72", "0.9", "1.8", "1.875", "2", "2.5", "3.6", "5"):
        assert say(device, f"SA={angle}", "PR SA") == [f"{float(angle):.6f}"]
    assert say(device, "SA=1", "SA=0.91", "PR SA", "FD", "PR SA") == ["?21", "?21", "5.000000", "1.800000"]


def test_a_finer_motor_turns_once_in_twice_the_steps():
    device = drive("SA=0.9", "MR 102400", personality="LMM")
    device.advance(2)
    assert device.axis.physical(2) == 51200


def test_the_configuration_test_turns_half_a_turn_and_is_no_variable():
    device = drive()
    assert say(device, "SC", "SC=", "SC 0", "SC 2", "SC 1,1", "PR SC", "PR MV") == [
        "?24", "?24", "?21", "?21", "?24", "?35", "0",
    ]  # fmt: skip
    assert say(device, "SC 1", "SC 1", "MR 5") == ["?89", "?88"]
    assert at(device, 2, "P", "C2", "ER") == ["25600", "2000", "0"]
    device = drive("SC 1", stall_at=5000.0)
    assert at(device, 2, "ER") == ["100"]
    assert say(drive("DE=0"), "SC 1") == ["?103"]


# SF, SM, ST


def test_without_encoder_mode_there_is_no_stall_whatever_is_set():
    device = drive("SF=5", "SM=0", "MR 51200", stall_at=10000.0)
    assert at(device, 2, "P", "ST", "ER", "MV") == ["51200", "0", "0", "0"]
    assert say(device, "ST=0", "ST=1", "PR ST") == ["?21", "0"]


def test_a_stall_stops_the_motor_where_the_factor_is_reached():
    device = drive("EE=1", "SF=30", "MR 2048", personality="LMM", stall_at=2000 * 12.8)
    assert at(device, 1, "P", "C1", "ST", "ER") == ["2000", str(2030 * 128 // 10), "1", "86"]
    assert say(device, "PR ST", "MR -400") == ["1"], "neither reading ER nor the flag forbids or clears anything"
    assert at(device, 2, "P", "ST", "ER") == ["1600", "1", "0"]
    assert say(device, "EE=0", "PR ST", "ST=0", "PR ST") == ["1", "0"]


def test_in_mode_1_a_stall_is_told_and_the_move_goes_on():
    device = drive("EE=1", "SM=1", "MR 4000", stall_at=10000.0)
    assert at(device, 0.5, "ST", "ER", "MV") == ["1", "86", "1"]
    assert int(at(device, 0.9, "C1")[0]) > 51200


def test_with_hmt_there_is_no_stall():
    device = drive("EE=1", "AS=1", stall_at=10000.0)
    device.advance(0.1)
    say(device, "MR 51200")
    assert at(device, 3, "ST", "LR", "ER") == ["0", "1", "104"]


# SL, V, VC, VI, VM


def test_a_slew_goes_beyond_vm_up_to_what_the_microsteps_allow():
    device = drive("VM=2000", "SL 20000")
    assert at(device, 1, "V", "VC", "MP") == ["20000", "0", "0"]
    refused = say(device, "SL 5000001", "SL -5000001", "SL 2560001", "SL", "SL 1,1", "SL Q1", "PR V")
    assert refused == ["?21", "?21", "?77", "?24", "?24", "?30", "20000"]
    assert say(device, "SL -2560000", "PR VC") == ["1"]
    assert at(device, 4, "V") == ["-2560000"]
    device = drive("EE=1")
    assert say(device, "SL 200001", "SL -200001", "SL 200000") == ["?21", "?21"]


def test_after_a_move_is_slowed_down_the_next_motion_waits():
    device = drive("MA 512000")
    device.advance(0.3)
    assert say(device, "SL 0", "MR 100", "MA 0", "SL 5") == ["?85"] * 3
    device.advance(2)
    assert say(device, "MR 100") == []


def test_a_new_top_speed_is_for_the_next_move():
    device = drive("MA 1000000")
    device.advance(0.5)
    say(device, "VM=100000")
    assert at(device, 0.9, "V") == ["768000"]
    device.advance(3)
    say(device, "MA 0")
    assert at(device, 4, "V") == ["-100000"]


def test_the_two_velocities_keep_apart_and_within_the_microsteps():
    device = drive()
    assert say(device, "VM=1000", "VM=999", "VI=768000", "VI=768001", "VI=0") == ["?23", "?23", "?22", "?22", "?21"]
    assert say(device, "VM=2560001", "PR VM", "PR VI") == ["?21", "768000", "1000"]
    say(device, "MS=16")
    refused = say(device, "VM=160001", "VI=160001", "TS=160001", "SL 160001", "VI=160000", "PR VI")
    assert refused == ["?77", "?77", "?77", "?77", "?22", "63"]
    assert say(drive("EE=1"), "PR VI", "PR VM", "VM=200001", "VI=60000", "VM=78") == [
        "78",
        "60000",
        "?21",
        "?22",
        "?23",
    ]


def test_velocity_and_its_changing_are_only_read_and_programs_branch_on_them():
    program = "PG 1\nLB G1\nSL 5000\nH 10\nBR K9,V=5000\nE\nLB K9\nSL 100000\nH 20\nCL Q1,VC=1\nE\nLB Q1\nPR V\nRT\nPG"
    device = drive("EX G1", program=program)
    assert told(device, 1) == ["25400"]
    assert say(device, "V=1", "VC=1", "VR=1", "SN=1", "UV=1", "VT=1") == ["?25"] * 6


# Trips


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


@pytest.mark.parametrize(
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
    assert told(device, 5) == ["k6 1", "k1 0", "k1 0", "0"]


def test_a_position_trip_counts_in_encoder_counts_and_a_relative_one_from_the_last():
    device = drive("EE=1", "TP=1000,K1", "TE=2", "MA 2000", program="PG 1\nLB K1\nPR P\nRT\nPG")
    assert told(device, 1) == ["1000"]
    say(device, "TR=500,K1,3", "TE=16", "MR -2000")
    assert told(device, 3) == ["1500", "1000", "500"]
    assert at(device, 3, "TE", "PC") == ["0", "0"]


def test_power_loss_trips_with_the_position_captured():
    device = drive("TM=K1", "TE=64", "SL 5000", program='PG 1\nLB K1\nPR "lost ",PC\nRT\nPG')
    device.advance(1)
    device.supply(False, 1.0)
    assert told(device, 2) == ["lost 4992"]
    assert say(device, "PR ER", "PR VT", "PR VT,1", "PR VT 2", "MR 5") == ["79", "2, 12, 0", "2, 12", "2, 0", "?96"]


def test_set_up_trips_are_saved_and_not_armed_at_power_up():
    device = drive("TI=1,K1", "TP=5,K1", "TE=3", "S", program=PLACES)
    device.power(False, 1)
    device.power(True, 2)
    assert say(device, "PR TI", "PR TP", "PR TE", "FD", "PR TI", "TE=1") == ["1, K1", "5, K1", "0", "0", "?27"]


# SU, UG, UV, VA, VR, VT, WT


def test_the_startup_program_runs_at_power_up_and_reset_and_by_name():
    device = drive("S", program='PG 100\nLB SU\nPR "up"\nE\nPG')
    device.advance(1)
    device.prints()
    device.power(False, 2)
    device.power(True, 3)
    assert told(device, 4)[-1] == "up"
    device.reset(5)
    assert told(device, 6)[-1] == "up"
    say(device, "EX SU")
    assert told(device, 7) == ["up"]
    assert say(device, "PR UV", "PR SU", "VA SU=1", "FD", "EX SU") == ["SU = 100", "", "?35", "?29", "?30"]


def test_user_variables_tell_their_scope():
    device = drive("R1=8", "VA Q1=25", "EX G1", program="PG 1\nLB G1\nVA Q2=R1\nIC Q2\nE\nPG")
    device.advance(1)
    assert say(device, "PR UV") == ["G1 = 1", "Q1 = G 25", "Q2 = L 9", ""]
    refused = say(device, "VA Q1", "VA Q1=3", "VA G1", "VA VM=3", "VA 1Q", "VA QQQ", "VA I7", "VA", "VA Q5=ZZ", "PR Q5")
    assert refused == ["?28", "?28", "?28", "?29", "?24", "?24", "?24", "?24", "?30", "?35"]
    assert say(device, "PR Q1", "S", "Q1=3", "IP", "PR Q1", "UG 2956102") == ["25", "25", "?24"]


def test_voltages_are_printed_behind_their_status():
    assert say(drive(), "PR VT", "PR VT,1", "PR VT 2", "PR VT,3") == ["0, 12, 24", "0, 12", "0, 24", "?21"]
    assert say(drive(personality="LMM"), "PR VT", "PR VT,2", "PR VT,1") == ["1, 24", "1, 24", "?37"]


def test_a_temperature_above_the_warning_is_told():
    device = drive("WT=20")
    assert at(device, 1, "ER", "WT") == ["71", "20"]
