"""One use of a verb."""

from __future__ import annotations

from collections.abc import Coroutine, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from inspect import iscoroutine
from pathlib import Path
from typing import TYPE_CHECKING, Any

from multidrop.base.errors import Diagnostic
from multidrop.drives.drive import Drive
from multidrop.shell.events import By
from multidrop.shell.line_syntax import split, split_target
from multidrop.shell.operations.table import AnyVerb
from multidrop.shell.operations.usage import limits
from multidrop.shell.operations.verb import Chosen, Verb
from multidrop.shell.session import Session

if TYPE_CHECKING:
    from multidrop.macros import Macro


def words(verb: AnyVerb, rest: str) -> list[str]:
    """The words after the name, without quotes. Raises Diagnostic for a number that no form of the usage has."""
    found = split(rest, verb.name)
    low, high = limits(verb.usage)
    if not low <= len(found) <= high:
        raise verb.wrong()
    return found


@dataclass(frozen=True)
class Call:
    """One use of a verb: where it works, the text after its name, and its origin."""

    session: Session
    verb: AnyVerb
    rest: str
    by: By = By.OPERATOR
    shown: str | Macro | None = None
    """What a person was shown of the file that the line names; see `line_syntax.VerbLine`."""

    @cached_property
    def chosen(self) -> Chosen:
        """The form of the line, and its values. Raises Diagnostic for words that are no arguments of the verb."""
        assert isinstance(self.verb, Verb)
        return self.verb.parsed(self.rest)

    @property
    def changes(self) -> bool:
        """Whether the line changes a drive, or lets it run. Raises Diagnostic as `chosen` does."""
        if isinstance(self.verb, Verb):
            return self.chosen.form.changes
        changes = self.verb.changes
        return changes is not None and (not changes or [*self.rest.split(), ""][0] in changes)

    @property
    def immediate(self) -> bool:
        """Whether it is done at once."""
        return self.chosen.form.immediate if isinstance(self.verb, Verb) else self.verb.immediate

    def work(self) -> Coroutine[Any, Any, None]:
        """What the line does."""
        if isinstance(self.verb, Verb):
            return self.chosen.form.work(self, self.chosen.values)
        work: Coroutine[Any, Any, None] = self.verb.imported(self.verb.work)(self)
        if not iscoroutine(work):  # by others
            raise Diagnostic(f"{self.verb.name} has no async function")
        return work

    def recorded(self) -> str | None:
        """The line that a macro records; None: none."""
        if isinstance(self.verb, Verb):
            recorded = self.chosen.form.recorded
            return recorded(self) if recorded is not None else None
        if self.verb.recorded == "typed":
            return f"{self.verb.name} {self.rest}".strip()
        return str(self.verb.imported(self.verb.recorded)(self)) if self.verb.recorded else None

    def words(self) -> list[str]:
        """The words after the name, without quotes. Raises Diagnostic for a number that no form of the usage has."""
        return words(self.verb, self.rest)

    def word(self) -> str:
        """The only word; empty where there is none."""
        return "".join(self.words()[:1])

    def split(self) -> list[str]:
        """The words after the name, without quotes, however many there are."""
        return split(self.rest, self.verb.name)

    def sort(
        self, flags: Sequence[str], values: Mapping[str, str], *, listed: bool = False
    ) -> tuple[list[str], list[tuple[str, str]]]:
        """Sort the words into places and options, which are in any order. Raises Diagnostic.

        `values` names the value that an option needs. `listed`: an error names the valid ones.
        """
        places: list[str] = []
        options: list[tuple[str, str]] = []
        left = iter(self.split())
        for word in left:
            if any(word == name for name, _ in options):
                raise self.wrong(f"{word} is given twice")
            value = next(left, "") if word in values else ""
            if word in values and not value:
                raise self.wrong(f"{word} needs {values[word]}")
            if word in flags or word in values:
                options.append((word, value))
            elif not word.startswith("--"):
                places.append(word)
            elif listed:
                valid = f"valid: {', '.join((*flags, *values))}"
                raise Diagnostic(f"no option {word}", self.verb.name, valid)
            else:
                raise self.wrong(f"no option {word}")
        return places, options

    def output_file(self, name: str) -> str:
        """Return the path of a file to write. Raises Diagnostic for a macro's that leaves the current folder.

        A macro may be another person's file: it must not overwrite files elsewhere.
        """
        if self.by is By.MACRO and not Path(name).resolve().is_relative_to(Path.cwd().resolve()):
            hint = "name a file inside it, or type the line"
            raise Diagnostic(f"{name} leaves the current folder, in which a macro writes", self.verb.name, hint)
        return name

    def warn_of_editor(self, file: str | Path) -> None:
        """Warn where a text of a file that the line reads is in the editor of the screen, and not saved."""
        unsaved = self.session.front.unsaved
        if not isinstance(self.shown, str) and unsaved is not None and str(Path(file).absolute()) in unsaved():
            text = f"{file}: its text in the editor is not saved; the file on the disk is used"
            self.session.notify(text, warning=True)

    def wrong(self, message: str = "") -> Diagnostic:
        return self.verb.wrong(message)

    def drive(self, target: str = "") -> Drive:
        """Find the drive of `ADDR` or `BUS:ADDR`; the selected drive for an empty target."""
        bus, address = split_target(target)
        return self.session.drive(bus, address or None)
