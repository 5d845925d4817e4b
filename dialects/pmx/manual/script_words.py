"""The words of A-SCRIPT (manual 10.1; the joystick's are in 7.15), and the equivalent ASCII commands.

A-SCRIPT and the ASCII commands are two languages: `HOMEX-` is `HX-` there, `ECLEARX` is `CLRX`. The axes are X and Y.
Z, U, EO3 and programs 2 and 3, which the manual mentions in places, belong to a bigger controller.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

AXES = "XY"
PROGRAMS = 2
SUBROUTINES = 32
VARIABLES = 64
KEPT_VARIABLES = range(32, VARIABLES)
"""The variables that STORE keeps; a start of a program sets the others to 0."""
HANDLER = 31
"""The subroutine that runs after a failure."""
INT32 = (-(2**31), 2**31 - 1)

OPERATORS = ("+", "-", "*", "/", "%", ">>", "<<", "&", "|")
"""Operations between two values; `~` precedes one."""
COMPARISONS = (">", "<", "=", ">=", "<=", "!=")
BLOCKS = ("PRG", "END", "SUB", "ENDSUB", "IF", "ELSEIF", "ELSE", "ENDIF", "WHILE", "ENDWHILE", "GOSUB", "DELAY")


@dataclass(frozen=True)
class Word:
    """A register or a command: its ASCII command, access, and the constants it accepts."""

    ascii: str
    readable: bool = False
    settable: bool = False
    low: int = INT32[0]
    high: int = INT32[1]

    @property
    def command(self) -> bool:
        """Whether it is executed, neither read nor set."""
        return not (self.readable or self.settable)


def _registers() -> dict[str, Word]:
    found: dict[str, Word] = {}
    for name in ("HSPD", "LSPD", "ACC", "DEC"):
        found[name] = Word(name, True, True, 1)
        for axis in AXES:  # 0: the global value applies to this axis
            found[name + axis] = Word(name + axis, True, True, 0)
    for axis in AXES:
        for name in ("E", "P"):
            found[name + axis] = Word(name + axis, True, True)
        for name in ("PS", "MST", "SLS"):
            found[name + axis] = Word(name + axis, True)
        found["SCV" + axis] = Word("SCV" + axis, True, True, 0, 1)
        found["SL" + axis] = Word("SL" + axis, False, True, 0, 1)
        found["SSPDM" + axis] = Word("SSPDM" + axis, False, True, 0, 9)
        found["SSPD" + axis] = Word("SSPD" + axis, False, True, 0)
    found |= {"DI": Word("DI", True), "TOC": Word("TOC", False, True, 0)}
    found |= {f"DI{n}": Word(f"DI{n}", True) for n in range(1, 9)}
    found |= {f"AI{n}": Word(f"AI{n}", True) for n in (1, 2)}
    for name, bits in (("DO", 8), ("EO", len(AXES))):
        found[name] = Word(name, True, True, 0, 2**bits - 1)
        found |= {f"{name}{n}": Word(f"{name}{n}", True, True, 0, 1) for n in range(1, bits + 1)}
    found |= {f"SR{n}": Word(f"SR{n}", False, True, 0, 3) for n in range(PROGRAMS)}
    found |= {f"V{n}": Word(f"V{n}", True, True) for n in range(VARIABLES)}
    return found | _joystick()


def _joystick() -> dict[str, Word]:
    found = {"JOYENA": Word("JOYENA", False, True, 0, 3)}
    for index, axis in enumerate(AXES):
        for number, name in ((1, "JOYHS"), (3, "JOYDEL"), (5, "JOYTOL")):
            low, high = (0, 5000) if name == "JOYTOL" else (0, INT32[1])
            found[name + axis] = Word(f"JV{number + index}", False, True, low, high)
        for number, name in enumerate(("JOYNO", "JOYNI", "JOYPI", "JOYPO"), 1):
            found[name + axis] = Word(f"JL{number + 4 * index}", False, True)
    return found


def _commands() -> dict[str, Word]:
    found = {name: Word(name) for name in ("ABORT", "ABS", "INC", "STOP", "STORE")}
    for axis in AXES:
        found |= {f"ABORT{axis}": Word(f"ABORT{axis}"), f"STOP{axis}": Word(f"STOP{axis}")}
        found[f"ECLEAR{axis}"] = Word(f"CLR{axis}")
        homing = {"HOME": "H", "HLHOME": "HL", "LHOME": "L", "ZHOME": "ZH", "ZOME": "Z", "JOG": "J"}
        for name, short in homing.items():
            found |= {f"{name}{axis}{way}": Word(f"{short}{axis}{way}") for way in "+-"}
    return found


WORDS: Mapping[str, Word] = _registers() | _commands()
