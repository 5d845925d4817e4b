"""The check of program files, and their rewriting in canonical spelling.

Errors in the text have line and column. A simulated drive then loads the correct lines and refuses what that drive
would refuse, so that one run reports everything. An error that only follows from another one is not reported.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

from multidrop.base.errors import Diagnostic
from multidrop.base.files import encoded_program_of, program_text_of, split_lines, why
from multidrop.dialects.families import correct_in, program_language_of, program_languages
from multidrop.dialects.program_files import Problem, errors, in_order, refuse
from multidrop.simulator.cell.spec import DriveSpec
from multidrop.simulator.declared import simulated
from multidrop.simulator.families import PROGRAMS

if TYPE_CHECKING:
    pass

USUAL_PERSONALITY = DriveSpec().personality
"""The product for which programs are checked unless another one is named."""
LONGEST_GUESSED_TEXT = 65536
"""Characters of a text that may be in another language; more than fit into any drive."""


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
    if not named and len(text) <= LONGEST_GUESSED_TEXT:
        lines = sum(bool(line.strip()) for line in split_lines(text))
        mostly_wrong = 3 * len({error.line for error in errors(problems)}) >= lines > 0
        if mostly_wrong and (other := _other_language(text, language)) is not None:
            return Checked(file, [other])
    more = PROGRAMS[language].refusals(text, file, personality, problems)  # what a simulated drive refuses besides
    problems = in_order([*problems, *more])
    if errors(problems):
        return Checked(file, problems)
    return Checked(file, problems, f"nothing wrong, {source.measure(text)}", text, source.formatted(text), encoding)


def personality_of(language: str, product: str) -> str:
    """Return the product if its drives run programs of that language, else the usual one of those that do."""
    known = simulated()[language].personalities
    return product if product in known else USUAL_PERSONALITY if USUAL_PERSONALITY in known else known[0]


def ending_of(product: str) -> str:
    """Return the usual ending of program files for a product; that of the usual language where it has none."""
    known = program_languages()
    names = [name for name, row in simulated().items() if name in known and product.startswith(row.personalities)]
    return known[(names or list(known))[0]].endings[0]


def _other_language(text: str, language: str, verb: str = "check it with") -> Problem | None:
    """Report that a text is a correct program of another language; None if it is not. `verb`: what to do as well."""
    if not (name := correct_in(text, language)):
        return None
    known = program_languages()
    hint = f"name it {' or '.join(known[name].endings)}, or {verb} --language {name}"
    return Problem(1, 1, f"this is {known[name].title}, not {known[language].title}", hint)


def correct_text_of(file: str) -> str:
    """Read a program file. Raises Diagnostic for one that is correct in no language, in the language of its name."""
    language, text = program_language_of(file), program_text_of(file)
    if not correct_in(text, language):
        program_languages()[language].language.read(text, file)
    return text


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
