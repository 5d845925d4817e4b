"""The check of program files, their rewriting in canonical spelling, and their conversion for other drives.

Errors in the text have line and column. A simulated drive then loads the correct lines and refuses what that drive
would refuse, so that one run reports everything. An error that only follows from another one is not reported.

The program before a conversion and that after it run on simulated drives, in worlds that differ in what their inputs
see. Alike are prints, changes of outputs, errors and the end; of two programs that ended, the position too. Of two that
were cut off, one may be a little ahead: what one of them has not come to yet is no difference, up to a fifth of what
the other has done.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, cast

from multidrop.base.errors import Diagnostic
from multidrop.base.files import encoded_program_of, program_text_of, split_lines, why
from multidrop.dialects.families import correct_in, program_language_of, program_languages
from multidrop.dialects.program_files import Conversion, Converter, Problem, errors, in_order, refuse
from multidrop.simulator.cell.spec import DriveSpec
from multidrop.simulator.families import PROGRAMS, TABLE

if TYPE_CHECKING:
    from multidrop.simulator.program_run import Load

USUAL = DriveSpec().personality
"""The product for which programs are checked unless another one is named."""
LONGEST = 65536
"""Characters of a text that may be in another language; more than fit into any drive."""
AHEAD = 0.2
"""The part that one of two programs without an end may be ahead, and one beyond that."""


@dataclass(frozen=True)
class Checked:
    """The problems of a file, its description, and its text as it is and in canonical spelling."""

    file: str
    problems: Sequence[Problem]
    facts: str = ""
    text: str = ""
    spelled: str = ""
    encoding: str = ""

    @property
    def right(self) -> bool:
        """True if there is nothing but warnings."""
        return not errors(self.problems)

    @property
    def respelled(self) -> int:
        """The number of lines that the canonical spelling changes; 0 for a file with errors."""
        lines = zip(split_lines(self.text), split_lines(self.spelled), strict=True)
        return sum(old != new for old, new in lines) if self.right else 0


def examine(
    file: str, personality: str, language: str = "", reported: Mapping[str, tuple[str, str]] = MappingProxyType({})
) -> Checked:
    """Check one file for a product; its name gives the language. Raises Diagnostic if it cannot be read.

    `reported`: for the product of one unit, the version and the part number that it prints.
    """
    text, encoding = encoded_program_of(file)
    checked = examine_text(text, file, personality, language, encoding)
    files = program_languages()[language or program_language_of(file)]
    more = files.unsupported(text, personality, *reported.get(personality, ("", "")))
    return replace(checked, problems=in_order([*checked.problems, *more]))


def examine_text(text: str, file: str, personality: str, language: str = "", encoding: str = "utf-8") -> Checked:
    """Check a text that a file of that name holds, or will hold; see `examine`."""
    named, language = language, language or program_language_of(file)
    source = program_languages()[language].language
    problems = source.check(text, personality)
    if not named and len(text) <= LONGEST:
        lines = sum(bool(line.strip()) for line in split_lines(text))
        mostly_wrong = 3 * len({each.line for each in errors(problems)}) >= lines > 0
        if mostly_wrong and (other := _other_language(text, language)) is not None:
            return Checked(file, [other])
    refusals = PROGRAMS[language].refusals  # what a simulated drive refuses beyond what the text alone shows
    more = refusals(text, file, personality, problems) if refusals is not None else []
    problems = in_order([*problems, *more])
    if errors(problems):
        return Checked(file, problems)
    return Checked(file, problems, f"nothing wrong, {source.measure(text)}", text, source.formatted(text), encoding)


def personality_of(language: str, product: str) -> str:
    """Return the product if its drives run programs of that language, else the usual one of those that do."""
    known = TABLE[language].personalities
    return product if product in known else USUAL if USUAL in known else known[0]


def ending_of(product: str) -> str:
    """Return the usual ending of program files for a product; that of the usual language where it has none."""
    known = program_languages()
    names = [name for name, row in TABLE.items() if name in known and product.startswith(row.personalities)]
    return known[(names or list(known))[0]].endings[0]


def _other_language(text: str, language: str, verb: str = "check it with") -> Problem | None:
    """Report that a text is a correct program of another language; None if it is not. `verb`: what to do as well."""
    if not (name := correct_in(text, language)):
        return None
    known = program_languages()
    hint = f"name it {' or '.join(known[name].endings)}, or {verb} --language {name}"
    return Problem(1, 1, f"this is {known[name].title}, not {known[language].title}", hint)


def to_run(file: str, language: str = "") -> tuple[str, str]:
    """Return the text of a program file that is to be run, and its language: as given, else by its name.

    Raises Diagnostic if it cannot be read, or is a program of another language than its name says.
    """
    text = program_text_of(file)
    spoken = language or program_language_of(file)
    if not language and errors(program_languages()[spoken].language.check(text)):
        other = _other_language(text, spoken, "give")
        refuse([other] if other is not None else [], file)
    return text, spoken


def rewrite(checked: Checked) -> None:
    """Replace a correct file by its canonical spelling, if that differs. Raises Diagnostic; the file is then as it was.

    Only a regular file is replaced, whole or not at all.
    """
    if not checked.respelled:
        return
    from pathlib import Path  # both are more than a mere check needs

    from multidrop.base.atomic import write_atomically

    if not os.path.isfile(checked.file):
        raise Diagnostic("is not a regular file", checked.file, "only a regular file is rewritten")
    if not os.access(checked.file, os.W_OK):  # a replacement would not heed that
        raise Diagnostic("cannot be written: it is read-only", checked.file, "the file is as it was")
    if encoded_program_of(checked.file)[0] != checked.text:
        raise Diagnostic("has changed since it was checked", checked.file, "check it again; the file is as it was")
    try:
        write_atomically(Path(checked.file), checked.spelled.encode(checked.encoding))
    except OSError as problem:
        raise Diagnostic(f"cannot be written: {why(problem)}", checked.file, "the file is as it was") from problem


@dataclass(frozen=True)
class Converted:
    """A file, the product that it is for, its conversion and the product of that."""

    file: str
    text: str
    language: str
    source: str
    target: str
    found: Conversion
    converter: Converter

    def differences(self, until: float) -> Iterator[tuple[str, str]]:
        """Run both in each world; yield its description and the difference, empty for none. Raises Diagnostic."""
        read = PROGRAMS[self.language].read
        first, second = read(self.text, self.file), read(self.found.text, self.file)
        for said, world, other_world in self.converter.worlds(self.text):
            done = _done(first, self.source, world, until)
            yield said, _difference(done, _done(second, self.target, other_world, until))


def convert(file: str, to: str, personality: str | None) -> Converted:
    """Convert a file. Raises Diagnostic for one with errors, for other drives, or for another product."""
    language, text = program_language_of(file), program_text_of(file)
    place = program_languages()[language].converters.get(to)
    if place is None:
        raise Diagnostic(f"{program_languages()[language].title} cannot be converted for {to}", file)
    converter = cast(Converter, importlib.import_module(place))
    target = personality or converter.TARGETS[0]
    if target not in converter.TARGETS:
        raise Diagnostic(f"no {to} is {target}", "--personality", f"valid: {', '.join(converter.TARGETS)}")
    try:
        source = converter.source(text)
    except Diagnostic as problem:
        raise Diagnostic(problem.message, f"{file}: {problem.where}", problem.hint) from None
    refuse(examine_text(text, file, source, language).problems, file)
    found = converter.convert(text, target)
    if not found.refused:
        wrong = errors(examine_text(found.text, file, target, language).problems)
        found = found._replace(refused=[_placed(each, found.inserted) for each in wrong])
    return Converted(file, text, language, source, target, found, converter)


def _placed(problem: Problem, inserted: int) -> Problem:
    """A problem of the new text, at the line of the original."""
    after = bool(inserted) and problem.line > inserted
    return problem._replace(line=problem.line - after, what=f"once converted: {problem.what}")


@dataclass(frozen=True)
class _Done:
    """What a run has shown: lists of texts, motions begun, and how it ended."""

    lists: Mapping[str, Sequence[str]]
    ended: str
    position: object


def _done(load: Load, personality: str, world: Mapping[str, Any], until: float) -> _Done:
    from multidrop.simulator.cells import read_drive
    from multidrop.simulator.program_run import Debugging, Summary

    lists: dict[str, list[str]] = {"print": [], "outputs": [], "error": []}
    table = {"personality": personality, "world": world}
    for event in load(read_drive(table, personality)).run("", until, Debugging(outputs=True)):
        fact = event.fact(0.0)
        for key, value in lists.items():
            value += [str(fact[key])] if key in fact else []
    assert isinstance(event, Summary)
    return _Done({**lists, "motions": ["motion"] * event.moves}, event.ended, event.position)


def _difference(one: _Done, other: _Done) -> str:
    """The first difference of two runs, as `WHAT: ONE, converted: OTHER`."""
    if one.ended != other.ended:
        return f"ended by {one.ended}, converted: by {other.ended}"
    cut = one.ended == "until"
    for what, mine in one.lists.items():
        yours = other.lists[what]
        both = min(len(mine), len(yours))
        at = next((n for n in range(both) if mine[n] != yours[n]), both)
        if at < both or (len(mine) != len(yours) and not (cut and abs(len(mine) - len(yours)) <= 1 + AHEAD * both)):
            count = f"{len(mine)}, converted: {len(yours)}"
            if what == "motions":
                return f"motions: {count}"
            shown = [repr(each[at]) if at < len(each) else "no more" for each in (mine, yours)]
            return f"{what} {at + 1}: {shown[0]}, converted: {shown[1]}"
    return "" if cut or one.position == other.position else f"position: {one.position}, converted: {other.position}"
