"""What the run of an MCode program reports: as values, as JSON objects, and as lines for a person."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from dialects.mcode.manual import error_texts
from simulator.program_run import Line, remark

ENDS = {"E": "ended at E", "error": "ended by an error", "until": "stopped", "break": "stopped at a break point"}


class Printed(NamedTuple):
    """A line that the drive has printed, and when it was complete; seconds from the start of the program."""

    t: float
    text: str

    @property
    def failed(self) -> bool:
        """Return False: only a summary says that a test has failed."""
        return False

    def fact(self, real: float) -> dict[str, Any]:
        """See Event."""
        return {"t": round(self.t, 6), "print": self.text}

    def lines(self, file: str, real: float) -> Iterator[Line]:
        """See Event."""
        yield Line(f"{self.t:10.4f}  {_visible(self.text)}")


@dataclass(frozen=True)
class Failed:
    """An error of the drive: its time, its code, the line of the file; whether a subroutine of OE handled it.

    `loading`: the drive refused the line when the file was loaded.
    """

    t: float
    code: int
    line: int
    text: str
    handled: bool = False
    loading: bool = False
    personality: str = field(default="LMDCM", compare=False)
    failed = False

    def fact(self, real: float) -> dict[str, Any]:
        """See Event."""
        more = {"handled": True} if self.handled else {}
        return {"t": round(self.t, 6), "error": self.code, "line": self.line, **more}

    def lines(self, file: str, real: float) -> Iterator[Line]:
        """See Event."""
        when = "refused" if self.loading else f"at {self.t:.4f} s"
        handled = " (OE has handled it)" if self.handled else ""
        yield Line(f"{file}:{self.line}: {self.text}: {when}: {self.meaning}{handled}", problem=True)

    @property
    def meaning(self) -> str:
        """The error's code and its meaning."""
        return f"error {self.code}, {error_texts.text(self.code, self.personality)}"


@dataclass(frozen=True)
class Summary:
    """How a run ended: "E", "error", "break" or "until". `errors` are the codes that no subroutine handled.

    `line` is where the program is or has ended (0: nowhere). `moving` is the velocity at the end, steps/s.
    `given_up`: no time was set, and the program was still running. `stuck`: nothing would ever have happened any more.
    """

    ended: str
    t: float
    position: int
    moves: int
    instructions: int
    errors: tuple[int, ...]
    line: int
    moving: int
    given_up: bool
    stuck: bool

    @property
    def failed(self) -> bool:
        """See Event."""
        return bool(self.errors or self.given_up)

    def fact(self, real: float) -> dict[str, Any]:
        """See Event."""
        return {
            "summary": {
                "position": self.position,
                "moves": self.moves,
                "errors": list(self.errors),
                "instructions": self.instructions,
                "virtual_s": round(self.t, 6),
                "real_s": round(real, 3),
                "ended": self.ended,
            }
        }

    def lines(self, file: str, real: float) -> Iterator[Line]:
        """See Event."""
        failed = f"errors {', '.join(str(each) for each in self.errors)}" if self.errors else "no errors"
        counts = f"{_count(self.moves, 'motion')}, {_count(self.instructions, 'line')}"
        how = f"{ENDS[self.ended]} after {self.t:.4f} s" if self.line else "not run"
        yield Line(f"{how}: position {self.position}, {counts}, {failed} ({real:.2f} s real)")
        turns = self.moving and self.ended == "E"
        turning = f"the motor still turns, {self.moving} steps/s; H before E waits for it" if turns else ""
        if text := remark(stuck=self.stuck, given_up=self.given_up, turning=turning):
            yield Line(f"{file}:{self.line}: {text}", problem=True)


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _visible(text: str) -> str:
    """Escape what would act on a terminal."""
    return "".join(each if each.isprintable() or each == "\t" else f"\\x{ord(each):02x}" for each in text)
