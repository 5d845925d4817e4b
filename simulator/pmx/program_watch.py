"""What a person follows in the run of A-SCRIPT: which statement comes next, what variables and registers hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from math import inf

from dialects import Diagnostic
from dialects.numbers import whole
from dialects.pmx.manual.script_words import VARIABLES
from dialects.pmx.manual.table import lookup
from simulator.pmx.device import PmxDevice
from simulator.program_run import Debugging
from simulator.program_watch import BreakPoint, Followed, Recorder, Value, Values, split_break

LAST_LINE = 999_999
_NAMES = {f"V{n}": n for n in range(VARIABLES)}


@dataclass
class Statement:
    """A statement under way: when it began, its line in the file, what it has changed so far."""

    t: float
    line: int
    changed: dict[str, Value] = field(default_factory=dict)


class Watcher:
    """Looks at each compiled line that a program executes. Raises Diagnostic for a line or a name that is not there.

    A statement of the file has several compiled lines, so it is reported when the next one begins. `source` gives the
    line of the file for a compiled line.
    """

    def __init__(
        self, device: PmxDevice, debugging: Debugging, source: Mapping[int, int], text: Sequence[str], file: str
    ) -> None:
        self._device, self._source, self._text, self._file = device, source, text, file
        self._now = 0.0
        self._open: dict[int, Statement] = {}
        self._held: list[Followed] = []
        names = [name.upper() for name in debugging.watch]
        for name in names:
            self._check(name)
        points = {self._line_of(each): self._point(each) for each in debugging.breaks}
        everything = debugging.trace and not names
        self.recorder = Recorder(debugging, text, points, self._variables if everything else partial(self._read, names))

    def before(self, t: float, program: int, line: int) -> bool:
        """See Observer."""
        self._now = t
        number = self._source.get(line, 0)
        if line and self._source.get(line - 1) == number and program in self._open:
            return False  # within a statement
        self._close(program)
        self._open[program] = Statement(t, number)
        if not self.recorder.reaches(number):
            return False
        self.recorder.breaks(t, number, self._shown(number))
        del self._open[program]
        return True

    def after(self, t: float, program: int) -> None:
        """See Observer."""
        if not self.recorder.full:
            self._open[program].changed.update(self.recorder.changed())

    @property
    def open_since(self) -> float:
        """When the first statement under way began; infinite where there is none."""
        return min((each.t for each in self._open.values()), default=inf)

    def take(self, last: bool) -> list[Followed]:
        """Return what was executed since the last time; statements under way only with the `last`."""
        for program in sorted(self._open) if last else ():
            self._close(program)
        return self.recorder.take()

    def _close(self, program: int) -> None:
        done = self._open.pop(program, None)
        if done is not None:
            self.recorder.after(done.t, done.line, self._shown(done.line), done.changed, program)

    def _shown(self, number: int) -> str:
        return self._text[number - 1].strip() if 0 < number <= len(self._text) else ""

    def _variables(self) -> Values:
        return dict(zip(_NAMES, self._device.programs.variables, strict=True))

    def _read(self, names: Sequence[str]) -> Values:
        variables = self._device.programs.variables
        return {name: variables[_NAMES[name]] if name in _NAMES else self._register(name) for name in names}

    def _register(self, name: str) -> int:
        return int(self._device.commanded.ask(name, self._now))

    def _check(self, name: str) -> None:
        """Refuse a name that reads no number: another command could move an axis."""
        row = lookup(name)
        if name in _NAMES or (row is not None and "R" in row.access and self._reads(name)):
            return
        hint = "valid: V0 to V63, or a command that reads one number, such as PX"
        raise Diagnostic(f"no variable {name} to watch", self._file, hint)

    def _reads(self, name: str) -> bool:
        try:
            self._register(name)
        except ValueError:
            return False
        return True

    def _point(self, text: str) -> BreakPoint:
        found = split_break(text)
        if found is None:
            raise Diagnostic(f"no break point {text}", self._file, "valid: LINE, or LINE,PASSES from 1 to 65535")
        return BreakPoint(*found)

    def _line_of(self, text: str) -> int:
        number = whole(self._point(text).place, 0, LAST_LINE)
        if number not in self._source.values() or number is None:
            raise Diagnostic(f"no statement to break at {text}", self._file, "valid: the number of a line of the file")
        return number
