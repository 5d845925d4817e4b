"""Scripts and macros read and checked whole, with everything that they call, before anything is sent.

Values that are known beforehand (`--set`, `NAME=VALUE`) are filled in. A name of `/set` counts as known from its line
on where every way through the blocks sets it; the check takes it as 0.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple, TypeVar

from multidrop.base.comments import uncommented
from multidrop.base.errors import Diagnostic
from multidrop.base.files import bounded, bytes_of, lines_of, utf8, why
from multidrop.macros import Macro, MacroStore, check_name, checked_values, fill, parse_macro, value_names
from multidrop.macros.model import MacroParameter, plain, written
from multidrop.macros.toml_format import in_text
from multidrop.shell.line_syntax import ENDS, VerbLine, parse
from multidrop.shell.operations.operation import VerbKind
from multidrop.shell.operations.table import find, script_verb
from multidrop.shell.scripts import words
from multidrop.shell.scripts.model import (
    CallFile,
    CallMacro,
    If,
    MacroScript,
    Node,
    Repeat,
    Script,
    ScriptLine,
    ScriptStep,
)
from multidrop.shell.scripts.use import LineCheck, chosen
from multidrop.shell.session import BARE_WORDS, bare

BLOCKS = (VerbKind.IF, VerbKind.COUNT, VerbKind.WHILE)
"""What begins a block."""
UNKNOWN = "0"
"""Stands for a value that is only known when the line is executed."""


def steps_of(macro: Macro, macros: MacroStore | None) -> tuple[list[ScriptLine], list[ScriptLine]]:
    """The lines of a macro and of its end. Without a file of this macro their places are its steps alone."""
    at = _places(macro, macros)
    steps = [
        ScriptLine(*at("line", number), plain(step.line).strip(ENDS), macro.name, number, step.after)
        for number, step in enumerate(macro.steps, 1)
    ]
    on_early_end = [
        ScriptLine(*at("on_early_end", 0), plain(line).strip(ENDS), macro.name) for line in macro.on_early_end
    ]
    return steps, on_early_end


def _places(macro: Macro, macros: MacroStore | None) -> Callable[[str, int], tuple[str, int]]:
    """The file and line of each key; no file for a macro that is in none."""
    data = macros.contents(macro.name) if macros is not None else None
    text = data.decode("utf-8-sig", "replace") if data is not None else ""
    try:
        same = data is not None and parse_macro(text) == macro
    except Diagnostic:
        same = False
    if macros is None or not same:
        return lambda key, step: ("", 0)
    file, find = str(macros.path(macro.name)), in_text(text, "-")

    def at(key: str, step: int) -> tuple[str, int]:
        place = find(key, step)
        return file, 0 if place == "-" else int(place.rpartition(":")[2])

    return at


def stand_in(parameter: MacroParameter) -> str:
    """A valid value in place of one that is only known when the line is executed."""
    if parameter.choices:
        return parameter.choices[0]
    if parameter.kind == "text":
        return UNKNOWN
    low, high = (0 if limit is None else limit for limit in (parameter.low, parameter.high))
    return written(low if low > 0 else min(0, high) if parameter.high is not None else 0)


T = TypeVar("T")
INPUT = "-"
"""The name of standard input."""
DEEPEST_BLOCKS = 50
"""The deepest nesting of blocks."""
MOST_CALLS = 1000
"""The largest number of calls that a check follows."""
Names = Mapping[str, str | None]
"""The names with a value, and the value where it is known beforehand."""


class ReadFrom(NamedTuple):
    """A file or macro on the way to a line."""

    identity: str
    shown: str


Chain = tuple[ReadFrom, ...]


class WrongScript(Diagnostic):
    """A script with errors. It reads as the first of them."""

    def __init__(self, problems: Sequence[Diagnostic]) -> None:
        super().__init__(problems[0].message, problems[0].where, problems[0].hint)
        self.problems = tuple(problems)


def read_script(file: str, values: Mapping[str, str], macros: MacroStore | None = None) -> Script:
    """Read and check a script file (`-`: standard input), and every file that it calls.

    Raises WrongScript with every error, each with `file:line`; Diagnostic for a file that cannot be read, and for a
    value that no line uses.
    """
    reader = _ScriptReader(values, macros)
    script = reader.read(file, values, ())
    _all_used(file, values, reader.used)
    return script


def _all_used(file: str, given: Collection[str], used: Collection[str]) -> None:
    """Raise Diagnostic for values that no line uses: one with a wrong name would be left out without a word."""
    if left := [name for name in given if name not in used]:
        several = "s" if len(left) > 1 else ""
        taken = ", ".join(sorted(used)) or "no value"
        raise Diagnostic(f"no line takes the value{several} {', '.join(left)}", file, f"its lines take {taken}")


def read_macro(macro: Macro, given: Mapping[str, str], macros: MacroStore | None = None) -> MacroScript:
    """Check a macro, and everything that it calls. `given`: its values.

    Raises WrongScript with every error, each with the macro and the step; Diagnostic for wrong values.
    """
    values = checked_values(macro, given)
    return _ScriptReader({}, macros).macro_script(macro, values, ())


def source(file: str) -> list[ScriptLine]:
    """The lines of a script file without blank lines and comments. Raises Diagnostic."""
    if file.endswith(".py"):
        raise Diagnostic(
            "is Python, not a script of lines", file, "multidrop run executes it; a script of lines cannot call it"
        )
    text = utf8(_standard_input() if file == INPUT else bytes_of(file), file)
    numbered = ((number, uncommented(line)) for number, line in enumerate(lines_of(text, file), 1))
    return [ScriptLine(file, number, line) for number, line in numbered if line]


def _standard_input() -> bytes:
    try:
        return bounded(sys.stdin.buffer, INPUT)
    except OSError as error:
        raise Diagnostic(f"cannot be read: {why(error)}", INPUT) from None


class _ScriptReader:
    """Reads a script and what it calls; collects the errors of all of them."""

    def __init__(self, values: Mapping[str, str], macros: MacroStore | None) -> None:
        self.values = values
        self.macros = macros
        self.used: set[str] = set()
        """The names that lines of the files use."""
        self._calls = 0

    def read(self, file: str, values: Names, chain: Chain) -> Script:
        """Read and check a script file. Raises WrongScript."""
        if self._too_many():
            return Script(file, (), self.values)
        checker = _ScriptChecker(self, source(file), values, (*chain, ReadFrom(_identity(file), file)))
        body = checker.script()
        self.used |= checker.used
        if checker.problems:
            raise WrongScript(checker.problems)
        _all_used(file, values.keys() - self.values.keys(), checker.used)
        return Script(file, body, self.values)

    def macro_script(self, macro: Macro, values: Names, chain: Chain) -> MacroScript:
        """Check a macro. Raises WrongScript."""
        if self._too_many():
            return MacroScript(macro, (), (), {})
        chain = (*chain, ReadFrom(f"macro {macro.name}", macro.name))
        steps, on_early_end = steps_of(macro, self.macros)
        body = _ScriptChecker(self, steps, values, chain)
        ending = _ScriptChecker(self, on_early_end, values, chain)
        checked = MacroScript(macro, body.script(), ending.script(), _stood_in(values))
        if problems := [*body.problems, *ending.problems]:
            raise WrongScript(problems)
        return checked

    def _too_many(self) -> bool:
        """Count a call. Raises Diagnostic once there are too many; True for those after it."""
        self._calls += 1
        if self._calls == MOST_CALLS:
            raise Diagnostic(f"more than {MOST_CALLS} calls", hint="call in a /repeat")
        return self._calls > MOST_CALLS

    def macro(self, name: str) -> bool:
        try:
            check_name(name)
        except Diagnostic:
            return False
        return self.macros is not None and self.macros.contents(name) is not None


def _identity(file: str) -> str:
    return os.path.realpath(file) if file != INPUT else INPUT


class _ScriptChecker:
    """Checks one file: its blocks, and each of its lines as far as that is possible beforehand."""

    def __init__(self, reader: _ScriptReader, lines: Sequence[ScriptLine], values: Names, chain: Chain) -> None:
        self.problems: list[Diagnostic] = []
        self._reader = reader
        self._lines: Iterator[ScriptLine] = iter(lines)
        self._chain = chain
        self._depth = 0
        self.used = {name for line in lines for name in _used(line, values)}
        self._takes_any = any(line.word == "/raw" or re.search(r"\bPG\b", line.text, re.I) for line in lines)
        """Program mode or raw mode may take a word as it is."""
        changing = {name for line in lines if line.word == "/set" for name in line.text.split()[1:2]}
        changing |= {words.OUTCOME for line in lines if words.sets_outcome(line.text)}
        self._names: dict[str, str | None] = {n: None if n in changing else v for n, v in values.items()}

    def script(self) -> list[Node]:
        body, end = self._block()
        while end is not None:
            self._wrong(end, f"{end.word} without {'/if' if end.word == '/else' else 'a block'}")
            more, end = self._block()
            body += more
        return body

    def _block(self) -> tuple[list[Node], ScriptLine | None]:
        """The steps up to an `/else` or `/end`, and that line; None at the end of the file."""
        body: list[Node] = []
        for line in self._lines:
            if _kind(line) is VerbKind.BETWEEN:
                self._try(line, chosen)
                return body, line
            body.append(self._node(line))
        return body, None

    def _node(self, line: ScriptLine) -> Node:
        kind = _kind(line)
        if kind in BLOCKS:
            self._try(line, partial(self._check, line))
            self._depth += 1
            if self._depth > DEEPEST_BLOCKS:
                raise WrongScript(
                    [*self.problems, Diagnostic(f"blocks are nested deeper than {DEEPEST_BLOCKS}", line.where)]
                )
            node = self._if(line) if kind is VerbKind.IF else self._repeat(line)
            self._depth -= 1
            return node
        if kind is VerbKind.CALL:
            return self._try(line, lambda text: self._call(line, text)) or ScriptStep(line)
        if line.word == "/play":
            return self._try(line, lambda text: self._play(line, text)) or ScriptStep(line)
        self._try(line, partial(self._check, line))
        return ScriptStep(line)

    def _if(self, line: ScriptLine) -> If:
        before = dict(self._names)
        body, end = self._block()
        otherwise: list[Node] = []
        after, self._names = self._names, before
        if end is not None and end.word == "/else":
            otherwise, end = self._block()
        self._close(line, end)
        self._names = {name: value for name, value in after.items() if name in self._names}
        return If(line, body, otherwise)

    def _repeat(self, line: ScriptLine) -> Repeat:
        before = dict(self._names)
        body, end = self._block()
        self._close(line, end)
        text = words.rest_of(line.text)
        if not (_kind(line) is VerbKind.COUNT and text.isdecimal() and int(text) > 0):
            self._names = before
        return Repeat(line, body)

    def _close(self, line: ScriptLine, end: ScriptLine | None) -> None:
        if end is None:
            self._wrong(line, f"{line.word} has no /end")
        elif end.word == "/else":
            self._wrong(end, f"/else does not belong to the {line.word} of line {line.number}")
            self._close(line, self._block()[1])

    def _check(self, line: ScriptLine, text: str) -> None:
        """Check a filled line as far as that is possible without a drive."""
        word = line.word
        if script_verb(word) is not None:
            form = chosen(text)
            if (scripted := form.form.script) is not None and scripted.check is not None:
                checking = LineCheck(word, self._names, not self._unknown(line.text))
                scripted.check(checking, **form.values)
        elif words.sets_outcome(text):
            find(word).check(words.rest_of(text))
            self._names[words.OUTCOME] = None
        else:
            parsed = parse(text)
            if isinstance(parsed, VerbLine):
                verb = find(parsed.name)
                if not self._unknown(line.text):
                    verb.check(parsed.rest)
            elif not self._takes_any and (word := text.strip().lower()) in BARE_WORDS:
                raise bare(word)

    def _call(self, line: ScriptLine, text: str) -> Node:
        target, given = words.call(text)
        if self._unknown(words.call(line.text)[0]):
            hint = "only --set and NAME=VALUE of a /call may name it"
            raise Diagnostic("the file must be known before the first line is sent", "/call", hint)
        is_file, is_macro = os.path.exists(target), self._reader.macro(target)
        if is_file and is_macro:
            raise Diagnostic(
                f"{target} is a file and a macro", "/call", f"./{target} is the file, /play {target} the macro"
            )
        if is_macro:
            return self._play(line, text)
        if not is_file and os.sep not in target and "." not in target:
            raise Diagnostic(f"no file and no macro {target}", "/call", "paths are relative to the current folder")
        self._check_chain(ReadFrom(_identity(target), target), "/call")
        raw = words.call(line.text)[1]
        known: dict[str, str | None] = {n: None if self._unknown(raw.get(n, "")) else v for n, v in given.items()}
        return CallFile(line, self._reader.read(target, {**self._reader.values, **known}, self._chain))

    def _play(self, line: ScriptLine, text: str) -> Node:
        """Check the call of a macro: its values as far as they are known, and its lines."""
        call, raw = words.macro_call(text), words.macro_call(line.text)
        if self._unknown(raw.macro):
            raise Diagnostic("the macro must be known before the first line is sent", line.word)
        if self._reader.macros is None:
            raise Diagnostic(f"no macro {call.macro}", line.word)
        self._check_chain(ReadFrom(f"macro {call.macro}", call.macro), line.word)
        macro = self._reader.macros.load(call.macro)
        given, _ = call.divided(macro)
        unknown = {name for name in given if self._unknown(raw.given[name])}
        stand_ins = {parameter.name: stand_in(parameter) for parameter in macro.parameters if parameter.name in unknown}
        values = checked_values(macro, {**given, **stand_ins})
        names = {name: None if name in unknown else value for name, value in values.items()}
        played = self._reader.macro_script(macro, names, self._chain)
        return CallMacro(line, played, call.times, call.fast)

    def _check_chain(self, link: ReadFrom, word: str) -> None:
        """Refuse what is under way already."""
        if link.identity in [each.identity for each in self._chain]:
            way = " -> ".join([*(each.shown for each in self._chain), link.shown])
            raise Diagnostic(f"{link.shown} would call itself: {way}", word, "use /repeat")

    def _unknown(self, text: str) -> bool:
        """True if the text takes a value that is only known when the line is executed."""
        return any(self._names.get(name, "") is None for name in value_names(text))

    def _try(self, line: ScriptLine, work: Callable[[str], T]) -> T | None:
        """Fill a line and check it; keep its errors."""
        try:
            return work(fill(line.text, _stood_in(self._names)))
        except WrongScript as wrong:
            self.problems += wrong.problems
        except Diagnostic as problem:
            self._wrong(line, str(problem))
        return None

    def _wrong(self, line: ScriptLine, message: str) -> None:
        self.problems.append(Diagnostic(message, line.where))


def _kind(line: ScriptLine) -> VerbKind | None:
    """What a verb of scripts is to the lines around it; None for any other line."""
    verb = script_verb(line.word)
    return verb.script.kind if verb is not None and verb.script is not None else None


def _used(line: ScriptLine, given: Collection[str]) -> set[str]:
    """The names that a line uses: with braces, and those of `given` in an expression."""
    verb = script_verb(line.word)
    own = verb is not None and verb.script is not None and verb.script.bare
    bare = {*words.NAME.findall(words.rest_of(line.text))} if own else set()
    return value_names(line.text) | (bare & {*given})


def _stood_in(values: Names) -> dict[str, str]:
    return {name: UNKNOWN if value is None else value for name, value in values.items()}
