"""What the run of a PMX's programs reports: as values, as JSON objects, and as lines for a person."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from simulator.program_run import Line, remark

ENDS = {"END": "ended", "error": "ended by an error", "until": "stopped", "break": "stopped at a break point"}


@dataclass(frozen=True)
class Output:
    """A program has switched outputs: the time, the program, all outputs as DO gives them."""

    t: float
    program: int
    outputs: int
    failed = False

    def fact(self, real: float) -> dict[str, Any]:
        """See Event."""
        return {"t": round(self.t, 6), "program": self.program, "outputs": self.outputs}

    def lines(self, file: str, real: float) -> Iterator[Line]:
        """See Event."""
        yield Line(f"{self.t:10.4f}  DO={self.outputs} (program {self.program})")


@dataclass(frozen=True)
class Failed:
    """An error in a program: its time, the program, the line of the file, the cause; whether SUB 31 handled it."""

    t: float
    program: int
    line: int
    why: str
    handled: bool
    failed = False

    def fact(self, real: float) -> dict[str, Any]:
        """See Event."""
        more = {"handled": True} if self.handled else {}
        return {"t": round(self.t, 6), "program": self.program, "error": self.why, "line": self.line, **more}

    def lines(self, file: str, real: float) -> Iterator[Line]:
        """See Event."""
        handled = " (SUB 31 has handled it)" if self.handled else ""
        where = f"{file}:{self.line}: program {self.program} at {self.t:.4f} s"
        yield Line(f"{where}: {self.why}{handled}", problem=True)


@dataclass(frozen=True)
class Summary:
    """How a run ended: "END", "error", "break" or "until"; positions, motions begun, compiled lines executed, errors.

    `lines_at` are the lines of the file at which programs stand that still run.
    """

    ended: str
    t: float
    position: tuple[int, int]
    moves: int
    instructions: int
    errors: tuple[str, ...]
    lines_at: tuple[int, ...]
    moving: bool
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
                "position": dict(zip("XY", self.position, strict=True)),
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
        yield Line(f"{ENDS[self.ended]} after {self.t:.4f} s: {self._counts} ({real:.2f} s real)")
        turns = self.moving and self.ended == "END"
        turning = "a motor still turns; WAITX or WAITY before END waits for it" if turns else ""
        text = remark(stuck=self.stuck, given_up=self.given_up, turning=turning)
        for line in self.lines_at or (0,):
            if text:
                yield Line(f"{file}:{line}: {text}" if line else f"{file}: {text}", problem=True)

    @property
    def _counts(self) -> str:
        many = len(self.errors)
        failed = f"{many} error{'s' if many > 1 else ''}" if many else "no errors"
        motions = f"{self.moves} motion{'' if self.moves == 1 else 's'}"
        x, y = self.position
        return f"X {x}, Y {y}, {motions}, {self.instructions} compiled lines, {failed}"
