"""Several drives on one line: one that commands another, keys by name; the time an Ethernet drive takes to boot."""

import pytest

from simulator.cell.spec import DriveSpec, WorldSpec
from simulator.lexium.device import MCodeDevice
from simulator.lexium.ports.mcode import MCodePort
from simulator.lexium.power import ETHERNET_BOOT
from simulator.wire.wire import Wire
from simulator.world import World


def device(name, program="", **settings):
    spec = DriveSpec(name=name, party=True, program=program, set={"EM": 1, **settings})
    made = MCodeDevice(spec, World(WorldSpec()))
    made.prints()
    return made


def line(*devices, baud=0):
    return Wire([MCodePort(each) for each in devices], baud)


def talk(wire, data, now, until):
    """Write, then go from deadline to deadline; all that is heard."""
    wire.receive(data, now)
    heard = wire.advance(now)
    while (due := wire.deadline) is not None and due <= until:
        heard += wire.advance(due)
    return heard + wire.advance(until)


MASTER = 'PG 1\nLB G1\nPR "bMR 1000"\nH 200\nPR "bPR P"\nE\nPG'


@pytest.mark.parametrize("baud", [0, 9600])
def test_a_program_that_prints_a_drives_name_commands_it(baud):
    a, b, c = device("a", MASTER), device("b"), device("c")
    wire = line(a, b, c, baud=baud)
    heard = talk(wire, b"\naEX G1\n", 0.0, 2.0)
    assert (b.position(2.0), c.position(2.0), a.position(2.0)) == (1000, 0, 0)
    assert heard == b"\r\nbMR 1000\r\n\r\nbPR P\r\n\r\n1000\r\n"
    assert not any(each.error_flag for each in (a, b, c))


def test_all_and_the_queued_ones_can_be_commanded_too():
    program = 'PG 1\nLB G1\nPR "*R1=5"\nPR "^R2=6"\nE\nPG'
    a, b, c = device("a", program), device("b", QD=1), device("c")
    talk(line(a, b, c), b"\naEX G1\n", 0.0, 1.0)
    found = [[each.execute(f"PR {word}", 1.0).lines[0] for word in ("R1", "R2")] for each in (a, b, c)]
    assert found == [["0", "0"], ["5", "6"], ["5", "0"]]


def test_a_command_may_be_printed_in_pieces_and_with_a_checksum():
    program = 'PG 1\nLB G1\nPR "bR1="; \nPR R2\nE\nPG'
    a, b = device("a", program, CK=1), device("b", CK=1)
    talk(
        line(a, b),
        b"\naR2=77" + bytes([checksum(b"aR2=77")]) + b"\naEX G1" + bytes([checksum(b"aEX G1")]) + b"\n",
        0,
        1,
    )
    assert b.execute("PR R1", 1.0).lines == ("77",)


def checksum(text):
    return (-sum(text)) & 0x7F | 0x80


def test_answers_are_not_heard_by_other_drives():
    """Else the drive called 7 would take the answer 7186 for a command."""
    a, b = device("a"), device("7")
    wire = line(a, b)
    assert talk(wire, b"\naP=7186\naPR P\n", 0.0, 1.0) == b"\r\n\r\n7186\r\n"
    assert not b.error_flag


def test_a_print_while_the_host_speaks_is_not_heard_by_the_drives():
    program = 'PG 1\nLB G1\nH 500\nPR "bR1=1"\nE\nPG'
    a, b = device("a", program), device("b")
    wire = line(a, b)
    talk(wire, b"\naEX G1\nbR2", 0.0, 0.6)
    talk(wire, b"=4\n", 0.6, 1.0)
    assert [b.execute(f"PR {word}", 1.0).lines[0] for word in ("R1", "R2")] == ["0", "4"]


