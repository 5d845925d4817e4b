"""The ASCII commands of the simulated PMX: the whole table, what is refused and how, what STORE keeps, the watchdog."""

from __future__ import annotations

import csv
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from multidrop.families.pmx.simulator.device import PmxDevice, PmxPort
from multidrop.families.pmx.simulator.settings import REGISTERS
from multidrop.simulator.cell.spec import DriveSpec
from tests.support.paths import FACTS
from tests.support.pmx_controller import Bench

SAMPLES = {
    "[axis]": "X",
    "[+/-]": "+",
    "[1-2]": "2",
    "[1-6]": "6",
    "[1-8]": "8",
    "[0-1]": "1",
    "[0-63]": "63",
    "[0-31]": "31",
    "[0-1273]": "1273",
    "[0,1]": "1",
    "[X axis]: [Y axis]": "10:-20",
    "X[target X] Y[target Y]": "X10Y-20",
}
VALUES = {"DN": "2ED07", "SLRX": "0.125", "SA1273": "XX", "DB": "3", "SSPDX": "500", "SR1": "0"}


def spelled(row: str) -> str:
    """A row of the table as a command that can be sent."""
    for mark, sample in SAMPLES.items():
        row = row.replace(mark, sample)
    head, sign, value = re.sub(r"\[[Vv]alue\]", "1", row).partition("=")
    return head + sign + VALUES.get(head, value) if sign else head


