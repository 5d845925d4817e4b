"""The calculator of checksums: the bytes of each family, worked examples of their manuals, and wrong inputs."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.features.checksums.calculator import forms, sealed, shown
from tests.support.cell_session import CellSession, bus, drive, party, pmx

WORKED = [
    ("mcode", "MR 51200", "", "4D 52 20 35 31 32 30 30 C9 0D"),
    ("mcode", "CK=0", "", "43 4B 3D 30 85 0D"),
    ("mcode", "FD", "*", "2A 46 44 CC 0A"),
    ("mcode", "MR 1", "", "4D 52 20 31 90 0D"),
    ("tmcl", "MVP ABS, 0, 51200", "", "01 04 00 00 00 00 C8 00 CD"),
    ("tmcl", "MVP REL, 0, -1000", "", "01 04 01 00 FF FF FC 18 18"),
    ("tmcl", "GAP 1, 0", "", "01 06 01 00 00 00 00 00 08"),
    ("tmcl", "GAP 1, 0", "3", "03 06 01 00 00 00 00 00 0A"),
    ("modbus-rtu", "01 03 00 00 00 0A", "", "01 03 00 00 00 0A C5 CD"),
    ("modbus-rtu", "0300 0000 0a", "1", "01 03 00 00 00 0A C5 CD"),
    ("modbus-ascii", "01 03 00 57 00 02", "", "3A 30 31 30 33 30 30 35 37 30 30 30 32 41 33 0D 0A"),
    ("pmx", "PX", "00", "40 30 30 50 58 0D"),
    ("pmx", "PX", "", "50 58 0D"),
]


@pytest.mark.parametrize(("form", "text", "address", "sent"), WORKED)
def test_the_bytes_of_a_line(form, text, address, sent):
    assert sealed(form, text, address).sent.hex(" ").upper() == sent


@pytest.mark.parametrize(("form", "text", "address", "sent"), WORKED)
def test_a_person_sees_the_bytes_the_checksum_and_how_it_is_formed(form, text, address, sent):
    rows = shown(form, text, address)
    frame = sealed(form, text, address)
    assert rows[0].endswith(f": checksum {frame.check.hex(' ').upper()}" if frame.check else ": no checksum")
    assert rows[1] == f"bytes:  {sent}" and rows[3].startswith("formed: ")


def test_what_is_formed_of_a_command_is_named_step_by_step():
    assert shown("mcode", "MR 1", "") == (
        "MCode with CK=1 or CK=2: checksum 90",
        "bytes:  4D 52 20 31 90 0D",
        "text:   MR 1<90><CR>",
        "formed: 4D + 52 + 20 + 31 = F0 hex; it covers the command, not the CR",
        "        modulo 128 (80 hex): 70 hex; subtracted from 80 hex: 10 hex",
        "        bit 7 set: 90 hex. It is one raw byte before the CR (CK=1 and CK=2)",
    )


WRONG = [
    ("nothing", "PR P", "", "no form nothing"),
    ("mcode", "", "", "not a command"),
    ("mcode", "MR ü", "", "printable ASCII"),
    ("tmcl", "MVP", "", "not a command of TMCL"),
    ("tmcl", "GAP 1, 0", "300", "no address 300; valid: 1 to 255"),
    ("modbus-rtu", "01 0", "", "two digits each"),
    ("modbus-rtu", "PR P", "", "two digits each"),
    ("modbus-rtu", "01", "", "a frame of 1 bytes"),
    ("modbus-ascii", "03 00", "999", "no unit 999"),
    ("pmx", "PX", "7", "no device number 7"),
]


@pytest.mark.parametrize(("form", "text", "address", "why"), WRONG)
def test_a_wrong_input_is_one_line(form, text, address, why):
    with pytest.raises(Diagnostic, match=why) as failure:
        shown(form, text, address)
    assert "\n" not in str(failure.value)


@given(
    st.sampled_from(["mcode", "tmcl", "modbus-rtu", "modbus-ascii", "pmx"]), st.text(max_size=30), st.text(max_size=4)
)
def test_any_text_has_bytes_or_one_line(form, text, address):
    try:
        frame = sealed(form, text, address)
    except Diagnostic:
        return
    assert frame.check in frame.sent and frame.steps


@given(st.binary(min_size=1, max_size=250))
def test_a_crc_over_a_frame_with_its_crc_is_zero(pdu):
    crc = 0xFFFF
    for byte in sealed("modbus-rtu", pdu.hex(), "1").sent:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    assert crc == 0


@pytest.mark.virtual
async def test_the_verb_takes_the_language_of_the_selected_drive_or_a_form(tmp_path):
    cell = (
        bus("press", party("a"), baud=0),
        bus("pmx", pmx("00"), baud=0),
        bus("slide", drive("TMCM-1140", "1"), baud=0),
    )
    async with CellSession(tmp_path, *cell) as shop:
        for before, line, row in (
            ("/use press:a", "/checksum MR 51200", "bytes:  61 4D 52 20 35 31 32 30 30 E8 0A"),
            ("/use pmx:00", "/checksum PX", "bytes:  40 30 30 50 58 0D"),
            ("/use slide:1", "/checksum GAP 1, 0", "bytes:  01 06 01 00 00 00 00 00 08"),
            ("/use slide:1", "/checksum modbus-rtu 01 03 00 00 00 0A", "bytes:  01 03 00 00 00 0A C5 CD"),
        ):
            await shop.session.run(before)
            written = {name: shop.written(name) for name in ("press", "pmx", "slide")}
            shop.events.clear()
            await shop.session.run(line)
            assert row in shop.printed(), line
            assert {name: shop.written(name) for name in written} == written, "nothing is sent"


def test_the_command_prints_it_and_names_the_forms(multidrop):
    done = multidrop("checksum", "mcode", "MR 51200", "--address", "a")
    assert done.returncode == 0 and "61 4D 52 20 35 31 32 30 30 E8 0A" in done.stdout
    wrong = multidrop("checksum", "nothing", "x")
    assert wrong.returncode == 2 and all(name in wrong.stderr for name in forms())
