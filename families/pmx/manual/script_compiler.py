"""The compiler of A-SCRIPT to the lines that the controller stores (`SA`), and the form of those lines.

The lines are those of a small stack machine. `CVn` and `VRn` push a constant or a variable, and the next operation
takes everything off the stack. `AM` assigns (source, target). `OXk` calculates and assigns (right, left, target: `CV10
VR1 VR10 OX3` is V10=V1*10). `JIk$2` and `JWk$2` compare (left, right) and skip the next line if true. `PSn`, `SSn`,
`SE` and `XX` mark PRG, SUB, ENDSUB and END. These tokens are publicly known from the maker's compiler for a sibling of
this controller. The codes of registers and commands are numbers, unknown for this one. Where a unit has `&84$250000`,
these lines have a name in place of the number, `&HSPD=$250000`: only the simulator reads it. docs/pmx-lines.md has the
meaning of each; `program_file.decompile` makes a program of them again.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from multidrop.families.pmx.manual.script_parser import (
    AXES,
    COMPARISONS,
    HANDLER,
    INT32,
    OPERATORS,
    PROGRAMS,
    VARIABLES,
    WORDS,
    ScriptStatement,
    ScriptValue,
)

MEMORY_LINES = 1275
"""The size of the controller's memory, in lines (7.19.1)."""
ERASED = "0"
"""The content of an erased line."""
EMPTY = frozenset({"", ERASED, "XX0", "FF", "-1"})
"""The content of a line that was never written."""
UINT32 = 2**32 - 1
OPERATION = {op: str(n) for n, op in enumerate((*OPERATORS, "~"), 1)}
COMPARISON = {op: str(n) for n, op in enumerate(COMPARISONS, 1)}
MOVES: Mapping[str, int] = {"X": 1, "Y": 1, "XY": 2}
"""The axes of a move, and the number of values that it takes off the stack."""
OPERANDS = 2
"""Lines whose comparison has its values before it: the `$2` of JI and JW."""

_ARGUMENTS: Mapping[str, tuple[int, int]] = {
    "PS": (0, PROGRAMS - 1),
    "SS": (0, HANDLER),
    "GS": (0, HANDLER),
    "CV": INT32,
    "VR": (0, VARIABLES - 1),
    "DV": (0, VARIABLES - 1),
    "OX": (1, len(OPERATION)),
    "JI": (1, len(COMPARISON)),
    "JW": (1, len(COMPARISON)),
    "JR": (1, MEMORY_LINES - 1),
    "JO": (1, MEMORY_LINES - 1),
    "JM-": (1, MEMORY_LINES - 1),
    "DD": (0, UINT32),
    "WX": (0, len(AXES) - 1),
    "EI": (0, 0),
}
"""Lines with a number, and the numbers with a known meaning."""
_ALONE = ("SE", "XX", "AM")
_NUMBER = r"0|-?[1-9]\d{0,9}"
_TOKEN = re.compile(rf"({'|'.join(_ARGUMENTS)})({_NUMBER})(\$2)?", re.ASCII)
_REGISTER = re.compile(rf"&([A-Z]+\d?[-+=]?)\$({_NUMBER})", re.ASCII)
_SHAPE = re.compile(
    r"(?:PS|SS|GS|CV|VR|DV|OX|JR|JO|JM|DD|WX|EI)-?\d+|J[IW]\d+\$\d+|SE|XX|AM|&[^\s$]+\$-?\d+|0", re.ASCII
)


def looks_compiled(text: str) -> bool:
    """Whether a line has the form of a compiled line, known or not. No line of A-SCRIPT has it."""
    return _SHAPE.fullmatch(text) is not None


def split(token: str) -> tuple[str, str] | None:
    """Split a line: `("CV", "-5")`, `("&DI1", "0")`, `("&HSPD=", "500")`; None if unknown."""
    if token in _ALONE:
        return token, ""
    if match := _REGISTER.fullmatch(token):
        return (f"&{match[1]}", match[2]) if _names(match[1], int(match[2])) else None
    if match := _TOKEN.fullmatch(token):
        word, argument = match[1], match[2]
        low, high = _ARGUMENTS[word]
        right = low <= int(argument) <= high and (match[3] is not None) == (word in ("JI", "JW"))
        return (word, argument) if right else None
    return None


