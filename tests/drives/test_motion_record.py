"""The motions of one drive: whose stop ended one, what replaced it, and whether its end is a failure."""

from typing import Any

import pytest

from multidrop.dialects.motions import Effect, Ending, Evidence, Move, MoveKind, Outcome
from multidrop.drives.motion_record import MOST_KEPT_COURSES, NOT_OURS, Course, MotionRecord, restart

ME, OTHER, THIRD = "me", "other", "third"


def move(axis: str = "", target: int | None = 100, kind: MoveKind = MoveKind.POSITION, **more: Any) -> Move:
    return Move(kind, axis, target, **more)


def course(by: object = ME, axis: str = "", target: int | None = 100, **more: Any) -> Course:
    return Course(move(axis, target), by, {"st": 0}, 0, **more)


def program(by: object = ME) -> Course:
    return Course(move(kind=MoveKind.PROGRAM, target=None), by, {}, 0)


def recorded(*courses: Course) -> MotionRecord:
    record = MotionRecord()
    record.begin(courses)
    return record


def ended(outcome: Outcome, **more: Any) -> Ending:
    return Ending(outcome, "x", position=7, **more)


NOBODY: dict[str, Any] = {}
MINE = {"stopped": True}
THEIRS = {"stopped_by_other": True}
REPLACED = {"replaced": move(target=5)}


@pytest.mark.parametrize(
    ("target", "what", "found", "outcome", "reason", "failed"),
    [
        (100, NOBODY, Outcome.REACHED, Outcome.REACHED, "", False),
        (None, NOBODY, Outcome.REACHED, Outcome.REACHED, "", False),
        (100, NOBODY, Outcome.STOPPED, Outcome.STOPPED, NOT_OURS, True),
        (100, NOBODY, Outcome.LIMIT, Outcome.LIMIT, "", True),
        (100, MINE, Outcome.LIMIT, Outcome.LIMIT, "", True),
        (100, THEIRS, Outcome.STALL, Outcome.STALL, "", True),
        (100, REPLACED, Outcome.UNKNOWN, Outcome.UNKNOWN, "", True),
        (100, MINE, Outcome.STOPPED, Outcome.STOPPED, "", False),
        (100, MINE, Outcome.REACHED, Outcome.STOPPED, "", False),
        (100, MINE | THEIRS | REPLACED, Outcome.STOPPED, Outcome.STOPPED, "", False),
        (100, REPLACED, Outcome.STOPPED, Outcome.REPLACED, NOT_OURS, True),
        (100, REPLACED | THEIRS, Outcome.STOPPED, Outcome.REPLACED, NOT_OURS, True),
        (100, REPLACED, Outcome.REACHED, Outcome.REACHED, "", False),
        (None, REPLACED, Outcome.REACHED, Outcome.REPLACED, NOT_OURS, True),
        (100, THEIRS, Outcome.STOPPED, Outcome.STOPPED, NOT_OURS, True),
        (100, THEIRS, Outcome.REACHED, Outcome.REACHED, "", False),
        (None, THEIRS, Outcome.REACHED, Outcome.STOPPED, NOT_OURS, True),
    ],
)
def test_a_stop_of_its_own_sequence_is_no_failure_and_one_of_another_is(
    target: int | None, what: dict[str, Any], found: Outcome, outcome: Outcome, reason: str, failed: bool
) -> None:
    judged = course(target=target, **what)
    expected = Ending(outcome, "x", 7, target, reason, failed)
    assert judged.judged(ended(found, failed=True)) == expected
    assert judged.ending == expected and not judged.open


def test_a_stop_that_the_drive_explains_keeps_the_drives_reason():
    assert course().judged(ended(Outcome.STOPPED, reason="an input")) == Ending(
        Outcome.STOPPED, "x", 7, 100, "an input", True
    )


@pytest.mark.parametrize(("own", "expected"), [(None, 40), (0, 0), (100, 100)])
def test_the_target_of_the_line_goes_before_the_one_that_the_drive_shows(own, expected):
    assert course(target=own).judged(ended(Outcome.REACHED, target=40)).target == expected


def test_only_a_restart_cuts_a_motion_off():
    assert course(axis="y").cut_off is None
    expected = Ending(Outcome.POWER, "y", reason="it was restarted", failed=True)
    assert course(axis="y", restarted=True).cut_off == restart("y") == expected


@pytest.mark.parametrize(
    ("what", "stopped"), [(NOBODY, False), (MINE, True), (THEIRS, True), ({"program": True}, False)]
)
def test_the_evidence_of_a_motion_has_what_was_known_before_it_and_since(what, stopped):
    each = course(**what, commands=4)
    for commands, alone in ((5, True), (6, False)):  # its own line is the fifth
        known = Evidence(each.move, {"st": 0}, (83,), stopped, "program" in what, alone)
        assert each.evidence((83,), commands) == known


