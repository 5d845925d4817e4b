"""What a person follows in the run of an MCode program: which line of the file comes next, what variables hold."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from dialects import Diagnostic
from dialects.mcode.manual.program_file import ProgramLine
from dialects.numbers import whole
from simulator.lexium.state.errors import Fault
from simulator.lexium.state.expressions import Read
from simulator.program_run import Debugging
from simulator.program_watch import BreakPoint, Followed, Recorder, Value, Values, split_break

LAST_LINE = 999_999


@dataclass(frozen=True)
class Subject:
    """The parts of a drive that are looked at: its time, its variables, labels and lines by address."""

    now: Callable[[], float]
    reader: Callable[[str], Read | None]
    values: Values
    labels: Mapping[str, int]
    index: Mapping[int, int]


class Watcher:
    """Looks at each line that the interpreter executes. Raises Diagnostic for a place or a name that is not there.

    `lines` are the lines of the file by line of the interpreter, `stored` by address.
    """

    def __init__(
        self,
        subject: Subject,
        debugging: Debugging,
        lines: Mapping[int, ProgramLine],
        stored: Mapping[int, ProgramLine],
        source: Sequence[str],
        file: str,
    ) -> None:
        self._subject, self._lines, self._source, self._file = subject, lines, source, file
        readers = {name.upper(): self._reader(name.upper()) for name in debugging.watch}
        everything = debugging.trace and not readers
        self.recorder = Recorder(
            debugging,
            source,
            {self._broken_line(each, stored): self._point(each) for each in debugging.breaks},
            (lambda: subject.values) if everything else partial(_values, readers),
        )

    def before(self, line: int) -> bool:
        """See Observer."""
        found = self._lines.get(line)
        if found is None or not self.recorder.reaches(found.number):
            return False
        self.recorder.breaks(self._subject.now(), found.number, self._text(found))
        return True

    def after(self, line: int) -> None:
        """See Observer."""
        if self.recorder.full or (found := self._lines.get(line)) is None:
            return
        self.recorder.after(self._subject.now(), found.number, self._text(found), self.recorder.changed())

    def take(self) -> list[Followed]:
        """Return the events since the last time."""
        return self.recorder.take()

    def _text(self, line: ProgramLine) -> str:
        return self._source[line.number - 1].strip()

    def _reader(self, name: str) -> Read:
        read = self._subject.reader(name)
        if read is None:
            raise Diagnostic(f"no variable {name} to watch", self._file, "valid: a variable or flag, or a name with VA")
        return read

    def _point(self, text: str) -> BreakPoint:
        found = split_break(text)
        if found is None:
            hint = "valid: LINE or LABEL, or with ,PASSES from 1 to 65535"
            raise Diagnostic(f"no break point {text}", self._file, hint)
        return BreakPoint(*found)

    def _broken_line(self, text: str, stored: Mapping[int, ProgramLine]) -> int:
        """The line of the file before which the run ends."""
        place, index = self._point(text).place, self._subject.index
        number = whole(place, 0, LAST_LINE)
        if number is None:
            address = self._subject.labels.get(place.upper())
        else:
            address = next((at for at, line in stored.items() if line.number == number), None)
        found = self._lines.get(index.get(address, -1)) if address is not None else None
        if found is None:
            labels = ", ".join(sorted(self._subject.labels)) or "none"
            hint = f"valid: a line of the program, or a label ({labels})"
            raise Diagnostic(f"no line to break at {place}", self._file, hint)
        return found.number


def _values(readers: Mapping[str, Read]) -> Values:
    """Read what is watched; a variable that is not declared yet is left out."""
    found: dict[str, Value] = {}
    for name, read in readers.items():
        try:
            found[name] = read()
        except Fault:
            continue
    return found