def _names(name: str, value: int) -> bool:
    """Whether a name is a register or command here that takes the value."""
    if name[0] == "V":
        return False
    if name.endswith("="):
        word = WORDS.get(name[:-1])
        return word is not None and word.settable and INT32[0] <= value <= UINT32
    return MOVES.get(name) == value or (name in WORDS and value == 0)


def compile_(statements: Sequence[ScriptStatement]) -> Code:
    """Compile a program whose blocks `script_checker` has approved."""
    code = Code()
    for statement in statements:
        code.take(statement)
    return code


class Code:
    """Compiled lines, and the source line of each."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.source: list[int] = []
        self.loops: list[int] = []  # the JW of each open WHILE
        self.skips: list[int | None] = []  # the JR of the open branch, of each open IF
        self.overs: list[list[int]] = []  # the JO lines of each open IF
        self.enders: list[int] = []

    def put(self, token: str) -> int:
        self.lines.append(token)
        self.source.append(self.line)
        return len(self.lines) - 1

    def here(self, at: int) -> None:
        """Let the jump of line `at` go to the next line."""
        self.lines[at] += str(len(self.lines) - at)

    def take(self, each: ScriptStatement) -> None:
        self.line = each.line
        if each.kind == "block":
            self.block(each)
        elif each.kind == "set":
            self.assign(each)
        elif each.kind == "move":
            self.values(each.values)
            self.put(f"&{each.word}${len(each.values)}")
        elif each.kind == "delay":
            (value,) = each.values
            self.put(f"DD{value.constant}" if value.constant is not None else f"DV{value.text[1:]}")
        elif each.kind == "wait":
            self.put(f"WX{AXES.index(each.word)}")
        else:
            self.put(f"&{each.word}$0")

    def assign(self, each: ScriptStatement) -> None:
        """Compile an assignment: a calculation takes right, left, target; other values use one line or AM."""
        if each.op:
            self.values((*reversed(each.values), ScriptValue(each.word)))
            self.put(f"OX{OPERATION[each.op]}")
        elif each.word[0] != "V" and each.values[0].constant is not None:
            self.put(f"&{each.word}=${each.values[0].constant}")
        else:
            self.values((*each.values, ScriptValue(each.word)))
            self.put("AM")

    def values(self, values: Sequence[ScriptValue]) -> None:
        for value in values:
            if value.constant is not None:
                self.put(f"CV{value.constant}")
            elif value.text[0] == "V":
                self.put(f"VR{value.text[1:]}")
            else:
                self.put(f"&{value.text}$0")

    def block(self, each: ScriptStatement) -> None:
        word = each.word
        if word in ("PRG", "SUB", "GOSUB"):
            self.put({"PRG": "PS", "SUB": "SS", "GOSUB": "GS"}[word] + str(each.number))
        elif word in ("END", "ENDSUB"):
            self.put({"END": "XX", "ENDSUB": "SE"}[word])
        elif word == "IF":
            self.overs.append([])
            self.skips.append(self.condition(each, "JI"))
        elif word == "WHILE":
            self.enders.append(self.condition(each, "JW"))
            self.loops.append(self.enders[-1] - 1)
        elif word == "ENDWHILE":
            at = self.put("JM-")
            self.lines[at] += str(at - self.loops.pop())
            self.here(self.enders.pop())
        elif word == "ENDIF":
            for jump in [self.skips.pop(), *self.overs.pop()]:
                if jump is not None:
                    self.here(jump)
            self.put("EI0")
        else:
            self.overs[-1].append(self.put("JO"))
            skip = self.skips.pop()
            if skip is not None:
                self.here(skip)
            self.skips.append(self.condition(each, "JI") if word == "ELSEIF" else None)

    def condition(self, each: ScriptStatement, jump: str) -> int:
        self.values(each.values)
        self.put(f"{jump}{COMPARISON[each.op]}$2")
        return self.put("JR")