def test_two_drives_can_throw_a_ball_to_each_other():
    throw = 'PG 1\nLB G1\nIC R1\nH 10\nPR "{}EX G1"\nE\nPG'
    a, b = device("a", throw.format("b"), EM=2), device("b", throw.format("a"), EM=2)
    talk(line(a, b), b"\naEX G1\n", 0.0, 1.0)
    counts = [int(each.execute("PR R1", 1.0).lines[0]) for each in (a, b)]
    assert 45 <= counts[0] <= 50 and counts[0] - counts[1] in (0, 1)


def test_a_drive_that_prints_ctrl_c_resets_the_others_and_not_itself():
    a, b = device("a", 'PG 1\nLB G1\nPR "\\c"\nE\nPG'), device("b")
    wire = line(a, b)
    talk(wire, b"\naR1=3\nbR1=4\naEX G1\n", 0.0, 1.0)
    assert [each.execute("PR R1", 1.0).lines[0] for each in (a, b)] == ["3", "0"]


@pytest.mark.parametrize(("mode", "key", "stops"), [
    (0, b"\x05", "ab"), (0, b"\x1b", ""), (1, b"\x1b", "ab"), (1, b"\x05", ""),
    (2, b"b\x05", "b"), (2, b"\x05", ""), (2, b"b\x1b", ""), (3, b"b\x1b", "b"), (3, b"\x1b", ""), (3, b"a\x1b", "a"),
])  # fmt: skip
def test_the_escape_modes_stop_whom_they_mean(mode, key, stops):
    a, b = device("a", ES=mode), device("b", ES=mode)
    wire = line(a, b)
    talk(wire, b"\n*SL 1000\n", 0.0, 0.5)
    talk(wire, key, 0.5, 0.6)
    assert "".join(each.name for each in (a, b) if not each.moving(0.6)) == stops


@pytest.mark.parametrize(
    ("mode", "key", "resets"), [(0, b"b\x03", ""), (1, b"\x03", "ab"), (2, b"b\x03", "b"), (2, b"\x03", "")]
)
def test_the_reset_modes_reset_whom_they_mean(mode, key, resets):
    a, b = device("a", CE=mode), device("b", CE=mode)
    wire = line(a, b)
    talk(wire, b"\n*R1=9\n", 0.0, 0.5)
    talk(wire, key, 0.5, 0.6)
    assert "".join(each.name for each in (a, b) if each.execute("PR R1", 0.6).lines == ("0",)) == resets


def test_a_baud_rate_acts_after_it_was_saved_and_a_reset_only():
    drive = MCodeDevice(DriveSpec(), World(WorldSpec()))
    drive.execute("BD=11", 0.0)
    drive.reset(0.1)
    assert drive.baud == 9600 and drive.execute("PR BD", 0.1).lines == ("96",)
    drive.execute("BD=11", 0.2)
    drive.execute("S", 0.2)
    assert drive.baud == 9600
    drive.reset(0.3)
    assert drive.baud == 115200


def test_an_ethernet_drive_is_silent_while_it_boots():
    drive = MCodeDevice(DriveSpec(personality="LMDCE", program='PG 1\nLB SU\nPR "up"\nE\nPG'), World(WorldSpec()))
    port = MCodePort(drive, serial=False)
    drive.prints()
    port.receive(b"SL 1000\r\x03PR P\r", 1.0)
    port.advance(1.0)
    assert drive.deadline == 1.0 + ETHERNET_BOOT and not drive.moving(2.0)
    port.receive(b"PR P\r", 1.0 + ETHERNET_BOOT - 0.1)
    assert port.advance(1.0 + ETHERNET_BOOT - 0.1) == b""
    assert b"USA\r\nup\r\n" in port.advance(30.0)
    port.receive(b"PR P\r", 31.0)
    assert port.advance(31.0).endswith(b"\r\n0\r\n>")
    drive.power(False, 40.0)
    drive.power(True, 41.0)
    assert not drive.powered and drive.deadline == 41.0 + ETHERNET_BOOT
    drive.power(False, 42.0)
    assert drive.deadline is None
