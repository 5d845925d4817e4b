"""The decompiler of the controller's lines to A-SCRIPT, for lines that this compiler can have written."""

from __future__ import annotations

from collections.abc import Sequence

from multidrop.dialects.pmx.manual import script_checker
from multidrop.dialects.pmx.manual.script_compiler import COMPARISON, EMPTY, MOVES, OPERATION, compile_, split
from multidrop.dialects.pmx.manual.script_parser import parse
from multidrop.dialects.pmx.manual.script_words import AXES, WORDS

_OPERATIONS = {code: op for op, code in OPERATION.items()}
_COMPARISONS = {code: op for op, code in COMPARISON.items()}


class Undecodable(Exception):
    """Lines of another compiler: the number of the first, and its content."""

    def __init__(self, number: int, token: str) -> None:
        super().__init__(f"line {number} holds {token!r}, which this compiler never writes there")
        self.number, self.token = number, token


def decompile(lines: Sequence[str]) -> list[str]:
    """Decompile a program to A-SCRIPT, indented by its blocks.

    Raises Undecodable unless the program compiles to exactly these lines: nothing is guessed.
    """
    end = len(lines)
    while end and lines[end - 1] in EMPTY:
        end -= 1
    text = _Reader(lines[:end]).program()
    if text:
        _verify("\n".join(text), lines[:end])
    return text


def _verify(text: str, lines: Sequence[str]) -> None:
    """Raise Undecodable unless the program is correct and compiles to these lines."""
    code = compile_(parse(text)[0])
    for at, token in enumerate(lines):
        if at >= len(code.lines) or token != code.lines[at]:
            raise Undecodable(at, token)
    if wrong := [each for each in script_checker.check(text) if not each.warning]:
        at = code.source.index(wrong[0].line)
        raise Undecodable(at, lines[at])


class _Reader:
    def __init__(self, lines: Sequence[str]) -> None:
        self.lines = lines
        self.stack: list[str] = []
        self.text: list[str] = []
        self.depth = 0
        self.ends: list[tuple[int, str]] = []  # the ends of open blocks, the innermost last
        self.loops: list[int] = []  # the JW of each open WHILE

    def say(self, text: str) -> None:
        self.text.append("    " * self.depth + text)

    def program(self) -> list[str]:
        at = 0
        while at < len(self.lines):
            at = self.one(at)
        if self.ends or self.stack:
            raise Undecodable(at, "")
        return self.text

    def one(self, at: int) -> int:
        """Decompile the line `at`; return the next one."""
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
        elif word[-1] == "=":
            self.take(at, 0)
            self.say(f"{word[1:]}{argument}")
        elif word[0] == "&":
            self.register(at, word[1:])
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
        """Take the values off the stack, which must have exactly this many."""
        if len(self.stack) != many:
            raise Undecodable(at, self.lines[at])
        values, self.stack = self.stack, []
        return values

    def register(self, at: int, name: str) -> None:
        if name in MOVES:
            self.say("".join(axis + value for axis, value in zip(name, self.take(at, len(name)), strict=True)))
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
            *values, target = self.take(at, 2 if op == "~" else 3)
            self.say(f"{target}=~{values[0]}" if op == "~" else f"{target}={values[1]}{op}{values[0]}")
        elif word == "WX":
            self.say(f"WAIT{AXES[int(argument)]}")
        elif word in ("DD", "DV"):
            self.say(f"DELAY={'V' if word == 'DV' else ''}{argument}")
        else:
            raise Undecodable(at, self.lines[at])

    def jump(self, at: int, word: str) -> int:
        """The target of the JR or JO of line `at`."""
        found = split(self.lines[at]) if at < len(self.lines) else None
        if found is None or found[0] != word or not at < at + int(found[1]) < len(self.lines):
            raise Undecodable(at, self.lines[at] if at < len(self.lines) else "")
        return at + int(found[1])

    def end_of_if(self, at: int) -> int:
        """Find the EI0 of the IF whose JR is line `at`, by that JR or by the JO before its target."""
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
            self.loops.append(at)
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
            if word == "JM-" and at - argument != self.loops.pop():
                raise Undecodable(at, self.lines[at])
        else:
            raise Undecodable(at, self.lines[at])
        return at + 1
