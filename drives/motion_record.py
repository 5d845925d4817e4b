"""The motions of one drive that lines of this session began, and whether their ends are failures.

A sequence is whoever sends lines one after the other: an automation, or the person at the session. A motion is the
sequence's that began it. For each axis the record has the last motion of each sequence, what was known before it, and
who has stopped or replaced it since. `Ending.failed` is set here and nowhere else, the same for every family.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from multidrop.dialects.motions import Effect, Ending, Evidence, Move, MoveKind, Outcome, Signs

MOST_KEPT_COURSES = 8
"""The most motions of one axis that are kept, each of another sequence."""
NOT_OURS = "not by this script"
MAYBE_RESTARTED = "it gave no reply on the way and is at 0, so it may have been restarted"
NO_AXES = frozenset[str]()
Sequence = object
"""A sequence, compared by identity."""


@dataclass(eq=False)
class Course:
    """One motion, from its line to its judgement."""

    move: Move
    by: Sequence
    before: Signs
    errors: int
    """`DriveState.errors.count` as it began."""
    program: bool = False
    """A program was started since, or seen to run, or a line let the drive move by itself."""
    commands: int = 0
    """The number of commands that this host had sent to the drive before its line."""
    stopped: bool = False
    """Its own sequence has stopped it."""
    stopped_by_other: bool = False
    missed: bool = False
    """The drive gave no reply to something since."""
    restarted: bool = False
    """The drive was restarted since, which ends every motion."""
    replaced: Move | None = None
    """The motion of another sequence that has replaced it."""
    ending: Ending | None = None
    """How it ended, once that was judged."""

    @property
    def open(self) -> bool:
        return self.ending is None

    def evidence(self, errors: tuple[int, ...], commands: int) -> Evidence:
        """What is known. `errors`: read since; `commands`: sent to the drive so far, that of its line included."""
        stopped, alone = self.stopped or self.stopped_by_other, commands <= self.commands + 1
        return Evidence(self.move, self.before, errors, stopped, self.program, alone)

    @property
    def cut_off(self) -> Ending | None:
        """How it ended where a restart ended it; nothing that is read of the drive then says anything of it."""
        return restart(self.move.axis) if self.restarted else None

    def judged(self, found: Ending) -> Ending:
        """Decide whether what the drive shows is a failure of this motion, and keep it."""
        target = found.target if self.move.target is None else self.move.target
        self.ending = self._decided(replace(found, target=target, failed=False))
        return self.ending

    def _decided(self, found: Ending) -> Ending:
        short = found.outcome is Outcome.STOPPED
        if self.missed and found.position == 0 and found.outcome is Outcome.REACHED and not self.move.target:
            return replace(found, outcome=Outcome.UNKNOWN, reason=MAYBE_RESTARTED, failed=True)
        if not short and found.outcome is not Outcome.REACHED:
            return replace(found, failed=True)
        if self.stopped:
            return replace(found, outcome=Outcome.STOPPED, reason="")
        if self.replaced is not None and (short or self.move.target is None):
            return replace(found, outcome=Outcome.REPLACED, reason=NOT_OURS, failed=True)
        if self.stopped_by_other and (short or self.move.target is None):
            return replace(found, outcome=Outcome.STOPPED, reason=NOT_OURS, failed=True)
        return replace(found, reason=found.reason or NOT_OURS, failed=True) if short else found


def restart(axis: str) -> Ending:
    """The end of a motion by a restart of its drive."""
    return Ending(Outcome.POWER, axis, reason="it was restarted", failed=True)


Courses = dict[str, list[Course]]
"""The courses of a drive by axis, the newest last."""


class MotionRecord:
    """The courses of one drive."""

    def __init__(self) -> None:
        self._courses: Courses = {}
        self.restarts = 0
        """The number of restarts that were seen."""

    def begin(self, courses: Iterable[Course]) -> None:
        """Record motions whose line is on its way. A motion of the same sequence on the same axis is replaced well."""
        for new in courses:
            kept = [course for course in self._courses.get(new.move.axis, ()) if course.by is not new.by]
            for course in kept:
                if course.open and course.replaced is None:
                    course.replaced = new.move
            self._courses[new.move.axis] = [*kept, new][-MOST_KEPT_COURSES:]
            if new.move.kind is MoveKind.PROGRAM:
                for course in self._all():
                    course.program = True

    def copy(self) -> Courses:
        """Return what `restore` needs if the drive refuses a line."""
        return {axis: [*courses] for axis, courses in self._courses.items()}

    def restore(self, before: Courses, by: Sequence) -> None:
        """Remove the motions that this sequence has begun since `copy`, and put back those that they replaced.

        The drive refused their line. Motions that other sequences have begun meanwhile stay.
        """
        refused = [each for each in self.of(by) if each not in before.get(each.move.axis, ())]
        for course in refused:
            axis = course.move.axis
            now = [each for each in self._courses[axis] if each is not course]
            known = [each.by for each in now]
            self._courses[axis] = [*(each for each in before.get(axis, ()) if each.by not in known), *now]
            for known_course in self._courses[axis]:
                if known_course.replaced is course.move:
                    known_course.replaced = None

    def effect(self, effect: Effect, by: Sequence) -> None:
        """Record what else a line does, which was not refused."""
        if effect.ends:
            self.stopped(by, effect.ends)
        if effect.resumes:
            for course in self._all():
                course.stopped = course.stopped_by_other = False
        if effect.halts:
            self._note_stop(by, [each for each in self._all() if each.move.kind is MoveKind.PROGRAM])
        self.runs(effect.frees)
        for course in self._open(effect.unknown):
            course.move = replace(course.move, target=None, relative=None)

    def stopped(self, by: Sequence | None, axes: frozenset[str] | None = None) -> None:
        """Record a stop of axes (None: all). `by` None: of the whole session, which no sequence outlives unasked."""
        together = frozenset(axis for course in self._open(axes or NO_AXES) for axis in course.move.group)
        self._note_stop(by, self._all() if axes is None else self._open(axes | together))

    def _note_stop(self, by: Sequence | None, courses: Iterable[Course]) -> None:
        for course in courses:
            if course.open:
                course.stopped = course.stopped or by is None or course.by is by
                course.stopped_by_other = course.stopped_by_other or not (by is None or course.by is by)

    def missed(self) -> None:
        """Record that the drive gave no reply."""
        for course in self._all():
            course.missed = course.missed or course.open

    def restarted(self) -> None:
        """Record a sign of a restart."""
        self.restarts += 1
        for course in self._all():
            course.restarted = course.restarted or course.open

    def close(self, by: Sequence) -> None:
        """Take the motions of a sequence that ends early for stopped by it: they are judged no more."""
        self.stopped(by)
        for course in self.open_of(by):
            course.ending = Ending(Outcome.STOPPED, course.move.axis, target=course.move.target)

    def runs(self, seen: bool = True) -> None:
        """Record whether a program was seen to run or was started, or something else may move the drive by itself."""
        for course in self._all():
            course.program = course.program or seen

    def of(self, by: Sequence) -> list[Course]:
        """The last motion of a sequence on each axis."""
        return [course for course in self._all() if course.by is by]

    def open_of(self, by: Sequence) -> list[Course]:
        """Those whose end was not judged yet."""
        return [course for course in self.of(by) if course.open]

    @property
    def any_open(self) -> bool:
        return any(course.open for course in self._all())

    def _all(self) -> list[Course]:
        return [course for courses in self._courses.values() for course in courses]

    def _open(self, axes: frozenset[str]) -> list[Course]:
        return [course for axis in axes for course in self._courses.get(axis, ()) if course.open]
