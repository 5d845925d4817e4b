"""The module's port: the frames of the manuals byte for byte, framing by count, addresses, pauses."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.families.tmcl.host import codec
from multidrop.families.tmcl.manual.commands import Command, Global, TmclCall
from multidrop.simulator.cells import read
from tests.support.tmcl_module import Module

WORKED = [
    ("01 01 00 00 00 00 03 E8 ED", "02 01 64 01 00 00 03 E8 53"),
    ("01 03 00 00 00 00 00 00 04", "02 01 64 03 00 00 00 00 6A"),
    ("01 04 00 00 00 00 C8 00 CD", "02 01 64 04 00 00 C8 00 33"),
    ("01 06 FA 00 00 00 00 00 01", "02 01 03 06 00 00 00 00 0C"),
    ("01 09 41 04 00 00 00 07 56", "02 01 04 09 00 00 00 07 17"),
    ("01 05 8C 00 00 00 00 09 9B", "02 01 04 05 00 00 00 09 15"),
    ("01 0A 42 00 00 00 00 00 4D", "02 01 64 0A 00 00 00 01 72"),
    ("01 0D 02 00 00 00 00 00 10", "02 01 64 0D 00 00 00 00 74"),
]


@pytest.mark.parametrize(("request_", "reply"), WORKED)
def test_the_frames_of_the_manuals(request_, reply):
    assert Module().send(bytes.fromhex(request_)) == bytes.fromhex(reply)


@pytest.mark.parametrize(("request_", "reply"), WORKED)
def test_the_same_byte_by_byte(request_, reply):
    module = Module()
    assert b"".join(module.send(bytes([byte])) for byte in bytes.fromhex(request_)) == bytes.fromhex(reply)


def test_a_negative_value_is_signed():
    module = Module()
    assert module.ask("SAP 1, 0, -1000") == -1000
    module = Module(settings={"4": 0})
    module.ask("SAP 1, 0, -1000")
    assert module.send(bytes.fromhex("01 06 01 00 00 00 00 00 08")) == bytes.fromhex("02 01 64 06 FF FF FC 18 7F")


def test_another_address_gets_no_reply():
    assert Module(address=3).send(codec.frame_of(1, TmclCall(Command.GAP, 1))) == b""


@pytest.mark.parametrize("address", [0, 1, 9, 255])
def test_a_module_with_any_address_replies_to_all_with_its_own(address):
    module = Module(address=7, any_address=True)
    reply = codec.parse_reply(module.send(codec.frame_of(address, TmclCall(Command.GGP, Global.ADDRESS))))
    assert reply is not None and (reply.module, reply.status, reply.value) == (7, 100, 7)


def test_a_wrong_checksum_is_refused_and_changes_nothing():
    module = Module()
    frame = codec.frame_of(1, TmclCall(Command.ROR, value=1000))
    reply = codec.parse_reply(module.send(frame[:-1] + b"\x00"))
    assert reply is not None and (reply.status, reply.command, reply.value) == (1, Command.ROR, 0)
    assert module.ask("GAP 2, 0") == 0


def test_a_lost_byte_swallows_the_next_request_and_a_pause_helps():
    module = Module()
    module.send(codec.frame_of(1, TmclCall(Command.ROR, value=1000))[1:])
    stop = codec.frame_of(1, TmclCall(Command.MST))
    swallowed = codec.parse_reply(module.send(stop).ljust(9, b"\0"))
    assert swallowed is None or swallowed.status == 1 or swallowed.command != Command.MST
    module.wait(1.0)
    reply = codec.parse_reply(module.send(stop))
    assert reply is not None and (reply.status, reply.command) == (100, Command.MST)


def test_the_pause_before_a_reply_is_kept():
    module = Module(settings={"G75": 20})
    assert module.send(codec.frame_of(1, TmclCall(Command.GAP, 1))) == b""
    assert len(module.wait(0.03)) == 9


def test_the_version_is_text_without_a_checksum_or_a_number():
    module = Module()
    text = module.send(codec.frame_of(1, TmclCall(Command.VERSION)))
    assert text[0] == 2 and text[1:].decode("ascii")[4] == "V"
    assert module.ask("136 1, 0, 0") >> 16 == int(text[1:5])


def test_a_new_address_counts_from_the_next_message():
    module = Module()
    assert module.reply("SGP 66, 0, 7").module == 1
    assert module.send(codec.frame_of(1, TmclCall(Command.GAP, 1))) == b""
    assert module.reply("GGP 66, 0", address=7).value == 7


def test_factory_settings_give_no_reply_and_bring_back_address_1():
    module = Module(address=9)
    assert module.send(codec.frame_of(9, TmclCall(Command.FACTORY, value=1234))) == b""
    assert module.ask("GGP 66, 0") == 1


def test_without_power_it_is_deaf_and_dumb():
    module = Module()
    module.device.power(False, 0.0)
    assert module.send(codec.frame_of(1, TmclCall(Command.GAP, 1))) == b""


@given(st.lists(st.binary(min_size=1, max_size=20), max_size=10))
def test_any_bytes_leave_a_module_that_replies_after_a_pause(pieces):
    module = Module()
    for piece in pieces:
        module.send(piece)
    module.wait(1.0)
    address = module.device[Global.ADDRESS]
    reply = codec.parse_reply(module.send(codec.frame_of(address, TmclCall(Command.GGP, 66))))
    assert reply is not None and reply.value == address


@given(st.integers(0, 255), st.integers(0, 255), st.integers(0, 255), st.integers(-(2**31), 2**31 - 1))
def test_any_command_gets_one_frame_or_none(command, kind, motor, value):
    module = Module()
    out = module.send(codec.frame_of(1, TmclCall(command, kind, motor, value)))
    assert len(out) in (0, 9)
    assert out or command == Command.FACTORY


# The table of a TMCL module in a cell file: wrong keys get one line that names them.


CELL = '[[bus]]\nname = "slide"\n[[bus.drive]]\npersonality = "TMCM"\n'


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("set = { 04 = 5 }", 'set: "04" is not a parameter'),
        ('set = { 4 = 5, "04" = 6 }', 'set: "04" is not a parameter'),
        ("set = { G075 = 5 }", 'set: "G075" is not a parameter'),
        ("set = { 3 = 1 }", 'set: "3" is not a parameter'),
        ("set = { G66 = 3 }", 'set: "G66" is not a parameter'),
        ("set = { 4 = -1 }", 'set: "4" cannot be -1; valid: 0 to 8388607'),
        ("set = { G75 = 5, g75 = 6 }", 'set: "g75" is given twice'),
        ('name = "01"', 'name cannot be "01"; valid: the address of a module, 1 to 255'),
        ('name = "256"', 'name cannot be "256"; valid: the address of a module, 1 to 255'),
        ("party = true", "party is for MCode drives"),
        ("world = { inputs = [[0, 3, 1]] }", "inputs"),
        ("world.1 = { home = 0 }", 'unknown key "1"'),
        ("set = { 4_1 = 5 }", 'set: "4_1" is not a parameter'),
        ("set = { 193 = 9 }", 'set: "193" cannot be 9; valid: 1 to 8, 65 to 68, 133 to 136'),
        ("variables = { 256 = 1 }", '"256" is not the name of a variable'),
        ("any_address = 1", "any_address must be true or false"),
    ],
)
def test_a_wrong_key_is_named(line, message):
    with pytest.raises(Diagnostic) as caught:
        read(CELL + line + "\n", "cell.toml")
    text = str(caught.value)
    assert message in text and text.startswith("cell.toml") and "\n" not in text


def test_only_a_module_can_have_any_address():
    with pytest.raises(Diagnostic, match='unknown key "any_address"'):
        read('[[bus]]\nname = "p"\n[[bus.drive]]\npersonality = "PMX"\nany_address = true\n', "cell.toml")


def test_each_motor_has_surroundings_and_settings_of_its_own():
    cell = read(
        CELL.replace("TMCM", "TMCM-3110")
        + "set = { 4 = 7, 4_2 = 9, G75 = 5 }\nvariables = { 3 = 33 }\nidentity = { position = [1, 2, 3] }\n"
        + "[bus.drive.world]\nlimit_plus = 5\n[bus.drive.world.2]\nhome = [1, 2]\n",
        "cell.toml",
    )
    (spec,) = cell.buses[0].drives
    assert (spec.world.limit_plus, spec.further[0].home, spec.further[1].home) == (5, None, (1, 2))
    assert (spec.set["4_2"], spec.variables["3"], spec.identity.counters["position"]) == (9, 33, (1, 2, 3))
