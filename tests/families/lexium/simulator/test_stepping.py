"""Programs watched: trace, single step, break points, Enter and Esc; what a new start clears."""

from multidrop.families.lexium.simulator.device import MCodeDevice
from multidrop.simulator.cell.spec import DriveSpec, WorldSpec
from multidrop.simulator.world import World

LOOP = "PG 1\nLB G1\nR1=0\nLB G2\nIC R1\nBR G2,R1<5\nPR R1\nE\nPG\n"


def drive(*lines):
    device = MCodeDevice(DriveSpec(program=LOOP), World(WorldSpec()))
    device.prints()
    for line in lines:
        assert not device.execute(line, 0.0).refused, line
    return device


def printed(device, until):
    device.advance(until)
    return [line for _, text in device.prints() for line in text.split("\r\n") if line]


def addresses():
    """The program's lines as trace shows them."""
    return [row for row in drive().execute("L", 0.0).lines if "LB" not in row]


def test_a_traced_program_breaks_when_it_has_come_to_a_place_often_enough():
    rows = addresses()
    device = drive("BP G2,3", "EX G1,1")
    assert printed(device, 1.0) == [rows[0], *rows[1:3] * 2]
    assert device.thread.stepping and device.execute("PR R1", 1.0).lines == ("2",)
    device.step(" ", 1.0)
    assert printed(device, 2.0) == [rows[1]] and device.thread.stepping
    device.step("\r", 2.0)
    assert printed(device, 3.0) == ["5"] and not device.running


def test_a_stepped_program_runs_silently_up_to_its_break_point():
    rows = addresses()
    device = drive("BP G2,2", "EX G1,2")
    assert printed(device, 1.0) == [] and device.thread.stepping
    assert device.execute("PR R1", 1.0).lines == ("1",)
    device.step("\r", 1.0)
    assert printed(device, 2.0) == [] and device.execute("PR R1", 2.0).lines == ("3",)
    device.step(" ", 2.0)
    device.step(" ", 2.0)
    assert printed(device, 3.0) == rows[1:3]


def test_without_trace_or_step_a_break_point_does_nothing():
    device = drive("BP G2,1", "EX G1")
    assert printed(device, 1.0) == ["5"]


def test_bp_alone_breaks_a_running_program_where_it_is():
    device = MCodeDevice(DriveSpec(program="PG 1\nLB G1\nIC R1\nBR G1\nPG", instruction_us=1000), World(WorldSpec()))
    assert device.execute("BP", 0.0).refused and device.execute("PR ER", 0.0).lines == ("40",)
    device.execute("EX G1", 0.0)
    assert not device.execute("BP", 0.5).refused
    before = device.execute("PR R1", 0.6).lines
    assert device.thread.stepping and device.execute("PR R1", 5.0).lines == before


def test_bp_0_takes_it_away_and_wrong_ones_are_refused():
    device = drive("BP G2,1", "BP=0", "EX G1,1")
    assert len(printed(device, 1.0)) == 1 + 2 * 5 + 1 + 1 + 1
    for line, code in (("BP ZZ,1", "30"), ("BP 9999", "42"), ("BP G2,0", "21"), ("BP MV,1", "34")):
        assert device.execute(line, 1.0).refused and device.execute("PR ER", 1.0).lines == (code,)


def test_escape_ends_a_stepped_program():
    device = drive("EX G1,2")
    device.step(" ", 0.1)
    device.escape(0.2)
    assert not device.running and not device.thread.stepping


def test_an_end_ends_a_paused_program_at_once():
    device = drive("SL 100000", "EX G1,2", "PS", "E")
    assert not device.running


def test_a_program_that_was_stopped_at_an_input_can_be_started_again():
    program = "PG 1\nLB G1\nIV R1\nLB G2\nBR G2,IF=1\nPR R1\nE\nPG"
    device = MCodeDevice(DriveSpec(program=program), World(WorldSpec()))
    device.prints()
    device.execute("EX G1", 0.0)
    device.advance(0.1)
    device.escape(0.2)
    device.execute("EX G1", 0.3)
    assert not device.execute("7", 0.5).refused
    assert printed(device, 1.0) == ["7"]
