"""Several drives on one line: one that commands another, keys by name; the time an Ethernet drive takes to boot."""

import pytest

from multidrop.families.lexium.simulator.device import MCodeDevice
from multidrop.families.lexium.simulator.ports.mcode import MCodePort
from multidrop.families.lexium.simulator.power import ETHERNET_BOOT
from multidrop.simulator.cell.spec import DriveSpec, WorldSpec
from multidrop.simulator.cells import read
from multidrop.simulator.floor import Floor
from multidrop.simulator.wire import Wire
from multidrop.simulator.world import World


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
    assert not any(each.memory.error_flag for each in (a, b, c))


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
    assert not b.memory.error_flag


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
    assert "".join(each.memory.name for each in (a, b) if not each.moving(0.6)) == stops


@pytest.mark.parametrize(
    ("mode", "key", "resets"), [(0, b"b\x03", ""), (1, b"\x03", "ab"), (2, b"b\x03", "b"), (2, b"\x03", "")]
)
def test_the_reset_modes_reset_whom_they_mean(mode, key, resets):
    a, b = device("a", CE=mode), device("b", CE=mode)
    wire = line(a, b)
    talk(wire, b"\n*R1=9\n", 0.0, 0.5)
    talk(wire, key, 0.5, 0.6)
    assert "".join(each.memory.name for each in (a, b) if each.execute("PR R1", 0.6).lines == ("0",)) == resets


def test_a_baud_rate_acts_after_it_was_saved_and_a_reset_only():
    drive = MCodeDevice(DriveSpec(), World(WorldSpec()))
    drive.execute("BD=11", 0.0)
    drive.reset(0.1)
    assert drive.core.printer.baud == 9600 and drive.execute("PR BD", 0.1).lines == ("96",)
    drive.execute("BD=11", 0.2)
    drive.execute("S", 0.2)
    assert drive.core.printer.baud == 9600
    drive.reset(0.3)
    assert drive.core.printer.baud == 115200


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


@pytest.mark.parametrize(
    ("personality", "heard"),
    [("LMDCM", b"\r\n0\r\n"), *((unit, b"\r\n\r\n200\r\n") for unit in ("MDI", "MDIE", "MDIX"))],
)
@pytest.mark.parametrize("baud", [0, 9600])
def test_the_first_line_after_power_up_is_carried_out_by_an_mdrive_plus(personality, heard, baud):
    table = f'[[bus.drive]]\npersonality = "{personality}"\nparty = true\nset = {{ EM = 1 }}\n'
    drives = "".join(f'{table}name = "{name}"\n' for name in "ab")
    floor = Floor(read(f'[[bus]]\nname = "line"\nbaud = {baud}\n{drives}', "line.toml"))
    a, b = (placed.device for placed in floor.drives)
    assert talk(floor.wires["line"], b"aP=200\naPR P\n", 0.0, 1.0) == heard
    floor.command("/sim power a off", 1.0)
    floor.command("/sim power a on", 2.0)
    talk(floor.wires["line"], b"aMR 300\n", 2.0, 4.0)
    assert (a.position(4.0), b.position(4.0)) == (0 if personality == "LMDCM" else 300, 0)


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


class Terminal:
    """Somebody at a terminal on a wire with drives."""

    def __init__(self, names, party=True):
        table = f'[[bus.drive]]\npersonality = "LMDCM"\nparty = {str(party).lower()}\n'
        drives = "".join(f'{table}name = "{name}"\n' for name in names)
        floor = Floor(read(f'[[bus]]\nname = "line"\n{drives}', "line.toml"))
        self.wire, self.t = floor.wires["line"], 0.0
        self.devices = [placed.device for placed in floor.drives]

    def type(self, text, wait=0.5):
        """Press keys one by one; what is shown by some time after the last one."""
        shown = b""
        for byte in text.encode("latin-1"):
            self.t += 0.01
            self.wire.receive(bytes([byte]), self.t)
            shown += self.wire.advance(self.t)
        until = self.t + wait
        while (due := self.wire.deadline) is not None and due <= until:
            self.t = max(self.t, due)
            shown += self.wire.advance(self.t)
        self.t = until
        return (shown + self.wire.advance(until)).decode("latin-1")


def test_three_drives_are_moved_alone_and_together_and_taken_out_of_party_mode():
    terminal = Terminal("abc")
    assert terminal.type("\n") == ""
    assert terminal.type("aMR 10000\n") == "aMR 10000\r\n>"
    assert terminal.type("aPR p\n") == "aPR p\r\n10000\r\n>"
    assert terminal.type("bMR 10000\n") == "bMR 10000\r\n>"
    assert terminal.type("*MR 10000\n") == ""
    assert [terminal.type(f"{name}PR P\n").split()[2] for name in "abc"] == ["20000", "20000", "10000"]
    assert terminal.type("cVM200000\n") == "cVM200000\r\n>"
    assert terminal.type("cPR VM\n") == "cPR VM\r\n200000\r\n>"
    assert terminal.type("aPY=0\n") == "aPY=0\r\n>"
    assert [device.memory.party for device in terminal.devices] == [False, True, True]
    assert terminal.type("*PY=0\n") == "*PY=0\n"  # shown by the one that hears lines for all
    assert [device.memory.party for device in terminal.devices] == [False, False, False]


def test_a_new_drive_is_put_into_party_mode_by_hand():
    terminal = Terminal("!", party=False)
    assert terminal.type("PY=1\r") == "PY=1\r\n>"
    assert terminal.type("!PR P\r") == ""
    assert terminal.type("\n") == ""
    assert terminal.type("!MR 512000\n", wait=2.0) == "!MR 512000\r\n>"
    assert terminal.type("!PR P\n") == "!PR P\r\n512000\r\n>"
    assert terminal.type('!DN="a"\n') == '!DN="a"\r\n>'
    assert terminal.type("!PR P\n") == ""
    assert terminal.type("aPR DN\n") == 'aPR DN\r\n"a"\r\n>'


def test_two_drives_with_one_name_do_the_same_and_garble_where_they_differ():
    terminal = Terminal("ab")
    terminal.type('\nbDN="a"\n')
    assert terminal.type("aMR 100\n") == "aMR 100\r\n>"
    assert terminal.type("aPR P\n") == "aPR P\r\n100\r\n>"
    terminal.devices[1].execute("P=4711", terminal.t)
    assert terminal.type("aPR P\n") != "aPR P\r\n100\r\n>"
    assert [device.position(terminal.t) for device in terminal.devices] == [100, 4711]
