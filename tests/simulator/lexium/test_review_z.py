"""Commands of section 5.1 from WT back to LM, and the wire: what a second reading of the manual has found."""

import pytest

from simulator.cell.spec import DriveSpec, WorldSpec
from simulator.lexium.device import MCodeDevice
from simulator.lexium.ports.mcode import MCodePort
from simulator.wire.wire import Wire
from simulator.world import World

SUBROUTINE = ("PG 1", "LB K1", 'PR "trip"', "RT", "PG")


def drive(*lines, personality="LMDCM", **world):
    """A drive that has taken these lines."""
    device = MCodeDevice(DriveSpec(personality=personality), World(WorldSpec(**world)))
    device.prints()
    for line in lines:
        assert not device.execute(line, 0.0).refused, line
    return device


def say(device, *lines):
    """What lines printed, or the code of a refusal as `?code`; a number waits so many seconds."""
    said = []
    for line in lines:
        if isinstance(line, (int, float)):
            device.advance(device.now + line)
            continue
        answer = device.execute(line, device.now)
        if answer.refused:
            said.append("?" + device.execute("PR ER", device.now).lines[0])
        else:
            said += answer.lines
    return said


def printed(device):
    """What the drive has printed by itself."""
    return "".join(text for _, text in device.prints())


@pytest.mark.parametrize(
    ("lines", "line", "code"),
    [
        (["MS=4"], "VM=40001", "?77"),
        (["MS=4"], "VM=2560001", "?21"),
        ([], "VM=2560001", "?21"),
        (["MS=10"], "TS=100001", "?77"),
        (["MS=10"], "TS=46511", "?21"),
        ([], "TS=2560001", "?21"),
    ],
)
def test_a_velocity_that_the_microsteps_do_not_reach_is_error_77(lines, line, code):
    assert say(drive(*lines), line) == [code]


def test_velocities_up_to_ten_thousand_a_microstep_are_taken():
    assert say(drive("MS=10"), "VM=100000", "TS=100000", "PR VM", "PR TS") == ["100000", "100000"]


def test_vm_stays_above_vi_however_coarse_the_microsteps_become():
    assert say(drive("VI=1000", "VM=1001"), "MS=1", "PR VI", "PR VM") == ["4", "5"]


def test_the_ramps_stay_in_their_range_however_fine_the_microsteps_become():
    device = drive("MS=1", "A=1100000000", "D=66")
    assert say(device, "MS=256", "PR A", "PR D") == ["1100000000", "16896"]
    assert say(device, "MS=1", "PR D") == ["66"]


@pytest.mark.parametrize(
    "line", ["OE Q9", "OE=99", "TP=5,Q9", "TI=1,99", "TC=Q9", "TR=5,Q9", "TT=5,Q9", "TM=99", "TA=4,Q9"]
)
def test_a_place_that_is_only_named_and_is_not_there_does_not_end_the_program(line):
    device = drive("PG 1", "LB G1", line, 'PR "on ",ER', "E", "PG", "EX G1")
    device.advance(1.0)
    assert printed(device) == f"on {42 if '99' in line else 30}\r\n"


@pytest.mark.parametrize(("line", "code"), [("BR Q9", 30), ("CL 99", 42)])
def test_a_place_that_is_gone_to_and_is_not_there_ends_it(line, code):
    device = drive("PG 1", "LB G1", line, 'PR "on"', "E", "PG", "EX G1")
    device.advance(1.0)
    assert printed(device) == "" and say(device, "PR ER") == [str(code)]


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


@pytest.mark.parametrize(("personality", "found"), [("LMDCM", "0, 12"), ("LMM", "?37")])
def test_the_auxiliary_supply_is_read_where_there_is_one(personality, found):
    device = drive(personality=personality)
    assert say(device, "PR VT,1", "PR VT,3") == [found, "?21"]


def test_the_step_angle_prints_as_the_manual_shows_it():
    device = drive(personality="LMM")
    assert say(device, "PR SA", "SA=0.9", "PR SA", "SA=2", "PR SA") == ["1.800000", "0.900000", "2.000000"]
    assert "SA = 2.000000" in device.execute("PR AL", 0.0).lines


