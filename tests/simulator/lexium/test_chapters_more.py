"""Chapters 7 and 10 of the MCode reference: figures of motion, sessions on a party line, error codes by product."""

import pytest

from dialects.mcode.manual.errors import TEXTS
from dialects.mcode.manual.table import MNEMONICS
from simulator.cells import read
from simulator.floor import Floor
from tests.support.moving import at, drive, rotor, say

# 7.3: factors that have a part in motion.


def test_seven_and_a_half_inches_take_5_766_s():
    device = drive("MR 3840000")
    # Up to 768000 steps/s in 0.767 s and (768000 + 1000) / 2 * 0.767 = 294911.5 steps.
    assert at(device, 0.7669, "VC") == ["1"] and at(device, 0.7671, "VC", "V") == ["0", "768000"]
    assert at(device, 0.767, "P") == ["294988"]  # which is 0.1 ms later
    assert device.axis.profile.end == pytest.approx(0.767 + (3840000 - 2 * 294911.5) / 768000 + 0.767)
    assert device.axis.profile.end == pytest.approx(5.766, abs=1e-4)


def test_half_the_microsteps_make_the_same_number_of_steps_twice_as_far():
    device = drive("MS=128", "MR 51200")
    device.advance(5.0)
    assert device.axis.physical(5.0) == 2 * 51200


@pytest.mark.parametrize(("steps", "turns"), [(96000, 1.875), (41713, 0.8147)])
def test_rotary_moves_turn_as_far_as_is_worked_out(steps, turns):
    device = drive("VM=6827", f"MR {steps}")
    assert at(device, 2.0, "V") == ["6827"]  # 8 rpm
    device.advance(60.0)
    assert rotor(device) / 51200 == pytest.approx(turns, abs=1e-4)


def test_with_the_encoder_on_all_is_in_counts_of_4000_to_a_turn():
    device = drive("EE=1")
    assert say(device, "PR VM", "PR VI", "PR A", "PR D", "PR MS") == ["60000", "78", "78125", "78125", "256"]
    assert say(device, "MS=128", "MR 14000") == ["?21"]
    device.advance(5.0)
    assert rotor(device) == 3.5 * 51200
    device = drive("EE=1", "SL 14000")
    device.advance(3.0)
    here = rotor(device)
    device.advance(4.0)
    assert (rotor(device) - here) / 51200 * 60 == pytest.approx(210, abs=0.01)


@pytest.mark.parametrize(("mode", "made"), [(0, 2030), (1, 2048)])
def test_a_bind_is_a_stall_when_sf_more_counts_were_made(mode, made):
    device = drive("EE=1", "SF=30", f"SM={mode}", "MT=1000", "MR 2048", stall_at=2000 * 12.8)
    assert at(device, 1.0, "C1", "C2", "ST", "ER", "MV") == [str(int(made * 12.8)), "2000", "1", "86", "0"]


@pytest.mark.parametrize(("mode", "push", "end"), [(0, 10, "2048"), (0, 40, "2088"), (1, 10, "2048"), (1, 40, "2048")])
def test_position_maintenance_goes_back_unless_it_was_a_stall_that_stops(mode, push, end):
    device = drive("EE=1", "DB=2", "PM=1", f"SM={mode}", "SF=15", "MT=50", "MR 2048")
    device.advance(2.0)
    device.world.push(push * 12.8, 2.0)
    assert at(device, 2.01, "C2") == [str(2048 + push)]
    assert at(device, 9.0, "C2", "ST") == [end, str(int(push > 15))]


# 7.1: talk on a party line, as from a terminal.


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
    assert [device.party for device in terminal.devices] == [False, True, True]
    assert terminal.type("*PY=0\n") == "*PY=0\n"  # shown by the one that hears lines for all
    assert [device.party for device in terminal.devices] == [False, False, False]


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


# 10: error codes.

PROGRAM = "PG 1\nLB G1\nIC R1\nBR G1\nLB K1\nRT\nE\nPG"
STATES = {"rest": (), "moving": ("MR 1000000",), "running": ("EX G1",), "disabled": ("DE=0",), "counting": ("EE=1",)}


@pytest.mark.wide
@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("personality", ["LMM", "LMDOM", "LMDCM"])
def test_a_product_has_no_errors_but_those_of_its_list(personality, state):
    known = TEXTS["LMM" if personality == "LMM" else "LMD"]
    for word in MNEMONICS:
        if word == "FD":
            continue
        device = drive(personality=personality, program=PROGRAM)
        say(device, *STATES[state])
        for arguments in ("", "=1", "=2", "=99999999999", " K1", " 1,2,3", " 5,K1", ' "a"'):
            device.execute(word + arguments, 0.01)
            device.programming = None
            assert device.memory.values["ER"] in known, word + arguments
