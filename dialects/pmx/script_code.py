"""A-SCRIPT compiled to the lines that the controller stores (`SA`), and back.

The lines are those of a small stack machine. `CVn` and `VRn` put a constant or a variable on the stack, and what
follows takes them off: `AM` assigns (source, destination), `OXk` calculates, `JIk$2` and `JWk$2` compare and pass over
the next line if it is true. `PSn`, `SSn`, `SE` and `XX` mark PRG, SUB, ENDSUB and END. These tokens are publicly known
from a sibling of this controller; the codes of its registers and commands are numbers that are not known for this
one. Where a unit has `&number$value`, these lines have `&NAME$n`, n values taken from the stack: nobody's but the
simulator's. What each means is told in docs/pmx-lines.md.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from dialects.pmx.script import Statement, Value
from dialects.pmx.script_words import AXES, COMPARISONS, HANDLER, OPERATORS, PROGRAMS, WORDS

ERASED = "0"
"""What stands in a line that holds nothing."""
OPERATION = {op: str(n) for n, op in enumerate((*OPERATORS, "~"), 1)}
COMPARISON = {op: str(n) for n, op in enumerate(COMPARISONS, 1)}
_OPERATIONS = {code: op for op, code in OPERATION.items()}
_COMPARISONS = {code: op for op, code in COMPARISON.items()}
_TOKEN = re.compile(
    r"(PS|SS|GS|CV|VR|OX|JR|JO|JM-|DD|DV|WX)(\d+)|(CV)(-\d+)|(J[IW])(\d)\$2|(SE|XX|AM|EI)(0?)", re.ASCII
)
_REGISTER = re.compile(r"&([A-Z]+\d?[+-]?|V\d+)\$(\d)", re.ASCII)
MOVES = {"X": 1, "Y": 1, "XY": 2}


@dataclass
class Code:
    """Compiled lines, and the line of the source that each comes from."""

    lines: list[str] = field(default_factory=list)
    source: list[int] = field(default_factory=list)


class Undecodable(Exception):
    """Lines that are not from this compiler: the number of the first, and what it holds."""

    def __init__(self, number: int, token: str) -> None:
        super().__init__(f"line {number} holds {token!r}, which this compiler never writes there")
        self.number, self.token = number, token


def split(token: str) -> tuple[str, str] | None:
    """What a line does and its argument (`("CV", "-5")`, `("&HSPD", "0")`); None: nothing that is known."""
    if found := _REGISTER.fullmatch(token):
        name, many = found[1], int(found[2])
        known = MOVES.get(name) == many or (name in WORDS and name[0] != "V" and many == 0)
        return (f"&{name}", found[2]) if known else None
    if found := _TOKEN.fullmatch(token):
        word, argument = (each for each in found.groups() if each is not None)
        right = {"OX": argument in _OPERATIONS, "JI": argument in _COMPARISONS, "JW": argument in _COMPARISONS}
        right |= {"EI": argument == "0", "WX": argument in ("0", "1"), "VR": argument.isdigit() and int(argument) < 64}
        right |= {
            "PS": argument.isdigit() and int(argument) < PROGRAMS,
            "DV": argument.isdigit() and int(argument) < 64,
        }
        right |= {word: argument.isdigit() and int(argument) <= HANDLER} if word in ("SS", "GS") else {}
        right |= {word: argument == ""} if word in ("SE", "XX", "AM") else {}
        return (word, argument) if right.get(word, True) else None
    return None


# To lines.


def compile_(statements: Sequence[Statement]) -> Code:
    """The lines of a program whose blocks are right (`script_check`)."""
    maker = _Maker()
    for each in statements:
        maker.take(each)
    return maker.code


class _Maker:
    def __init__(self) -> None:
        self.code = Code()
        self.loops: list[int] = []  # where each open WHILE begins to put its values
        self.skips: list[int | None] = []  # the JR of the branch that is open, of each open IF
        self.overs: list[list[int]] = []  # the JO lines of each open IF
        self.enders: list[int] = []

    def put(self, token: str) -> int:
        self.code.lines.append(token)
        self.code.source.append(self.line)
        return len(self.code.lines) - 1

    def here(self, at: int) -> None:
        """The jump of line `at` goes to the next line."""
        self.code.lines[at] += str(len(self.code.lines) - at)

    def take(self, each: Statement) -> None:
        self.line = each.line
        if each.kind == "block":
            self.block(each)
        elif each.kind == "set":
            self.values(each.values)
            if each.op:
                self.put(f"OX{OPERATION[each.op]}")
            self.values((Value(each.word),))
            self.put("AM")
        elif each.kind == "move":
            self.values(each.values)
            self.put(f"&{each.word}${len(each.values)}")
        elif each.kind == "delay":
            (value,) = each.values
            self.put(f"DD{value.text}" if value.constant is not None else f"DV{value.text[1:]}")
        elif each.kind == "wait":
            self.put(f"WX{AXES.index(each.word)}")
        else:
            self.put(f"&{each.word}$0")

    def values(self, values: Sequence[Value]) -> None:
        for each in values:
            if each.constant is not None:
                self.put(f"CV{each.text}")
            elif each.text[0] == "V":
                self.put(f"VR{each.text[1:]}")
            else:
                self.put(f"&{each.text}$0")

    def block(self, each: Statement) -> None:
        word = each.word
        if word in ("PRG", "SUB", "GOSUB"):
            self.put({"PRG": "PS", "SUB": "SS", "GOSUB": "GS"}[word] + str(each.number))
        elif word in ("END", "ENDSUB"):
            self.put({"END": "XX", "ENDSUB": "SE"}[word])
        elif word == "IF":
            self.overs.append([])
            self.skips.append(self.condition(each, "JI"))
        elif word == "WHILE":
            self.loops.append(len(self.code.lines))
            self.enders.append(self.condition(each, "JW"))
        elif word == "ENDWHILE":
            at = self.put("JM-")
            self.code.lines[at] += str(at - self.loops.pop())
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

    def condition(self, each: Statement, jump: str) -> int:
        self.values(each.values)
        self.put(f"{jump}{COMPARISON[each.op]}$2")
        return self.put("JR")


# And back.


def decompile(lines: Sequence[str]) -> list[str]:
    """The program as A-SCRIPT, indented by its blocks. Raises Undecodable."""
    return _Reader(lines).program()


class _Reader:
    def __init__(self, lines: Sequence[str]) -> None:
        self.lines = lines
        self.stack: list[str] = []
        self.text: list[str] = []
        self.depth = 0
        self.ends: list[tuple[int, str]] = []  # where open blocks end, the innermost last

    def say(self, text: str) -> None:
        self.text.append("    " * self.depth + text)

    def program(self) -> list[str]:
        end = len(self.lines)
        while end and self.lines[end - 1] == ERASED:
            end -= 1
        at = 0
        while at < end:
            at = self.one(at)
        if self.ends or self.stack:
            raise Undecodable(end, self.lines[end] if end < len(self.lines) else "")
        return self.text

    def one(self, at: int) -> int:
        """Take the line `at`; the next one to take."""
        found = split(self.lines[at])
        if found is None:
            raise Undecodable(at, self.lines[at])
        word, argument = found
        if word in ("CV", "VR"):
            self.stack.append(argument if word == "CV" else f"V{argument}")
        elif word in ("JI", "JW"):
            return self.condition(at, word, argument)
        elif word in ("JO", "JM-", "EI"):
            return self.leave(at, word, int(argument))
        elif word in ("PS", "SS", "GS"):
            self.mark(at, {"PS": "PRG", "SS": "SUB", "GS": "GOSUB"}[word], argument)
        elif word in ("SE", "XX"):
            if self.ends:
                raise Undecodable(at, self.lines[at])
            self.depth = 0
            self.say("ENDSUB" if word == "SE" else "END")
        elif word[0] == "&":
            self.register(at, word[1:], int(argument))
        else:
            self.plain(at, word, argument)
        return at + 1

    def mark(self, at: int, word: str, argument: str) -> None:
        if word != "GOSUB":
            if self.ends:
                raise Undecodable(at, self.lines[at])
            if self.text:
                self.text.append("")
            self.depth = 0
        self.say(f"{word} {argument}")
        self.depth += word != "GOSUB"

    def take(self, at: int, many: int) -> list[str]:
        """The values on the stack, which must be so many and no more."""
        if len(self.stack) != many:
            raise Undecodable(at, self.lines[at])
        values, self.stack = self.stack, []
        return values

    def register(self, at: int, name: str, many: int) -> None:
        if name in MOVES:
            self.say("".join(axis + value for axis, value in zip(name, self.take(at, many), strict=True)))
        elif WORDS[name].command:
            self.take(at, 0)
            self.say(name)
        else:
            self.stack.append(name)

    def plain(self, at: int, word: str, argument: str) -> None:
        if word == "AM":
            source, target = self.take(at, 2)
            self.say(f"{target}={source}")
        elif word == "OX":
            op = _OPERATIONS[argument]
            values = self.take(at, 1 if op == "~" else 2)
            self.stack.append(f"~{values[0]}" if op == "~" else op.join(values))
        elif word == "WX":
            self.say(f"WAIT{AXES[int(argument)]}")
        elif word in ("DD", "DV"):
            self.say(f"DELAY={'V' if word == 'DV' else ''}{argument}")
        else:
            raise Undecodable(at, self.lines[at])

    def jump(self, at: int, word: str) -> int:
        """Where the JR or JO of line `at` goes."""
        found = split(self.lines[at]) if at < len(self.lines) else None
        if found is None or found[0] != word or not at < at + int(found[1]) < len(self.lines):
            raise Undecodable(at, self.lines[at] if at < len(self.lines) else "")
        return at + int(found[1])

    def end_of_if(self, at: int) -> int:
        """The EI0 of the IF whose JR is line `at`: there the JR goes, or the JO in front of where it goes."""
        target = self.jump(at, "JR")
        before = split(self.lines[target - 1])
        if target - 1 > at and before is not None and before[0] == "JO":
            target = self.jump(target - 1, "JO")
        return target

    def condition(self, at: int, word: str, argument: str) -> int:
        left, right = self.take(at, 2)
        text = f"{left}{_COMPARISONS[argument]}{right}"
        if word == "JW":
            self.say(f"WHILE {text}")
            self.ends.append((self.jump(at + 1, "JR") - 1, "JM-"))
        elif self.text and self.text[-1].strip() == "ELSE" and self.ends[-1:] == [(self.end_of_if(at + 1), "EI")]:
            self.text[-1] = "    " * (self.depth - 1) + f"ELSEIF {text}"
            return at + 2
        else:
            self.say(f"IF {text}")
            self.ends.append((self.end_of_if(at + 1), "EI"))
        self.depth += 1
        return at + 2

    def leave(self, at: int, word: str, argument: int) -> int:
        if not self.ends or self.stack:
            raise Undecodable(at, self.lines[at])
        end, kind = self.ends[-1]
        if word == "JO" and (kind, at + argument) == ("EI", end):
            self.depth -= 1
            self.say("ELSE")
            self.depth += 1
        elif (at, word) == (end, kind):
            self.depth -= 1
            self.say("ENDIF" if word == "EI" else "ENDWHILE")
            self.ends.pop()
        else:
            raise Undecodable(at, self.lines[at])
        return at + 1
