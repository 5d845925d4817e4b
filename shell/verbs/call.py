"""One use of a verb."""

from __future__ import annotations

from collections.abc import Coroutine
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from multidrop.base.errors import Diagnostic
from multidrop.drives.drive import Drive
from multidrop.shell.events import By
from multidrop.shell.line_syntax import split_target
from multidrop.shell.operations.verb import Chosen, Verb
from multidrop.shell.session import Session

if TYPE_CHECKING:
    from multidrop.macros import Macro


@dataclass(frozen=True)
class Call:
    """One use of a verb: where it works, the text after its name, and its origin."""

    session: Session
    verb: Verb
    rest: str
    by: By = By.OPERATOR
    shown: str | Macro | None = None
    """What a person was shown of the file that the line names; see `line_syntax.VerbLine`."""

    @cached_property
    def chosen(self) -> Chosen:
        """The form of the line, and its values. Raises Diagnostic for words that are no arguments of the verb."""
        return self.verb.parsed(self.rest)

    @property
    def changes(self) -> bool:
        """Whether the line changes a drive, or lets it run. Raises Diagnostic as `chosen` does."""
        return self.chosen.form.changes

    @property
    def immediate(self) -> bool:
        """Whether it is done at once."""
        return self.chosen.form.immediate

    def work(self) -> Coroutine[Any, Any, None]:
        """What the line does."""
        return self.chosen.form.work(self, self.chosen.values)

    def recorded(self) -> str | None:
        """The line that a macro records; None: none."""
        recorded = self.chosen.form.recorded
        return recorded(self) if recorded is not None else None

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
