"""How a motion ends: what a line begins, the signs of a failure, and the judgement of what was read at its end.

A family supplies a `Motions`. It knows its drives, and no sequences: `judge` says what the drive shows. Whose stop
ended a motion, and whether that is a failure, is decided once for all families (`drives.motion_record`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from types import MappingProxyType

from multidrop.dialects.codec import Procedure
from multidrop.dialects.state import OfDrive

Signs = Mapping[str, int]
"""What was read of a drive that may show a failure, by the family's own names. It may hold more, such as a position."""
NO_SIGNS: Signs = MappingProxyType({})


def _no_signs_read() -> Signs:
    return NO_SIGNS


class Outcome(Enum):
    """How a motion ended; the values are the words of `{outcome}`."""

    REACHED = "reached"
    """At its target; without a target: it ended, and nothing shows a failure."""
    REPLACED = "replaced"
    """Another motion took its place."""
    STOPPED = "stopped"
    """Short of its target, and nothing shows a failure: something stopped it."""
    LIMIT = "limit"
    STALL = "stall"
    ERROR = "error"
    POWER = "power"
    UNKNOWN = "unknown"
    """Its end could not be read."""


class MoveKind(Enum):
    """What a line begins."""

    POSITION = "position"
    VELOCITY = "velocity"
    HOMING = "homing"
    PROGRAM = "program"


@dataclass(frozen=True)
class Move:
    """A motion that a line begins."""

    kind: MoveKind
    axis: str = ""
    """As in `Motion.axis`."""
    target: int | None = None
    """Where it ends, in the units of `Motion.position`; None: it has no target, or none that is known."""
    relative: int | None = None
    """The distance, where the target counts from where the axis is when the line is executed."""
    endless: bool = False
    """Only a command or a fault ends it."""
    group: frozenset[str] = frozenset()
    """The axes that move together: a stop of one of them stops all."""


@dataclass(frozen=True)
class Effect:
    """What a typed line does to the motions of a drive; each axis as in `Motion.axis`."""

    begins: tuple[Move, ...] = ()
    ends: frozenset[str] = frozenset()
    """Axes whose motion it stops on purpose."""
    unknown: frozenset[str] = frozenset()
    """Axes whose positions or targets have another meaning after it, so that a target is not known any more."""
    halts: bool = False
    """It ends programs on purpose, and no motion that a line began."""
    resumes: bool = False
    """What a line has paused goes on."""
    frees: bool = False
    """It lets the drive move, or end a motion, by itself: a trip, jog inputs, a clock."""
    clears: bool = False
    """It clears a sign of a failure, so that the motions before it are judged first."""

    @property
    def stops(self) -> bool:
        """Whether it ends something, and is held back by nothing."""
        return bool(self.ends) or self.halts


NOTHING = Effect()


def joined(effects: Sequence[Effect]) -> Effect:
    """What several lines do together."""
    return Effect(
        tuple(move for effect in effects for move in effect.begins),
        frozenset(axis for effect in effects for axis in effect.ends),
        frozenset(axis for effect in effects for axis in effect.unknown),
        any(effect.halts for effect in effects),
        any(effect.resumes for effect in effects),
        any(effect.frees for effect in effects),
        any(effect.clears for effect in effects),
    )


@dataclass(frozen=True)
class Evidence:
    """What the host knows of a motion that seems to have ended."""

    move: Move | None = None
    """None: somebody else began it, so nothing but a new sign shows a failure, and nothing may be cleared."""
    before: Signs = field(default_factory=_no_signs_read)
    """The signs from before it: of an own motion from right before its line, else from the beginning of the wait."""
    errors: tuple[int, ...] = ()
    """The numbers of errors that were read, and thereby cleared, since it began; newest last."""
    stopped: bool = False
    """This session has stopped it since, so that an error of a line cut off by the stop says nothing of the motion."""
    program: bool = False
    """A program may have moved the axis since: one was started, or seen to run, right before it, too."""
    alone: bool = False
    """This host has sent the drive nothing but questions since, so that a setting is what it was before."""


@dataclass(frozen=True)
class Ending:
    """How a motion ended."""

    outcome: Outcome
    axis: str = ""
    position: int | None = None
    target: int | None = None
    reason: str = ""
    """In a few words, as after `a stopped at 1200 of 4000: `."""
    failed: bool = False
    """Set by the one who knows the sequences, not by the family."""
    restart: str = ""
    """The sign that the drive was restarted; empty: none."""

    def described(self, name: str) -> str:
        """In words: `a stopped at 1200 of 4000: stalled`."""
        axis = f" {self.axis.upper()}" if self.axis else ""
        if self.position is None:
            return f"{name}{axis} {self._verb}: {self.reason or self.outcome.value}"
        of = "" if self.target is None or self.target == self.position else f" of {self.target}"
        reason = self.reason or ("" if self.outcome is Outcome.REACHED else self.outcome.value)
        parted = ", " if reason.startswith("not ") else ": "
        return f"{name}{axis} {self._verb} at {self.position}{of}{parted if reason else ''}{reason}"

    @property
    def _verb(self) -> str:
        return "is at rest" if self.outcome is Outcome.REACHED else "stopped"


def restarted(ending: Ending, sign: str) -> Ending:
    """The end of a motion by a restart of its drive, and how that shows."""
    return replace(ending, outcome=Outcome.POWER, reason=f"it was restarted ({sign})", restart=sign)


class Motions(OfDrive):
    """What a family says of the motions of a drive. Conversations raise Refused, NoAnswer, Stopped or Inexpressible.

    The defaults know of no motion: waits for such a drive end when it is at rest.
    """

    def effect(self, text: str) -> Effect:
        """What a typed line does to the motions of the drive. Asks nothing."""
        return NOTHING

    def signs(self) -> Procedure[Signs]:
        """Read the signs of a failure, and where the axes are; nothing that changes when it is read."""
        return NO_SIGNS
        yield  # a conversation without a request

    def old(self, signs: Signs, own: bool) -> Procedure[Signs]:
        """Report what `signs` show from before; return the signs from which the judgement is to count.

        `own`: an own motion follows, so what must be cleared before it may be cleared. Else nothing may be cleared.
        """
        return signs
        yield

    def place(self, signs: Signs, axis: str) -> int | None:
        """The position of an axis at rest in `signs`; None: it moves, or its position was not read."""
        return None

    def runs(self, signs: Signs) -> bool:
        """Whether `signs` show a program that runs, or that the drive may start itself: it may move any axis."""
        return False

    def judge(self, axis: str, evidence: Evidence) -> Procedure[Ending | None]:
        """Judge the motion of an axis that two readings show at rest; None: it is not over yet (it settles).

        Of an own motion it may read, for the reason, what reading clears. STOPPED: it ended short of its target, or was
        endless; nothing shows a failure, and nothing in the drive explains it. The caller knows who stopped it.
        """
        return Ending(Outcome.REACHED, axis)
        yield

    def fails(self, code: int) -> bool:
        """Whether an error number, once read, is that of a motion or of the machine, and not the refusal of a line."""
        return False
