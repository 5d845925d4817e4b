"""The conversion of a program file for other drives, and the difference that it makes.

The program before a conversion and that after it run on simulated drives, in worlds that differ in what their inputs
see. Alike are prints, changes of outputs, errors and the end; of two programs that ended, the position too. Of two that
were cut off, one may be a little ahead: what one of them has not come to yet is no difference, up to a fifth of what
the other has done.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

from multidrop.base.errors import Diagnostic
from multidrop.base.files import program_text_of
from multidrop.dialects.families import program_language_of, program_languages
from multidrop.dialects.program_files import Conversion, Converter, Problem, errors, refuse
from multidrop.shell.programs.checking import examine_text
from multidrop.simulator.families import PROGRAMS

if TYPE_CHECKING:
    from multidrop.simulator.program_run import Load

LENGTH_TOLERANCE = 0.2
"""The part that one of two programs without an end may be ahead, and one beyond that."""


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
    program = converter.convert(text, target)
    if not program.refused:
        wrong = errors(examine_text(program.text, file, target, language).problems)
        program = program._replace(refused=[_placed(each, program.inserted) for each in wrong])
    return Converted(file, text, language, source, target, program, converter)


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
    from multidrop.simulator.program_events import DebugWishes, Summary

    lists: dict[str, list[str]] = {"print": [], "outputs": [], "error": []}
    table = {"personality": personality, "world": world}
    for event in load(read_drive(table, personality)).run("", until, DebugWishes(outputs=True)):
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
        if at < both or (
            len(mine) != len(yours) and not (cut and abs(len(mine) - len(yours)) <= 1 + LENGTH_TOLERANCE * both)
        ):
            count = f"{len(mine)}, converted: {len(yours)}"
            if what == "motions":
                return f"motions: {count}"
            shown = [repr(side[at]) if at < len(side) else "no more" for side in (mine, yours)]
            return f"{what} {at + 1}: {shown[0]}, converted: {shown[1]}"
    return "" if cut or one.position == other.position else f"position: {one.position}, converted: {other.position}"