def test_every_motion_that_a_line_begins_is_counted():
    device = drive("NE=1", "MR 500")
    assert say(device, 1.0, "500", 1.0, "SC 1", 3.0, "HF 1", 100.0, "SL 500", "SL 0", 1.0, "0") == []
    assert device.moves == 5


def party(*names, **settings):
    """A line with drives in party mode, which has been activated."""
    devices = [
        MCodeDevice(DriveSpec(name=name, party=True, set={"EM": 1, **settings}), World(WorldSpec())) for name in names
    ]
    for device in devices:
        device.prints()
    wire = Wire([MCodePort(device) for device in devices])
    wire.receive(b"\n", 0.0)
    assert wire.advance(0.0) == b""
    return wire, devices


def send(wire, data):
    """What is heard on the line when bytes have been written to it."""
    wire.receive(data, 0.0)
    return wire.advance(0.0)


def test_several_commands_with_cr_between_them_are_carried_out_at_one_lf():
    wire, (device,) = party("1")
    assert send(wire, b"1VI 1\r1VM 2\r1A 3000\r1D=A\r1PR D\r1MA 4") == b""
    assert device.execute("PR VI", 0.0).lines == ("1000",)
    assert send(wire, b"\n") == b"\r\n\r\n\r\n\r\n\r\n3000\r\n\r\n"
    device.advance(10.0)
    assert [device.execute(f"PR {word}", 10.0).lines[0] for word in ("VI", "VM", "P")] == ["1", "2", "4"]


def test_each_of_several_commands_goes_to_the_drive_that_it_names():
    wire, (a, b) = party("a", "b", EM=2)
    assert send(wire, b"aR1=1\rbR1=2\r*R2=3\raR3=4\raPR R3\n") == b"4\r\n"
    found = [[each.execute(f"PR R{n}", 0.0).lines[0] for n in (1, 2, 3)] for each in (a, b)]
    assert found == [["1", "3", "4"], ["2", "3", "0"]]


def test_a_cr_before_the_lf_does_no_harm_and_executes_nothing():
    wire, _ = party("a", EM=0)
    assert [send(wire, each) for each in (b"aPR P\r", b"\n", b"a\r\n", b"\r\n", b"aPR P\n")] == [
        b"aPR P", b"\r\n0\r\n>", b"a\r\n>", b"", b"aPR P\r\n0\r\n>",
    ]  # fmt: skip


def test_each_of_several_commands_has_its_own_checksum_and_its_own_64_characters():
    wire, (device,) = party("a", CK=1)
    good = [text + bytes([-sum(text) & 0x7F | 0x80]) for text in (b"aR1=5", b"aR2=" + b"0" * 58 + b"6")]
    assert send(wire, b"\r".join((*good, b"aR1=7\xff")) + b"\n") == b"\x06\x06\x15"
    assert [device.execute(f"PR R{n}", 0.0).lines[0] for n in (1, 2)] == ["5", "6"]


def test_escape_drops_commands_that_wait_for_their_lf():
    wire, (device,) = party("a")
    assert send(wire, b"aR1=5\r\x1b\n") == b"\r\n"
    assert device.execute("PR R1", 0.0).lines == ("0",)


@pytest.mark.parametrize(
    ("lines", "expression", "found"),
    [
        (["TP=51200,K1"], "TP", "51200"), (["TT=500,1"], "TT/5", "100"), (["TI=3,K1"], "TI", "3"),
        (["TR=-8,K1"], "TR", "-8"), (["TA=4,K1"], "TA", "4"), ([], "TP", "0"),
    ],
)  # fmt: skip
def test_a_trip_is_computed_with_as_the_first_number_of_its_set_up(lines, expression, found):
    assert say(drive(*SUBROUTINE, *lines), f"R1={expression}", "PR R1") == [found]


def test_set_ups_of_several_lines_are_no_numbers():
    device = drive("R1=7")
    assert say(device, "R1=LS", "R1=OS", "PR R1") == ["?35", "?35", "7"]


