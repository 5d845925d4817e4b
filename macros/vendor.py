"""Function-key strings in the vendors' notation, one key a line: `F2 MR 51200^M^p ; comment`.

`^M` or `^J`, or both, end a line. `^[` and `^C` stop. `^p` is a pause of 1 s, `^m` of 50 ms, `^d<ms>` of any length.
`^r<n>` does what precedes it n times in all, `^f<n>` plays another key. A key's macro is named `f<n>`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from multidrop.base.errors import Diagnostic
from multidrop.base.files import lines_of
from multidrop.base.text import visible
from multidrop.macros.model import KEYS, Macro, MacroStep, escape, fill

MOST_LINES = 10_000
"""The largest number of lines that repetitions make of a string."""
LONGEST_PAUSE_MS = 86_400_000
"""The longest pause, ms."""
SLEEP = re.compile(r"/sleep\s+(?P<seconds>\d{1,5}(\.\d{0,3})?|\.\d{1,3})")
PLAY = re.compile(r"/play\s+f(?P<number>[1-9]\d?)")
STOP = "/stop"
REMARK = "^[ and ^C became /stop, after which no line runs"
_ROW = re.compile(r"F(?P<number>[1-9]\d?)\s+(?P<text>.*?)\s*(?:(?<=\s);(?:\s+(?P<note>.*?))?)?\s*", re.IGNORECASE)
_TOKEN = re.compile(
    r"\^(?:(?P<end>M(?:\^J)?|J)|(?P<stop>\[|C)|(?P<pause>[pm])|(?P<word>[drf])(?P<number>\d*))|(?P<text>[^^]+)"
)
_PAUSES = {"p": 1000, "m": 50}
_NAME = re.compile(r"f(?P<number>[1-9]\d?)")


@dataclass
class _Steps:
    """The steps of one string so far."""

    where: str
    done: list[MacroStep] = field(default_factory=list)
    text: str = ""
    pause: int = 0
    """The pause before the next line, ms."""
    stopped: bool = False
    """The last token was a stop, whose line end belongs to it."""

    def wrong(self, column: int, message: str, hint: str = "") -> Diagnostic:
        return Diagnostic(message, f"{self.where}:{column}", hint or "nothing was imported")

    def add(self, line: str) -> None:
        self.done.append(MacroStep(self.pause / 1000, line))
        self.pause = 0
        if len(self.done) > MOST_LINES:
            raise self.wrong(1, f"more than {MOST_LINES} lines")

    def take(self, match: re.Match[str], column: int) -> None:
        if (text := match["text"]) is not None:
            if not self.text and text.lstrip().startswith(("/", "@")):
                raise self.wrong(column, f"{text.lstrip()[0]} at the beginning of a line would be multidrop's own")
            if visible(text, tabs=True) != text:
                raise self.wrong(column, f"a control character in {visible(text)}")
            self.text += text
            self.stopped = False
            return
        if match["end"] is not None:
            if text := self.text.strip(" \t"):
                self.add(escape(text))
            elif not self.stopped:
                raise self.wrong(column, "an empty line cannot be sent")
            self.text, self.stopped = "", False
            return
        self.stopped = False
        if self.text:
            raise self.wrong(column, f"{match[0]} in the middle of a line", "^M ends the line first")
        if match["stop"] is not None:
            self.add(STOP)
            self.stopped = True
        elif match["pause"] is not None:
            self._wait(_PAUSES[match["pause"]], column)
        else:
            self._word(match["word"], match["number"], column)

    def _wait(self, milliseconds: int, column: int) -> None:
        self.pause += milliseconds
        if self.pause > LONGEST_PAUSE_MS:
            raise self.wrong(column, "a pause of more than a day")

    def _word(self, word: str, digits: str, column: int) -> None:
        if not digits or len(digits) > 9:
            raise self.wrong(column, f"^{word}{digits} needs a number", "valid: ^d<ms>, ^r<n>, ^f<n>")
        number = int(digits)
        if word == "d":
            self._wait(number, column)
        elif word == "f":
            self.add(f"/play f{number}")
        elif not self.done or not number:
            raise self.wrong(column, f"^r{number} repeats nothing")
        elif len(self.done) * number > MOST_LINES:
            raise self.wrong(column, f"^r{number} makes more than {MOST_LINES} lines")
        else:
            first, *rest = self.done
            again = MacroStep(first.after + self.pause / 1000, first.line)
            self.done += [again, *rest] * (number - 1)

    def macro_steps(self, column: int) -> tuple[MacroStep, ...]:
        """The steps once all is read; a pause at the end sleeps."""
        if self.text.strip():
            raise self.wrong(column, "the last line has no ^M", "without it the line would not be sent")
        if self.pause:
            seconds, self.pause = self.pause / 1000, 0
            self.add(f"/sleep {seconds:g}")
        if not self.done:
            raise self.wrong(column, "nothing to send")
        return tuple(self.done)


def imported(text: str, where: str, known: Iterable[str] = ()) -> list[Macro]:
    """The macros of a file of function keys. `known`: macros that a chain may name besides.

    Raises Diagnostic with file, line and column for what has no counterpart.
    """
    macros: dict[str, Macro] = {}
    for number, row in enumerate(lines_of(text, where), 1):
        if row.strip() and not row.lstrip().startswith((";", "#")):
            macro = _macro(row, f"{where}:{number}")
            if macro.name in macros:
                raise Diagnostic(f"F{macro.name[1:]} is defined twice", f"{where}:{number}", "nothing was imported")
            macros[macro.name] = macro
    if not macros:
        raise Diagnostic("no function keys", where, "valid: one key a line, F2 STRING")
    _check_chains(macros, where, set(known))
    return list(macros.values())


def _macro(row: str, where: str) -> Macro:
    match = _ROW.fullmatch(row)
    if match is None:
        raise Diagnostic("not a function key", f"{where}:1", "valid: F2 STRING, or F2 STRING ; comment")
    steps, at = _Steps(where), match.start("text")
    end = match.end("text")
    while at < end:
        token = _TOKEN.match(row, at, end)
        if token is None:
            raise steps.wrong(at + 1, f"{row[at : at + 2]} has no counterpart")
        steps.take(token, at + 1)
        at = token.end()
    name, note = f"f{match['number']}", visible(" ".join((match["note"] or "").split()))
    lines = steps.macro_steps(end + 1)
    if any(step.line == STOP for step in lines):
        note = note if REMARK in note else f"{note} ({REMARK})".strip()
    key = name.upper() if name.upper() in KEYS else ""
    return Macro(name, lines, key, note)


def _check_chains(macros: Mapping[str, Macro], where: str, known: set[str]) -> None:
    chains = {
        name: [f"f{match['number']}" for step in macro.steps if (match := PLAY.fullmatch(step.line))]
        for name, macro in macros.items()
    }
    for name, others in chains.items():
        for other in others:
            if other not in macros and other not in known:
                what = f"{name.upper()} calls {other.upper()}, which is not there"
                raise Diagnostic(what, where, "nothing was imported")
        way, seen = list(others), set[str]()
        while way:
            other = way.pop()
            if other == name:
                hint = "nothing was imported; /play can repeat a macro"
                raise Diagnostic(f"{name.upper()} calls itself in the end", where, hint)
            if other not in seen:
                seen.add(other)
                way += chains.get(other, ())


def exported(macros: Iterable[Macro]) -> str:
    """The text of a file of function keys. Raises Diagnostic for what has no counterpart in the notation."""
    rows: dict[int, str] = {}
    for macro in macros:
        match = _NAME.fullmatch(macro.name)
        digits = match["number"] if match else macro.key[1:]
        if not digits:
            hint = f"/key F3 {macro.name} gives it one"
            raise Diagnostic("it is on no function key", f"macro {macro.name}", hint)
        number = int(digits)
        if number in rows:
            raise Diagnostic(f"F{number} is taken by another macro", f"macro {macro.name}", "/key gives it another one")
        note = " ".join(visible(macro.note.replace(f"({REMARK})", "")).split())
        rows[number] = f"F{number} {_string(macro)}{f' ; {note}' if note else ''}\n"
    return "".join(rows[number] for number in sorted(rows))


def is_key_name(name: str) -> bool:
    return _NAME.fullmatch(name) is not None


def _string(macro: Macro) -> str:
    where = f"macro {macro.name}"
    for what, present in (("a role", macro.roles), ("a value", macro.parameters), ("on_early_end", macro.on_early_end)):
        if present:
            raise Diagnostic(f"{what} has no counterpart in function keys", where, "nothing was exported")
    parts: list[str] = []
    slept = 0
    for number, step in enumerate(macro.steps, 1):
        place = macro.where(number)
        pause = max(_milliseconds(step.after, place), slept)
        slept, text = _part(step.line.strip(), place)
        part = _pause(pause, text, place) + text
        if parts and parts[-1][-1:].isdigit() and part[:1].isdigit():
            what = "a line that begins with a digit after ^f has no counterpart"
            raise Diagnostic(what, place, "nothing was exported")
        parts.append(part)
    if not (string := "".join([*parts, _pause(slept, "", where)])):
        raise Diagnostic("a macro that does nothing has no counterpart", where, "nothing was exported")
    return string


def _part(line: str, where: str) -> tuple[int, str]:
    """The pause that a line is, ms, and its text in the notation."""
    if line == STOP:
        return 0, "^["
    if match := PLAY.fullmatch(line):
        return 0, f"^f{match['number']}"
    if match := SLEEP.fullmatch(line):
        return _milliseconds(float(match["seconds"]), where), ""
    text = fill(line, {}, where)
    if not text or text.startswith(("/", "@")) or re.search(r"\^|\s;", text) or visible(text, tabs=True) != text:
        raise Diagnostic(f"{visible(line)!r} has no counterpart in function keys", where, "nothing was exported")
    return 0, f"{text}^M"


def _milliseconds(seconds: float, where: str) -> int:
    milliseconds = round(seconds * 1000)
    if abs(milliseconds - seconds * 1000) > 1e-6 or milliseconds > LONGEST_PAUSE_MS:
        hint = "valid: whole milliseconds, up to a day"
        raise Diagnostic(f"a pause of {seconds:g} s has no counterpart", where, hint)
    return milliseconds


def _pause(milliseconds: int, text: str, where: str) -> str:
    """A pause in the notation, before a text."""
    seconds, rest = divmod(milliseconds, 1000)
    if seconds <= 5 and not rest % 50:
        return "^p" * seconds + "^m" * (rest // 50)
    if not text[:1].isdigit():
        return f"^d{milliseconds}"
    if milliseconds % 50:
        what = f"a pause of {milliseconds} ms before a digit has no counterpart"
        raise Diagnostic(what, where, "nothing was exported")
    return f"^d{milliseconds - 50}^m"
