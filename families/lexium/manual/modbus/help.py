"""Help on the names of an Ethernet drive over Modbus: MCode's words, with what the register map says of each.

The map decides what a register takes; the drive itself may take less. A register has help by its address as well.
(Modbus/TCP manual 4.1, 4.3, 5; docs/rulings/modbus.md.)
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace

from multidrop.base.errors import Diagnostic
from multidrop.families.lexium.manual import help as mcode
from multidrop.families.lexium.manual.mnemonic import ETHERNET, INT_HIGH, INT_LOW, Mnemonic
from multidrop.families.lexium.manual.modbus.registers import (
    ALTERNATIVE,
    AT,
    BY_FUNCTION,
    CONTROLS,
    IDENTITY,
    INPUTS,
    OUTPUTS,
    REGISTERS,
    SETUPS,
    ModbusRegister,
)
from multidrop.families.lexium.manual.table import MNEMONICS, lookup, words

LAST_ADDRESS = max(AT)
_ADDRESS = re.compile(r"0[xX]([0-9A-Fa-f]{1,4})")
_USER = re.compile(r"V[1-8]")
_ELSEWHERE = re.compile(r"BR <|.*<operator>|.*,<1/2>")
"""Forms of MCode that no register carries: conditions, expressions, a second parameter of PR."""
REACHED = REGISTERS.keys() | BY_FUNCTION | {"PR", "AL"}
"""Every word that Modbus carries."""
LABELS = (
    *("syntax", "register", "function", "range", "form", "over MCode", "default", "access", "products", "here", "note"),
    "manual",
)


class ModbusLanguage(mcode.MCodeLanguage):
    """Help on the names that Modbus carries; the rest is MCode's."""

    def names(self) -> list[str]:
        ethernet_words = {name for name, row in words("LMDCE").items() if _ethernet(row)}
        return sorted(ethernet_words | REGISTERS.keys())

    def knows(self, word: str) -> bool:
        """Return whether a word, or the address of a register, has help."""
        name = word.strip().upper()
        row = words("LMDCE").get(name)
        return name in REGISTERS or _ADDRESS.fullmatch(name) is not None or (row is not None and _ethernet(row))

    def describe(self, word: str, product: str = "") -> list[str]:
        """Describe a word or a register, line by line. Raises Diagnostic for a reserved register or an unknown word."""
        name, first = word.strip().upper(), []
        if (address := _ADDRESS.fullmatch(name)) is not None:
            register = _at(int(address[1], 16))
            name, first = register.name, [_place_of(register, int(address[1], 16))]
        row = _user_variable(name) if _USER.fullmatch(name) else words(product or "LMDCE").get(name)
        if row is None or not (name in REGISTERS or _ethernet(row)):
            return super().describe(word, product or "LMDCE")  # which raises Diagnostic with similar words
        return [*first, *mcode.page(row, _facts(row, product))]

    def offered(self, product: str, typed: str) -> Iterable[tuple[str, str]]:
        """Return the words that Modbus carries."""
        return (offer for offer in super().offered(product, typed) if offer[0] in REACHED)

    def hint(self, text: str, product: str = "") -> str:
        """Return syntax and meaning of the word being typed, and its register; empty where it is unknown."""
        said = super().hint(text, product)
        match = re.match(r"(?:PR )?([A-Z]+\d?)", said)
        if match is None or lookup(match[1]) is None:
            return said
        register = REGISTERS.get(match[1])
        where = (
            f"register 0x{register.address:04X}" if register else "" if match[1] in REACHED else "no Modbus register"
        )
        return f"{said}; {where}" if where else said


LANGUAGE = ModbusLanguage()


def _ethernet(row: Mnemonic) -> bool:
    return any(ETHERNET.fullmatch(product) for product in row.products)


def _at(address: int) -> ModbusRegister:
    """The value that a register belongs to. Raises Diagnostic for a reserved one."""
    if address not in AT:
        raise Diagnostic(
            f"no register 0x{address:04X} in the map",
            "",
            f"the map has 0x0000 to 0x{LAST_ADDRESS:04X}, some of them reserved",
        )
    return AT[address]


