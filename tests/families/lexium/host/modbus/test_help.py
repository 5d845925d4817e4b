"""Help over Modbus: each name as the map has it, registers by address, and nothing that Modbus cannot reach."""

from __future__ import annotations

import csv
import re

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.dialects.families import FAMILIES
from multidrop.families.lexium.manual.help import ACCESS
from multidrop.families.lexium.manual.modbus.help import LANGUAGE
from multidrop.families.lexium.manual.modbus.registers import AT, REGISTERS, ROWS
from tests.support.cases import for_each
from tests.support.paths import FACTS

TABLE_OF_FACTS = FACTS / "modbus-registers.csv"


def facts(word: str, product: str = "LMDCE") -> dict[str, str]:
    """The lines of a help page by their labels."""
    lines = [line for line in LANGUAGE.describe(word, product) if re.match(r"  \S.{9} \S", line)]
    return {line[2:12].strip(): line[13:] for line in lines}


def numbers(text: str) -> list[str]:
    return re.findall(r"V[IM][+-]1|-?\d+", text)


def agrees(name: str, address: int, count: int, access: str, limits: str, default: str) -> None:
    """The page of a name shows a row of the map."""
    page = facts(name)
    assert page["register"].startswith(f"0x{address:04X}") and ("and 0x" in page["register"]) == (count == 2), page
    assert page["access"] == ACCESS[access], page
    wanted = numbers(limits.replace("int32", "-2147483648 2147483647").replace("..", " "))
    shown = page.get("range", "").partition("steps")[0].partition("counts")[0]
    assert numbers(shown) == wanted, page
    if default and name not in {"ER"} | {f"V{n}" for n in range(1, 9)}:
        assert re.search(rf"(?<!\d){default}(?!\d)", page["default"]), page


@for_each("name", REGISTERS)
def test_the_help_on_every_name_agrees_with_our_map(name: str) -> None:
    row = REGISTERS[name]
    agrees(name, row.address, row.count, row.access, row.limits, "" if row.default is None else str(row.default))


@pytest.mark.skipif(not TABLE_OF_FACTS.exists(), reason="the table of facts is not part of the product")
def test_the_help_on_every_name_agrees_with_the_manual() -> None:
    with TABLE_OF_FACTS.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(ROWS)
    for row in rows:
        address = int(row["address"], 16)
        agrees(row["mnemonic"], address, int(row["registers"]), row["access"], row["range"], row["default"])


@for_each("address", AT)
def test_a_register_has_help_by_its_address(address: int) -> None:
    row = AT[address]
    first, *rest = LANGUAGE.describe(f"0x{address:x}", "LMDCE")
    assert first.startswith(f"0x{address:04X} is the ") and first.endswith(f" of {row.name}")
    assert rest == LANGUAGE.describe(row.name, "LMDCE")
    assert LANGUAGE.knows(f"0x{address:04X}") and LANGUAGE.knows(f"0X{address:x}")


@pytest.mark.parametrize("address", [0x02, 0x23, 0xA2, 0xB8, 0xFFFF])
def test_a_reserved_register_is_said_to_be_none(address: int) -> None:
    with pytest.raises(Diagnostic, match=rf"no register 0x{address:04X} in the map"):
        LANGUAGE.describe(f"0x{address:X}")


@pytest.mark.parametrize(
    ("name", "label", "text"),
    [
        (
            "A",
            "over MCode",
            "66 to 1100000000 steps/s² (EE=0), 6 to 44000000 counts/s² (EE=1); a write must satisfy both",
        ),
        ("TS", "form", "the divider: the speed is 10 MHz / (TS + 2), and 0 is 0"),
        ("TS", "over MCode", "46512 to 2560000 steps/s"),
        ("TE", "over MCode", "0 to 127; a write must satisfy both"),
        ("I5", "form", "the reading divided by 4"),
        ("I5", "syntax", "PR I5"),
        ("MT", "over MCode", "0 to 65535 ms; a write must satisfy both"),
        ("OF", "form", "1 if any output is faulty"),
        ("AS", "default", "0 (the map: 2)"),
        ("O2", "function", "1 and 5 at address 1: /coil 2 reads it"),
        ("IS", "function", "65 reads it and 66 writes it, as text"),
        ("EX", "function", "66, as text"),
        ("E", "function", "65"),
        ("SN", "function", "device identification (43/14), object 5; /device shows all"),
        ("UV", "here", "no Modbus register; MCode/TCP (tcp://HOST:503) knows it"),
        ("A", "products", "LMDCE, LMDOE"),
        ("EE", "products", "LMDCE"),
    ],
)
def test_help_says(name: str, label: str, text: str) -> None:
    assert facts(name)[label] == text


def test_no_page_speaks_of_what_modbus_cannot_do() -> None:
    for name in REGISTERS:
        text = "\n".join(LANGUAGE.describe(name, "LMDCE"))
        assert "<operator>" not in text and "BR <" not in text and "in programs" not in text, text


@for_each("name", LANGUAGE.names())
def test_every_name_has_help(name: str) -> None:
    lines = LANGUAGE.describe(name, "LMDCE")
    assert LANGUAGE.knows(name.lower()) and lines[0].startswith(f"{name}: ") and "None" not in "".join(lines)


def test_a_word_of_another_product_is_not_known() -> None:
    assert not LANGUAGE.knows("S1") and not LANGUAGE.knows("GAS") and not LANGUAGE.knows("0x")
    with pytest.raises(Diagnostic, match="no mnemonic 'VMM'"):
        LANGUAGE.describe("VMM")


def test_completion_offers_only_what_modbus_carries() -> None:
    offered = [name for name, _ in LANGUAGE.complete("", "LMDCE")]
    assert {"P", "IS", "EX", "E", "PR", "SN"} <= set(offered) and not {"UV", "CK", "PG", "VA"} & set(offered)


@pytest.mark.parametrize(
    ("text", "end"),
    [
        ("VM=5", "; register 0x008B"),
        ("PR P", "; register 0x0057"),
        ("PR P,V", "; register 0x0085"),
        ("UV", "; no Modbus register"),
        ("IS=1,2", "5.1.64 to 5.1.66"),
    ],
)
def test_the_hint_names_the_register(text: str, end: str) -> None:
    assert LANGUAGE.hint(text, "LMDCE").endswith(end)


def test_the_family_has_this_help() -> None:
    assert FAMILIES["modbus"].language is LANGUAGE