@pytest.mark.parametrize(
    ("target", "position", "missed", "outcome"),
    [
        (None, 0, True, Outcome.UNKNOWN),
        (0, 0, True, Outcome.UNKNOWN),
        (0, 0, False, Outcome.REACHED),
        (None, 5, True, Outcome.REACHED),
        (5, 0, True, Outcome.REACHED),
    ],
)
def test_an_end_at_0_after_a_missing_reply_may_be_a_restart(target, position, missed, outcome):
    each = course(target=target)
    record = recorded(each)
    if missed:
        record.missed()
    found = each.judged(Ending(Outcome.REACHED, "x", position))
    assert (found.outcome, found.failed) == (outcome, outcome is Outcome.UNKNOWN)


def test_a_missing_reply_after_a_motion_says_nothing_of_it():
    each = course()
    record = recorded(each)
    each.judged(ended(Outcome.REACHED))
    record.missed()
    assert not each.missed


def test_a_stop_of_one_axis_of_a_common_move_is_one_of_each():
    both = frozenset("xy")
    common = [Course(Move(MoveKind.POSITION, axis, group=both), ME, {}, 0) for axis in "xy"]
    record = recorded(*common)
    record.stopped(ME, frozenset("x"))
    assert all(each.stopped for each in common)
    record.effect(Effect(resumes=True), ME)
    assert not any(each.stopped for each in common)


def test_a_motion_of_the_same_sequence_replaces_its_last_one_on_that_axis_alone():
    first, elsewhere, second = course(), course(axis="y"), course(target=200)
    record = recorded(first, elsewhere)
    record.begin([second])
    assert record.of(ME) == [second, elsewhere]
    assert first.replaced is None and elsewhere.replaced is None


def test_a_motion_of_another_sequence_replaces_the_open_ones_on_its_axis():
    open_, over, elsewhere, new = course(), course(THIRD), course(axis="y"), course(OTHER, target=5)
    over.judged(ended(Outcome.REACHED))
    record = recorded(over, open_, elsewhere)
    record.begin([new])
    assert (open_.replaced, over.replaced, elsewhere.replaced) == (new.move, None, None)
    assert record.of(ME) == [open_, elsewhere] and record.of(OTHER) == [new]


def test_the_newest_motions_of_an_axis_are_kept():
    courses = [course(number) for number in range(MOST_KEPT_COURSES + 1)]
    record = recorded(*courses)
    assert [each for number in range(MOST_KEPT_COURSES + 1) for each in record.of(number)] == courses[1:]


def test_a_program_may_have_moved_every_axis_and_a_motion_none():
    first, second, ran = course(axis="x"), course(OTHER, axis="y"), program(THIRD)
    record = recorded(first, second)
    assert not first.program and not second.program
    record.begin([ran])
    assert first.program and second.program and ran.program


def test_a_line_that_was_refused_leaves_the_record_as_it_was():
    kept, mine = course(), course(OTHER, axis="y", target=5)
    record = recorded(kept, mine)
    before = record.copy()
    new, instead = course(OTHER, target=5), course(OTHER, axis="y", target=6)
    record.begin([new, instead])
    assert kept.replaced is new.move and record.of(OTHER) == [new, instead]
    record.restore(before, OTHER)
    assert kept.replaced is None
    assert record.of(ME) == [kept] and record.of(OTHER) == [mine]


def test_a_motion_that_another_sequence_has_begun_meanwhile_stays_when_a_refused_line_is_taken_back():
    """It came first in the queue, behind the copy: it was forgotten, and its failure with it."""
    kept, earlier, theirs = course(), course(OTHER, target=4), course(OTHER, target=5)
    record = recorded(kept, earlier)
    before = record.copy()
    record.begin([theirs])
    record.begin([course(target=6)])
    record.restore(before, ME)
    assert record.of(OTHER) == [theirs] and record.of(ME) == [kept]
    assert kept.replaced is earlier.move and theirs.replaced is None


@pytest.mark.parametrize("by", [OTHER, THIRD])
def test_what_another_line_has_replaced_stays_replaced_when_a_refused_line_is_taken_back(by):
    kept, theirs = course(), course(OTHER, target=5)
    record = recorded(kept)
    record.begin([theirs])
    before = record.copy()
    record.begin([course(by)])
    record.restore(before, by)
    assert kept.replaced is theirs.move
    assert record.of(OTHER) == [theirs]


def test_a_copy_does_not_follow_the_record():
    record = recorded(course())
    before = record.copy()
    record.begin([course(OTHER)])
    assert {axis: len(courses) for axis, courses in before.items()} == {"": 1}