def _place_of(register: ModbusRegister, address: int) -> str:
    if register.count == 1:
        return f"0x{address:04X} is the register of {register.name}"
    half = "low" if address == register.address else "high"
    return f"0x{address:04X} is the {half} word of {register.name}"


def _user_variable(name: str) -> Mnemonic:
    """A number of the user's own, as R1 is."""
    return replace(
        MNEMONICS["R1"],
        name=name,
        title=f"User variable {name[1:]}",
        meaning="a variable of a program in the drive",
        section="",
        syntax=f"{name}=<integer>, PR {name}",
        default=None,
    )


def _facts(row: Mnemonic, product: str) -> dict[str, str]:
    """What the help says of a word: by the map where it has a register, and how else Modbus reaches it."""
    said, register = mcode.facts(row, product), REGISTERS.get(row.name)
    syntax = ", ".join(form for form in row.syntax.split(", ") if not _ELSEWHERE.match(form))
    products = ", ".join(sorted(each for each in row.products if ETHERNET.fullmatch(each)))
    manual = f"Modbus/TCP manual {'5' if register else '4'}"
    manual += f", {said['manual']}" if row.section else ""
    more = {"function": _function(row.name), "products": products, "use": "", "manual": manual}
    if register is None and row.name not in REACHED:
        here = said["here"] or f"no Modbus register; {ALTERNATIVE} knows it"
        return {**said, "use": "", "products": products, "here": here}
    merged = {**said, **more, "syntax": syntax}
    if register is not None:
        merged |= {
            "register": _registers(register),
            "range": _range(register, row),
            "form": register.form,
            "over MCode": _of_the_drive(register, row),
            "default": _default(register, said["default"]),
            "access": mcode.ACCESS[register.access],
            "note": "" if "note" in register.differs else said["note"],
        }
    return {label: merged.get(label, "") for label in LABELS}


def _registers(register: ModbusRegister) -> str:
    if register.count == 1:
        return f"0x{register.address:04X}"
    return f"0x{register.address:04X} and 0x{register.address + 1:04X}, the low word first"


def _function(name: str) -> str:
    """The functions that reach a word beside those of registers."""
    if name in IDENTITY:
        return f"device identification (43/14), object {IDENTITY[name]}; /device shows all"
    if name in OUTPUTS:
        return f"1 and 5 at address {OUTPUTS[name]}: /coil {OUTPUTS[name] + 1} reads it"
    if name in INPUTS:
        return f"2 at address {INPUTS[name]}"
    if name == "OT":
        return "1: /coil 1, /coil 2 and /coil 3 read the outputs"
    if name == "E":
        return "65"
    if name in SETUPS:
        return "65 reads it and 66 writes it, as text"
    return "66, as text" if name in CONTROLS else ""


def _range(register: ModbusRegister, row: Mnemonic) -> str:
    """The range of the map in words; a value in a form of its own has no unit of MCode."""
    if not register.limits:
        return ""
    text = shown(register.limits)
    other = "values" in register.differs
    unit = "" if other else row.unit
    if unit and row.unit_encoder and row.unit_encoder != unit:
        unit += f" (EE=0), {row.unit_encoder} (EE=1)"
    return f"{text} {unit}".rstrip()


def shown(limits: str) -> str:
    """Write the limits of the map as a person does: `0, 2 to 65535`."""
    text = limits.replace("int32", f"{INT_LOW}..{INT_HIGH}").replace("..", " to ")
    return text if " to " in text else ", ".join(text.split())


def _of_the_drive(register: ModbusRegister, row: Mnemonic) -> str:
    """The range that MCode has for a word, where it is another; empty where it is the same or none."""
    if row.low is None or not register.limits:
        return ""
    spans = {row.bounds(), row.bounds(encoder=True)}
    same = not row.values and spans == set(register.spans)
    same = same or set(row.values) == {low for low, _ in register.spans}
    if same:
        return ""
    both = "; a write must satisfy both" if register.writable and "range" not in register.differs else ""
    return f"{mcode.range_of(row)}{both}"


def _default(register: ModbusRegister, default: str) -> str:
    """The default as we rule, and the map's where it is another."""
    if register.default is None or not default:
        return default or ("" if register.default is None else str(register.default))
    return default if re.match(rf"{register.default}\b", default) else f"{default} (the map: {register.default})"