@pytest.mark.parametrize(("lines", "line"), [([], "VA 1Q"), ([], "VA Q1 5"), (["PG 1"], "LB 2A")])
def test_what_is_no_name_is_illegal_data(lines, line):
    device = drive(*lines)
    assert device.execute(line, 0.0).refused
    assert device.memory.values["ER"] == 24


HOMES = ("IS=1,1,0", "VI=20000", "PG 1", "LB G1", "HM 1", "H", 'PR "home"', "E", "PG", "EX G1")


@pytest.mark.parametrize("after", [0.2, 0.95, 1.2, 1.5, 2.0])
def test_a_paused_homing_is_a_homing_again(after):
    unpaused = drive(*HOMES, home=-300000)
    unpaused.advance(100.0)
    device = drive(*HOMES, home=-300000)
    device.advance(after)
    assert say(device, "PS", 2.0, "PR MV", "PR BY") == ["0", "1"]
    assert say(device, "RS", "MR 5", 100.0) == ["?85"]
    assert device.position(device.now) == unpaused.position(100.0)
    assert printed(device) == "home\r\n"


def test_a_pause_that_ends_on_the_home_switch_goes_on_by_creeping_off_it():
    device = drive(*HOMES, home=-100000)
    device.advance(0.4)
    assert say(device, "PS", 2.0, "PR I1", "RS", 0.5, "PR V", 200.0, "PR MV") == ["1", "20000", "0"]


def test_a_pause_of_a_homing_that_a_limit_has_turned_round_keeps_its_way():
    device = drive("IS=2,3,0", *HOMES, limit_minus=-100000, home=250000)
    device.advance(1.4)
    assert device.velocity(1.4) > 0
    assert say(device, "PS", 2.0, "RS", 0.5) == []
    assert device.velocity(device.now) > 0


def test_no_move_begins_during_the_configuration_test():
    device = drive("SC 1")
    assert say(device, 0.1, "MR 5", "SL 5", "MA 0", "HM 1", 5.0, "PR P", "MR 5") == [
        "?88",
        "?88",
        "?88",
        "?80",
        "25600",
    ]


def test_a_paused_move_sends_the_name_where_it_ends_and_not_where_it_pauses():
    device = drive("PG 1", "LB G1", "MA 100000,1", "H", 'PR "x"', "E", "PG", "EX G1")
    device.advance(0.2)
    assert say(device, "PS", 1.0) == [] and printed(device) == ""
    assert say(device, "RS", 3.0, "PR P") == ["100000"]
    assert printed(device) == "!\r\nx\r\n"


@pytest.mark.parametrize("after", [0.1, 0.2, 0.4])
def test_a_paused_move_that_runs_on_sends_the_name_once_where_it_passes_its_target(after):
    device = drive("PG 1", "LB G1", "MA 51200,1,1", "H 9000", "E", "PG", "EX G1")
    device.advance(after)
    say(device, "PS", 2.0)
    passed = device.position(device.now) >= 51200
    assert (printed(device) == "!\r\n") == passed
    assert say(device, "RS", "PR MP") == [str(1 - passed)]
    assert say(device, 3.0, "PR MP", "PR V") == ["0", "768000"]
    assert printed(device) == ("" if passed else "!\r\n")


def test_a_rotor_that_was_locked_in_torque_mode_can_be_moved_afterwards():
    device = drive("LT=100", "TS=51200", "AS=3", locked=((0.3, 1.0),))
    device.advance(2.0)
    assert say(device, "PR LR", "PR ER", "AS=0", 1.0, "MR 500", 1.0, "PR MV", "PR LR") == ["1", "104", "0", "1"]
    assert say(device, "CF", "PR LR") == ["0"]


def test_a_rotor_that_was_locked_otherwise_keeps_the_bridges_off_until_it_is_cleared():
    device = drive("LT=100", "AS=1", locked=((0.3, 1.0),))
    assert say(device, 0.1, "MR 200000", 1.0, "PR LR", "PR ER", "MR 5", "AS=0", "MR 5") == ["1", "104", "?94", "?94"]
    assert say(device, "CF", "MR 5") == []