def test_a_line_that_ends_axes_is_a_stop_of_these_by_its_sequence():
    mine, theirs, elsewhere = course(), course(OTHER), course(axis="y")
    record = recorded(mine, theirs, elsewhere)
    record.effect(Effect(ends=frozenset({""})), ME)
    assert [(each.stopped, each.stopped_by_other) for each in (mine, theirs, elsewhere)] == [
        (True, False),
        (False, True),
        (False, False),
    ]


def test_a_line_that_halts_programs_stops_no_motion_of_a_line():
    moves, ran, theirs = course(), program(), program(OTHER)
    record = recorded(moves, ran, theirs)
    record.effect(Effect(halts=True), ME)
    assert [(each.stopped, each.stopped_by_other) for each in (moves, ran, theirs)] == [
        (False, False),
        (True, False),
        (False, True),
    ]


@pytest.mark.parametrize("frees", [False, True])
def test_a_line_that_lets_the_drive_move_by_itself_counts_as_a_program(frees):
    each = course()
    record = recorded(each)
    record.effect(Effect(frees=frees), ME)
    assert (each.program, each.stopped, each.stopped_by_other) == (frees, False, False)


def test_a_line_that_changes_what_positions_mean_makes_the_targets_of_its_axes_unknown():
    here = Course(move("x", 100, relative=30), ME, {}, 0)
    there, over = course(axis="y"), course(OTHER, axis="x")
    over.judged(ended(Outcome.REACHED))
    record = recorded(here, there, over)
    record.effect(Effect(unknown=frozenset({"x"})), ME)
    assert here.move == Move(MoveKind.POSITION, "x")
    assert there.move.target == over.move.target == 100


def test_a_stop_of_the_session_is_that_of_each_sequence():
    mine, theirs = course(), course(OTHER, axis="y")
    record = recorded(mine, theirs)
    record.stopped(None)
    assert [(each.stopped, each.stopped_by_other) for each in (mine, theirs)] == [(True, False), (True, False)]


def test_a_stop_of_a_sequence_reaches_all_axes_and_is_another_ones_for_the_others():
    mine, theirs, over = course(), course(OTHER, axis="y"), course(THIRD)
    over.judged(ended(Outcome.REACHED))
    record = recorded(mine, theirs, over)
    record.stopped(ME)
    assert [(each.stopped, each.stopped_by_other) for each in (mine, theirs, over)] == [
        (True, False),
        (False, True),
        (False, False),
    ]


def test_a_second_stop_by_another_forgets_none_of_the_first():
    each = course()
    record = recorded(each)
    record.stopped(ME)
    record.stopped(OTHER)
    assert each.stopped and each.stopped_by_other
    other = course(axis="y")
    record.begin([other])
    record.stopped(OTHER, frozenset({"y"}))
    record.stopped(ME, frozenset({"y"}))
    assert other.stopped and other.stopped_by_other


def test_a_stop_of_an_axis_that_has_no_motion_is_nothing():
    each = course()
    record = recorded(each)
    record.stopped(ME, frozenset({"y"}))
    assert not each.stopped


def test_a_restart_cuts_off_what_is_open_and_is_counted():
    open_, over = course(), course(OTHER)
    over.judged(ended(Outcome.REACHED))
    record = recorded(open_, over)
    assert record.restarts == 0
    record.restarted()
    record.restarted()
    assert (record.restarts, open_.restarted, over.restarted) == (2, True, False)
    open_.judged(ended(Outcome.POWER))
    record.restarted()
    assert open_.restarted


def test_the_motions_of_a_sequence_that_ends_early_are_stopped_by_it_and_judged_no_more():
    mine, over, theirs = course(axis="y"), course(), course(OTHER)
    found = over.judged(ended(Outcome.REACHED))
    record = recorded(mine, over, theirs)
    record.close(ME)
    assert mine.ending == Ending(Outcome.STOPPED, "y", target=100)
    assert mine.stopped and theirs.stopped_by_other and not theirs.stopped
    assert over.ending is found and theirs.open


def test_a_program_once_seen_to_run_is_remembered():
    each = course()
    record = recorded(each)
    record.runs(False)
    assert not each.program
    record.runs()
    record.runs(False)
    assert each.program


def test_what_is_open_is_known_by_sequence_and_in_all():
    record = MotionRecord()
    assert not record.any_open and record.of(ME) == record.open_of(ME) == []
    mine, theirs = course(), course(OTHER)
    record.begin([mine, theirs])
    mine.judged(ended(Outcome.REACHED))
    assert record.of(ME) == [mine] and record.open_of(ME) == []
    assert record.open_of(OTHER) == [theirs] and record.any_open
    theirs.judged(ended(Outcome.REACHED))
    assert not record.any_open
