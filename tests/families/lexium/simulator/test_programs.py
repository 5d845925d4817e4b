"""The simulated drive's programs: memory, listing, flow, errors, trips, pausing, power, and the order of time."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.families.lexium.simulator.ports.mcode import MCodePort
from multidrop.simulator.cell.spec import WorldSpec
from tests.support.examples import examples
from tests.support.lexium import drive, output, printed_lines, say, switched_on

# Memory.


def test_addresses_count_bytes_as_real_units_do():
    device = switched_on()
    at = []
    for line in ("PG 1", "HM 1", "H", "P=30000", "E"):
        assert not device.execute(line, 0.0).refused
        at.append(device.programming)
    assert at == [1, 5, 7, 12, 14]


def test_a_listing_gives_address_and_text_without_remarks():
    device = switched_on()
    say(device, "PG 1", "LB Ga  'the main one", "  P=30000", "' nothing", "", "BR gA", "PG")
    assert say(device, "L") == ["1  LB Ga", "6  P=30000", "11  BR gA"]
    assert say(device, "L Ga", "L 6", "L 7") == [
        "1  LB Ga",
        "6  P=30000",
        "11  BR gA",
        "6  P=30000",
        "11  BR gA",
        "?42",
    ]


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("XX=1", 20),
        ("FOO", 60),
        ("LB MV", 29),
        ("LB Q1A", 24),
        ("LB G1", 28),
        ("LB Q1", 28),
        ("EX G1", 24),
        ("L", 24),
        ("MV=1", 25),
        ("TP=1 K1", 38),
        ("G1=5", 32),
    ],
)
def test_a_line_that_cannot_be_one_is_not_stored(line, code):
    device = switched_on()
    say(device, "VA Q1", "PG 1", "LB G1")
    before = device.programming
    assert device.execute(line, 0.0).refused
    assert device.programming == before
    assert say(device, "PG", "PR ER") == [str(code)]


def test_labels_stay_when_a_program_is_written_over_and_go_with_cp():
    device = switched_on()
    assert say(device, "PG 1", "LB G1", "E", "PG", "PG 1") == []
    assert device.execute("LB G1", 0.0).refused
    assert say(device, "PG", "ER=0", "CP", "PG 1", "LB G1", "PG", "L") == ["1  LB G1"]


def test_program_space_is_bounded():
    device = switched_on()
    assert say(device, "PG 6380") == []
    assert not device.execute("E", 0.0).refused
    assert device.execute("P=300000", 0.0).refused
    assert say(device, "PG", "PR ER") == ["45"]


def test_a_locked_program_is_neither_listed_nor_changed():
    device = switched_on("PG 1\nE\nPG\nS")
    assert say(device, "LK=1", "L", "PG 1", "CP 1", "CP", "PR LK") == ["?44", "?44", "?44", "0"]


def test_a_lock_that_was_saved_is_opened_by_cp_only():
    device = switched_on("PG 1\nE\nPG")
    assert say(device, "LK=1", "LK=0", "LK=1", "S", "LK=0", "PR LK", "CP", "PR LK") == ["?44", "1", "0"]


def test_cp_from_a_label_keeps_what_is_before_it():
    device = switched_on("PG 1\nLB G1\nE\nLB G2\nE\nPG\nVA Q1=5\nS")
    assert say(device, "CP G2", "L", "PR UV") == ["1  LB G1", "6  E", "G1 = 1", "Q1 = G 5", ""]
    assert say(device, "CP 1,G1", "L", "PR UV") == [""]


@pytest.mark.parametrize("program", ["", "PG 1\nLB G1\nVA K1\nE\nPG"])
def test_cp_with_its_parameter_clears_all_and_frees_global_names_with_1_only(program):
    device = switched_on(program)
    assert say(device, "VA Q1=5", "CP 0", "L", "PR UV", "VA Q1", "CP", "VA Q1") == ["Q1 = G 5", "", "?28", "?28"]
    assert say(device, "CP 1", "PR UV", "VA Q1=6", "PG 1", "LB G1", "E", "PG", "L") == ["", "1  LB G1", "6  E"]


def test_a_name_that_a_program_declares_is_free_again_after_cp():
    device = switched_on("PG 1\nLB G1\nVA K1\nE\nPG")
    say(device, "EX G1")
    device.advance(1.0)
    assert say(device, "PR UV", "CP", "PR UV", "PG 1", "LB K1", "PG", "L") == [
        "G1 = 1", "K1 = L 0", "", "", "1  LB K1",
    ]  # fmt: skip


def test_a_parameter_of_cp_opens_no_lock():
    device = switched_on("PG 1\nE\nPG\nS")
    assert say(device, "LK=1", "CP 0", "CP 1", "PR LK", "CP", "L") == ["?44", "?44", "1"]


# Flow.


def test_a_loop_with_a_subroutine():
    device = switched_on(
        """PG 1
        LB Ga
          R1=0
        LB G1
          CL K1
          BR G1,R1<3
          PR "done";
          PR " ",R1
        E
        LB K1
          IC R1
          PR R1
          RT
        PG"""
    )
    device.execute("EX Ga", 0.0)
    assert output(device, 1.0) == "1|2|3|done 3|"
    assert not device.running


def test_a_line_takes_its_time_and_a_label_none():
    device = switched_on("PG 1\nLB G1\nIC R1\nBR G1\nPG", instruction_us=500)
    device.execute("EX G1", 0.0)
    device.advance(0.9999)
    assert say(device, "PR R1", "PR BY") == ["1000", "1"]
    assert device.deadline == pytest.approx(1.0)


def test_hold_waits_for_the_motion_then_for_mt():
    device = switched_on('PG 1\nMA 51200\nH\nPR "over"\nE\nPG', set={"MT": 100})
    device.execute("EX 1", 0.0)
    device.advance(0.001)
    end = device.motor.axis.profile.end
    assert output(device, end + 0.0999) == ""
    assert output(device, end + 0.1001) == "over|"


def test_hold_for_a_time_answers_meanwhile():
    device = switched_on("PG 1\nH 2000\nPR P\nE\nPG")
    device.execute("EX 1", 0.0)
    device.advance(1.0)
    assert say(device, "PR BY", "PG 1", "CP") == ["1", "?41", "?41"]
    assert output(device, 1.99) == "" and output(device, 2.01) == "0|"


def test_ex_leaves_the_program_that_runs_for_another():
    device = switched_on('PG 1\nLB K1\nBR K1\nLB K2\nPR "second"\nE\nPG')
    device.execute("EX K1", 0.0)
    device.advance(1.0)
    assert say(device, "EX Zz", "PR BY", "EX K2") == ["?30", "1"]
    assert output(device, 2.0) == "second|"
    assert say(device, "PR BY") == ["0"]


def test_local_variables_begin_anew_with_each_start():
    device = switched_on("VA Q2=7\nPG 1\nVA Q1=5\nIC Q1\nPR Q1\nIC Q2\nE\nPG")
    for _ in range(2):
        device.execute("EX 1", device.now)
        assert output(device, device.now + 1.0) == "6|"
    assert say(device, "PR UV") == ["Q1 = L 6", "Q2 = G 9", ""]


def test_an_immediate_end_waits_for_the_motion():
    device = switched_on("PG 1\nLB G1\nIC R1\nBR G1\nPG")
    device.execute("MA 51200", 0.0)
    device.execute("EX G1", 0.0)
    device.advance(0.01)
    assert say(device, "E", "PR BY") == ["1"]
    device.advance(device.motor.axis.profile.end)
    assert say(device, "PR BY") == ["0"]


def test_traced_and_stepped_programs_show_their_lines():
    device = switched_on("PG 1\nLB G1\nIC R1\nPR R1\nE\nPG")
    device.execute("EX G1,1", 0.0)
    assert output(device, 1.0) == "6  IC R1|9  PR R1|1|12  E|"
    device.execute("EX G1,2", 1.0)
    assert output(device, 2.0) == "" and device.thread.stepping
    device.step(" ", 2.0)
    assert output(device, 3.0) == "6  IC R1|"
    device.step("\r", 3.0)
    assert output(device, 4.0) == "2|" and not device.running


def test_a_number_from_outside_goes_to_the_waiting_variable():
    device = switched_on('VA Q1\nPG 1\nPR "how many?";\nIV Q1\nLB G1\nBR G1,IF=1\nPR Q1\nE\nPG')
    device.execute("EX 1", 0.0)
    assert output(device, 1.0) == "how many?"
    assert say(device, "PR IF", "-12", "PR IF") == ["1", "0"]
    assert output(device, 2.0) == "-12|"


@pytest.mark.parametrize(
    ("party", "keys", "waits"),
    [
        (False, b"\r", False),
        (False, b"\n", True),
        (True, b"a\r\n", False),
        (True, b"a\n", True),
        (True, b"b\r\n", True),
        (True, b"\r\n", True),
    ],
)
def test_enter_alone_ends_the_wait_for_a_number(party, keys, waits):
    device = switched_on("PG 1\nIV R1\nLB G1\nBR G1,IF=1\nPR R1\nE\nPG", name="a", party=party)
    port = MCodePort(device)
    port.receive(b"\n", 0.0)
    device.execute("R1=7", 0.0)
    device.execute("EX 1", 0.0)
    device.advance(0.5)
    port.receive(keys, 0.5)
    assert (device.running, say(device, "PR IF")) == (True, [str(int(waits))])
    assert output(device, 1.0) == ("" if waits else "7|") and device.running == waits


# Errors.


def test_an_error_in_a_program_is_noted_and_the_next_line_follows():
    device = switched_on('PG 1\nVM=5\nPR "on"\nE\nPG')
    device.execute("EX 1", 0.0)
    assert output(device, 1.0) == "on|"
    assert say(device, "PR EF", "PR ER") == ["1", "23"]


@pytest.mark.parametrize(("line", "code"), [("BR ZZ", 30), ("CL 999", 42), ("CL G1", 43)])
def test_a_jump_to_nothing_ends_a_program(line, code):
    device = switched_on(f'PG 1\nLB G1\n{line}\nPR "on"\nE\nPG')
    device.execute("EX G1", 0.0)
    assert output(device, 1.0) == "" and not device.running
    assert say(device, "PR ER") == [str(code)]


HANDLED = """PG 1
LB G1
OE K1
VM=5
PR "on"
E
LB K1
PR "error ",ER
RT
PG"""


def test_an_error_handler_runs_and_the_program_goes_on():
    device = switched_on(HANDLED)
    device.execute("EX G1", 0.0)
    assert output(device, 1.0) == "error 23|on|"
    assert say(device, "PR EF") == ["0"]


def test_an_error_handler_runs_for_immediate_errors_too():
    device = switched_on(HANDLED)
    say(device, "OE K1")
    assert device.execute("XX=5", 0.0).refused
    assert output(device, 1.0) == "error 20|" and not device.running


def test_starting_a_program_clears_the_error_flag():
    device = switched_on("PG 1\nE\nPG")
    device.execute("XX=5", 0.0)
    assert device.memory.error_flag
    device.execute("EX 1", 0.0)
    assert not device.memory.error_flag


# Trips.


def test_a_position_trip_happens_exactly_there_and_once():
    device = switched_on("PG 1\nTP=51200,K1\nTE=2\nMA 102400\nH\nPR TE\nE\nLB K1\nPR P\nRT\nPG")
    device.execute("EX 1", 0.0)
    assert output(device, 5.0) == "51200|0|"


def test_a_time_trip_interrupts_a_hold_that_then_goes_on():
    device = switched_on('PG 1\nTT=500,K1\nTE=8\nH 1000\nPR "end"\nE\nLB K1\nPR "trip"\nRT\nPG')
    device.execute("EX 1", 0.0)
    device.advance(3.0)
    times = {text.strip(): at for at, text in device.prints()}
    assert times["trip"] == pytest.approx(0.5002) and times["end"] == pytest.approx(1.0004)


def test_a_relative_trip_repeats_as_often_as_told():
    device = switched_on('PG 1\nTR=10000,K1,3\nTE=16\nMA 100000\nH\nPR "te ",TE\nE\nLB K1\nPR P\nRT\nPG')
    device.execute("EX 1", 0.0)
    assert output(device, 5.0) == "10000|20000|30000|te 0|"


def test_an_input_trip_captures_the_position():
    world = WorldSpec(inputs=((0.5, 2, 0),))
    device = switched_on("PG 1\nTI 2,K1\nTE=1\nSL 1000\nH\nE\nLB K1\nPR PC\nRT\nPG", world=world)
    device.execute("EX 1", 0.0)
    device.advance(0.4)
    at = device.position(0.5)
    assert output(device, 1.0) == f"{at}|"


# Pausing, power, memory.


def test_a_paused_program_stops_its_move_and_takes_it_up_again():
    device = switched_on("PG 1\nMA 512000\nH\nPR P\nE\nPG")
    device.execute("EX 1", 0.0)
    device.advance(0.5)
    assert say(device, "PS") == []
    assert output(device, 20.0) == "" and not device.moving(20.0) and 0 < device.position(20.0) < 512000
    assert say(device, "RS") == []
    assert output(device, 40.0) == "512000|"


def test_escape_stops_motor_and_program_at_once():
    device = switched_on("PG 1\nLB G1\nSL 500000\nH 10\nBR G1\nPG")
    device.execute("EX G1", 0.0)
    device.advance(0.3)
    device.escape(0.3)
    at = device.position(0.3)
    device.advance(9.0)
    assert not device.running and device.velocity(0.3) == 0 and device.position(9.0) == at > 0
    assert device.deadline is None


def test_a_program_called_su_runs_at_power_up_and_after_a_reset():
    device = switched_on('PG 1\nLB SU\nPR "hello"\nE\nPG')
    assert output(device, 1.0) == "hello|"
    device.execute("VM=500000", 1.0)
    device.reset(1.0)
    assert output(device, 2.0) == "hello|" and say(device, "PR VM") == ["768000"]
    device.power(False, 2.0)
    assert device.deadline is None and device.execute("PR P", 2.0).refused
    device.power(True, 3.0)
    assert output(device, 4.0) == "hello|"


def test_save_keeps_and_fd_forgets():
    device = switched_on()
    say(device, "VA Q1=5", "VM=500000", "BD=38", "PG 1", "LB G1", "E", "PG", "S")
    assert device.core.printer.baud == 9600
    say(device, "VM=400000", "Q1=6", "CP")
    device.reset(1.0)
    assert say(device, "PR VM", "PR Q1", "L") == ["500000", "5", "1  LB G1", "6  E"]
    assert device.core.printer.baud == 38400
    device.prints()
    say(device, "FD")
    assert [text for _, text in device.prints()] == ["Copyright\xa9 2010 Schneider Electric Motion USA\r\n"]
    assert say(device, "PR VM", "PR UV", "L") == ["768000", ""]


def test_what_needs_a_standing_motor_is_refused_while_it_turns():
    device = switched_on()
    say(device, "MA 512000")
    assert say(device, "S", "FD", "PG 1", "IP", "CP") == ["?73", "?73", "?73", "?74", "?74"]


# Time.

STORY = """PG 1
LB SU
TT=300,K1
TE=8
LB G1
MR 20000
H 50
CL K2,I1=1
IC R1
PR R1," ",P
BR G1,R1<20
H
PR "end ",P
E
LB K1
SL 5000
PR "trip ",P
RT
LB K2
PR "input"
RT
PG"""
INPUTS = ((0.4, 1, 0), (0.41, 1, 1), (0.7, 1, 0))


@examples(20, nightly=200)
@given(st.lists(st.floats(0.0, 3.0), max_size=60))
def test_it_does_not_matter_in_how_many_steps_time_passes(steps):
    whole, stepped = (switched_on(STORY, world=WorldSpec(inputs=INPUTS)) for _ in range(2))
    for now in sorted(steps):
        stepped.advance(now)
    whole.advance(3.0)
    stepped.advance(3.0)
    assert stepped.prints() == whole.prints()
    assert stepped.memory.values == whole.memory.values
    assert stepped.position(3.0) == whole.position(3.0)


def test_going_from_deadline_to_deadline_is_the_same_too():
    whole, stepped = (switched_on(STORY, world=WorldSpec(inputs=INPUTS)) for _ in range(2))
    while (due := stepped.deadline) is not None and due <= 3.0:
        stepped.advance(due)
    whole.advance(3.0)
    story = whole.prints()
    assert stepped.prints() == story
    assert {"input", "trip", "end"} <= {text.split()[0] for _, text in story}


# Motion begun again: moves of nothing, the motion mode, bare numbers.


@pytest.mark.parametrize("word", ["MR", "MA"])
def test_a_move_of_nothing_that_runs_on_goes_nowhere(word):
    device = drive()
    assert say(device, f"{word} 0,1,1") == []
    assert printed_lines(device, 1.0) == ["!"]
    assert say(device, "PR MV", "PR P") == ["0", "0"]


@pytest.mark.parametrize("velocity", [100000, -100000])
def test_a_move_of_nothing_that_runs_on_while_moving_keeps_its_direction(velocity):
    device = drive("VM=50000", f"SL {velocity}")
    device.advance(1.0)
    assert say(device, "MR 0,0,1") == []
    device.advance(2.0)
    assert say(device, "PR V") == [str(velocity // 2)]


def test_the_motion_mode_is_a_state_that_ip_does_not_bring_back():
    device = drive("SL 5", "S", "SL 0")
    assert say(device, "MR 0", "IP", "PR MD") == ["MR"]


@pytest.mark.parametrize("line", ["5+5", "-R1", "100-5"])
def test_numeric_enable_takes_a_number_and_nothing_that_is_computed(line):
    device = drive("NE=1", "MR 0")
    assert say(device, line, "PR MV") == ["?60", "0"]


def test_numeric_enable_takes_signs():
    device = drive("NE=1", "MA 0")
    for line, position in (("500", 500), ("-20", -20), ("+7", 7)):
        assert say(device, line) == []
        device.advance(device.now + 1)
        assert device.position(device.now) == position


def test_every_motion_that_a_line_begins_is_counted():
    device = drive("NE=1", "MR 500")
    assert say(device, 1.0, "500", 1.0, "SC 1", 3.0, "HF 1", 100.0, "SL 500", "SL 0", 1.0, "0") == []
    assert device.language.motions.begun == 5