def rows() -> list[dict[str, str]]:
    if not FACTS.exists():
        return []
    with open(FACTS / "pmx-ascii-commands.csv", newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.mark.skipif(not FACTS.exists(), reason="the table is not here")
def test_every_command_of_the_table_is_answered_as_the_table_says() -> None:
    for row in rows():
        pmx, text = Bench(), spelled(row["command"])
        if text.startswith("SSPDX"):
            pmx("SSPDMX=1")
        if text.startswith("TX"):
            pmx("X1000")
            pmx.later(0.1)
        reply = pmx(text)
        if text == "GS31":
            assert reply == "?Sub not Initialized"
        elif row["returns"] == "OK":
            assert reply == "OK", text
        else:
            assert reply and reply[0] != "?" and reply != "OK", (text, reply)


@pytest.mark.skipif(not FACTS.exists(), reason="the table is not here")
def test_every_setting_reads_back_as_it_was_set_for_both_axes() -> None:
    for row in rows():
        for axis in "XY":
            text = spelled(row["command"].replace("[axis]", axis).replace("SCVX", "SCV" + axis))
            head, sign, value = text.partition("=")
            if sign and not head.startswith(("SSPDX", "SSPDY", "SR")):
                pmx = Bench()
                reply = pmx(text, head)
                assert reply in (value, value + ".000"), text


def test_both_errors_of_table_9_1_that_echo_and_the_others_word_for_word() -> None:
    pmx = Bench()
    cases = {
        "HS": "?HS",
        "LS=300": "?LS=300",
        "px": "?px",
        "SAP": "?SAP",
        "HSPDZ": "?HSPDZ",
        "PZ=1": "?PZ=1",
        "EO3": "?EO3",
        "EO3=1": "?EO3=1",
        "SR2=1": "?SR2=1",
        "SASTAT2": "?SASTAT2",
        "ID=1": "?ID=1",
        "DI=1": "?DI=1",
        "SSPDX": "?SSPDX",
        "SR0": "?SR0",
        "X": "?X",
        "X1.5": "?X1.5",
        "JOYENA=3": "?JOYENA=3",
        "": "?",
        "TX5": "?ABS/INC is not in operation",
        "V64": "?Index out of Range",
        "V64=1": "?Index out of Range",
        "DI9": "?Index out of Range",
        "DO0=1": "?Index out of Range",
        "AI3": "?Index out of Range",
        "JL9=1": "?Index out of Range",
        "JV7": "?Index out of Range",
        "SA1275": "?Index out of Range",
        "GS32": "?Index out of Range",
        "HSPD=": "?Invalid Answer",
        "HSPD=fast": "?Invalid Answer",
        "HSPD=0": "?Invalid Answer",
        "HSPD=6000001": "?Invalid Answer",
        "DO=256": "?Invalid Answer",
        "DO1=2": "?Invalid Answer",
        "DB=6": "?Invalid Answer",
        "DN=2ED100": "?Invalid Answer",
        "DN=4EX00": "?Invalid Answer",
        "SLRX=0": "?Invalid Answer",
        "SLRX=1000": "?Invalid Answer",
        "SSPDMX=10": "?Invalid Answer",
        "SR0=4": "?Invalid Answer",
        "V0=2147483648": "?Invalid Answer",
        "LSPD=0": "?Low speed out of range",
        "GS0": "?Sub not Initialized",
    }
    assert {text: pmx(text) for text in cases} == cases


def test_texts_of_the_manual_as_bytes() -> None:
    pmx = Bench("set = { POLX = 7 }\n[bus.drive.world]\ninputs = [[0.0, 4, 0]]")
    assert pmx.send(b"@00POLX\r") == b"7\r"
    assert pmx.send(b"@00DI\r") == b"8\r"
    assert pmx.send(b"@00STORE\r") == b"OK\r"
    assert pmx.send(b"@00ID\r@00VER\r@00DN\r") == b"Performax-2ED-SA\rV128BL\r2ED00\r"


def test_digital_inputs_are_on_at_ground_and_the_polarity_turns_them() -> None:
    pmx = Bench()
    pmx.floor.command("/sim input 00 1 0", 0.0)
    pmx.floor.command("/sim input 00 8 1", 0.0)
    assert [pmx("DI"), pmx("DI1"), pmx("DI8")] == ["1", "1", "0"]
    assert pmx("POLX=1024", "DI") == "254"


def test_outputs_by_bit_and_together_and_their_levels() -> None:
    pmx = Bench()
    assert pmx("DO=5", "DO3") == "1"
    assert pmx("DO8=1", "DO1=0", "DO") == "132"
    level = pmx.device.controller.output_level
    assert [level(3), level(1)] == [0, 1]
    assert pmx("POLX=2048", "EO=1", "EO2=1", "EO") == "3"
    assert [level(3), level(1)] == [1, 0]


def test_analog_inputs_are_millivolts() -> None:
    pmx = Bench("[bus.drive.world.x]\nanalog = [[0.0, 5000]]\n[bus.drive.world.y]\nanalog = [[0.0, 2500]]")
    assert [pmx("AI1"), pmx("AI2")] == ["5000", "2500"]


def test_store_keeps_what_7_20_lists_and_nothing_else() -> None:
    pmx = Bench()
    for name, register in REGISTERS.items():
        if name not in ("JO", "TOC"):
            value = "0.5" if name.startswith("SLR") else str(max(register.low, min(register.high, 1)))
            if name == "DB":
                value = "4"
            pmx(f"{name}={value}", "MM")
    pmx("SLX=0", "SLY=0", "TOC=9000", "DN=2ED42", "V31=5", "V32=6", "V63=7", "INC", "PX=5", "EX=6", "DO=3", "JO=2")
    changed = {name: pmx.device.controller.settings[name] for name in REGISTERS}
    pmx("STORE", "HCA=77", "V33=9", "DO=255")
    pmx.floor.command("/sim power 00 off", pmx.now)
    assert pmx.send(b"@00ID\r") == b""
    pmx.floor.command("/sim power 00 on", pmx.now)
    registers = pmx.device.controller.settings
    for name, register in REGISTERS.items():
        assert registers[name] == (changed[name] if register.kept else register.factory), name
    assert pmx.send(b"@00DN\r") == b""
    words = ["DN", "V31", "V32", "V33", "V63", "MM", "PX", "EX", "DO", "EO"]
    answers = [pmx.send(f"@42{text}\r".encode()).decode()[:-1] for text in words]
    assert answers == ["2ED42", "0", "6", "0", "7", "0", "0", "0", "1", "1"]
    unkept = {name for name, register in REGISTERS.items() if not register.kept}
    assert {name.rstrip("XY") for name in unkept} == {"HSPD", "LSPD", "ACC", "DEC", "SSPDM"}


def test_without_store_nothing_is_kept_and_the_name_acts_after_power_only() -> None:
    pmx = Bench()
    assert pmx("DN=2ED05", "LCA=5", "DN") == "2ED05"
    assert pmx("STORE", "LCA=6", "LCA") == "6"
    pmx.floor.command("/sim power 00 off", pmx.now)
    pmx.floor.command("/sim power 00 on", pmx.now)
    assert [pmx.send(b"@00LCA\r"), pmx.send(b"@05LCA\r")] == [b"", b"5\r"]


def test_motion_ends_with_the_power_and_positions_begin_at_zero() -> None:
    pmx = Bench()
    pmx("JX+")
    pmx.later(1.0)
    pmx.floor.command("/sim power 00 off", pmx.now)
    pmx.later(1.0)
    pmx.floor.command("/sim power 00 on", pmx.now)
    assert [pmx("PX"), pmx("EX"), pmx("MSTX")] == ["0", "0", "0"]


def test_the_watchdog_raises_bit_11_until_it_is_cleared() -> None:
    pmx = Bench()
    pmx("TOC=500")
    pmx.later(0.4)
    assert pmx("MST") == "0:0"
    pmx.later(0.4)
    assert pmx("MST") == "0:0"
    pmx.later(0.6)
    assert pmx("MST") == "2048:2048"
    assert pmx("CLRX", "MST") == "0:2048"
    pmx.later(0.6)
    assert pmx("MST") == "2048:2048"
    assert pmx("TOC=0", "CLR", "MST") == "0:0"
    pmx.later(5.0)
    assert pmx("MST") == "0:0"


def test_lines_are_stored_and_given_back() -> None:
    pmx = Bench()
    assert pmx("SA0=PS0", "SA1274=XX", "SA1274") == "XX"
    assert [pmx("SA0"), pmx("SASTAT"), pmx("SASTAT1"), pmx("SPC0")] == ["PS0", "0", "0", "0"]


def test_a_wrong_setting_in_a_cell_is_named() -> None:
    from multidrop.base.errors import Diagnostic

    with pytest.raises(Diagnostic, match=r"set SLRX = 0 is refused: \?Invalid Answer"):
        Bench("set = { SLRX = 0 }")


# The wire.


def test_another_number_is_not_answered_and_a_line_without_one_is_when_it_is_alone() -> None:
    pmx = Bench()
    assert pmx.send(b"@01ID\r") == b""
    assert pmx.send(b"@0ID\r") == b""
    assert pmx.send(b"PX\r") == b"0\r"
    assert pmx.send(b"PX=7\0\0\0\r\n@00PX\r\n") == b"OK\r7\r"
    assert pmx.send(b"\r\r\n") == b""


def test_a_number_sign_begins_the_line_again_and_a_long_line_is_no_command() -> None:
    pmx = Bench()
    assert pmx.send(b"@00X5@00MSTX\r") == b"0\r"
    assert pmx.send(b"@00" + b"A" * 200 + b"\r") == b"?" + b"A" * 61 + b"\r"
    assert pmx.send(b"@00P\xff\r") == b"?P\xff\r"


def test_two_on_a_line_answer_to_their_own_numbers_only() -> None:
    from multidrop.simulator.cells import read
    from multidrop.simulator.floor import Floor

    drive = '[[bus.drive]]\npersonality = "PMX"\nname = '
    wire = Floor(read(f'[[bus]]\nname = "b"\n{drive}"00"\n{drive}"17"\n')).wires["b"]
    wire.receive(b"@17DN\r@00DN\rDN\r@05DN\r", 0.0)
    assert wire.advance(0.0) == b"2ED17\r2ED00\r"


def test_another_baud_rate_acts_after_store_and_power() -> None:
    from multidrop.simulator.cells import read
    from multidrop.simulator.floor import Floor

    floor = Floor(read('[[bus]]\nname = "b"\nbaud = 19200\n[[bus.drive]]\npersonality = "PMX"\n'))
    wire = floor.wires["b"]

    def ask(data: bytes, now: float, baud: int) -> bytes:
        wire.receive(data, now, baud)
        return wire.advance(now + 0.5)

    assert ask(b"@00DB\r", 0.0, 19200) == b"2\r"
    assert ask(b"@00DB=5\r@00STORE\r@00DB\r", 1.0, 19200) == b"OK\rOK\r5\r"
    floor.command("/sim power 00 off", 2.0)
    floor.command("/sim power 00 on", 2.1)
    assert ask(b"@00DB\r", 3.0, 19200) == b""
    assert ask(b"\r@00DB\r", 4.0, 115200).endswith(b"5\r")


WORDS = [spelled(row["command"]) for row in rows()] or ["PX", "X1", "HX+"]


@settings(deadline=None)
@given(st.lists(st.one_of(st.binary(max_size=20), st.sampled_from(WORDS).map(str.encode)), max_size=12))
def test_no_bytes_ever_raise_and_every_addressed_line_is_answered(lines: list[bytes]) -> None:
    pmx = Bench("[bus.drive.world]\nhome = -100\nlimit_plus = 500\nstall_at = -700\nslip = 0.1")
    for each in lines:
        text = each.replace(b"@", b"").replace(b"\r", b"")
        number = pmx.device.controller.settings.number.encode()
        assert pmx.send(b"@" + number + text + b"\r").endswith(b"\r")
        pmx.send(each)
        pmx.send(b"\r")
        pmx.now += 0.21
        pmx.wire.advance(pmx.now)


@pytest.mark.parametrize(
    ("sent", "kept"),
    [
        ("0.500000", "0.500"),
        ("1.234567", "1.235"),
        ("1.2345", "1.235"),
        ("1.23449999999", "1.234"),
        ("0.0005", "0.001"),
        ("999.999499", "999.999"),
    ],
)
def test_a_ratio_of_more_decimals_is_rounded_to_those_that_are_kept(sent: str, kept: str) -> None:
    assert Bench()(f"SLRX={sent}", "SLRX") == kept


@pytest.mark.parametrize("sent", ["0.000499", "999.9995", "1.", ".5", "1.2.3", "1e0", "-1.000000", "1000.000000"])
def test_a_ratio_that_is_none_or_out_of_range_once_rounded_is_invalid(sent: str) -> None:
    assert Bench()(f"SLRX={sent}") == "?Invalid Answer"


@given(st.lists(st.sampled_from([b"HSPD", b"=", b"5", b"0", b"\x08", b"\x7f", b"@00"]), max_size=30), st.integers(1, 5))
def test_backspace_and_delete_take_back_the_character_before_them(typed: list[bytes], size: int) -> None:
    kept = bytearray()
    for byte in b"".join(typed):
        if byte in b"\x08\x7f":
            del kept[-1:]
        elif byte == ord("@"):
            kept[:] = b"@"
        elif len(kept) < 64:
            kept.append(byte)
    data, port, other = b"".join(typed) + b"\r", *(PmxPort(PmxDevice(DriveSpec("PMX", name="00"))) for _ in range(2))
    for n in range(0, len(data), size):
        port.receive(data[n : n + size], 0.0)
    other.receive(bytes(kept) + b"\r", 0.0)
    assert port.sent(0.0) == other.sent(0.0)


def test_a_typing_error_is_mended_before_the_line_is_sent() -> None:
    port = PmxPort(PmxDevice(DriveSpec("PMX", name="00")))
    port.receive(b"\x08@01\x080PY\x7fX\r", 0.0)
    assert [each.data for each in port.sent(0.0)] == [b"0\r"]
