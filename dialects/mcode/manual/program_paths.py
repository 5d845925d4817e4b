"""Warnings of lines that are never executed, of programs without an end, and of RT without a call.

A host may start a program at any label (EX), so only a line without a label is unreachable, and only a label that
nothing calls, that no BR goes to and that no line runs on to counts as the beginning of a program. E and RT after a
line that goes elsewhere are the usual last lines, and are not reported. (MCode reference 3.3, 5.1.35, 5.1.112.)
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping

from multidrop.dialects.mcode.manual.program_flow import Flow, Step
from multidrop.dialects.problems import Problem
from multidrop.dialects.walks import walk, way_to

AT_POWER_UP = "SU"


def check(flow: Flow, mentioned: Container[str]) -> Iterator[Problem]:
    """Report what the paths through the programs show. `mentioned` are words that lines with an error have."""
    dead = _dead(flow)
    for at, step in enumerate(flow.steps):
        if flow.next(at) is None and step.statement is not None and not step.ends and at not in dead:
            yield _warn(step, "the program runs on past this line, its last one", "end it with E")
    if not flow.hidden:
        yield from _unreachable(flow, dead)
        yield from _uncalled(flow, mentioned)


def _warn(step: Step, what: str, hint: str) -> Problem:
    return Problem(step.line.number, step.line.column, what, hint, warning=True)


def _dead(flow: Flow) -> dict[int, Step]:
    """The lines between one that leads elsewhere and the next label, each with the former."""
    dead: dict[int, Step] = {}
    away: Step | None = None
    for at, step in enumerate(flow.steps):
        if not step.follows or step.statement is None or step.label:
            away = None
        elif away is not None:
            dead[at] = away
        if step.ends and away is None:
            away = step
    return dead


def _unreachable(flow: Flow, dead: Mapping[int, Step]) -> Iterator[Problem]:
    """Report the first line of each part that no path reaches."""
    reported: Step | None = None
    for at, away in dead.items():
        step = flow.steps[at]
        if away is not reported and step.word not in ("E", "RT"):
            reported = away
            what = f"never executed: {away.line.text} in line {away.line.number} leads elsewhere"
            yield _warn(step, what, "give it a label, or delete it")


def _uncalled(flow: Flow, mentioned: Container[str]) -> Iterator[Problem]:
    """Report paths on which RT is reached without a call, each place once."""
    called = flow.called()
    before = walk(_beginnings(flow, called), flow.ways)
    reported = set[int]()
    for end in (place for place in before if flow.steps[place].word == "RT"):
        way = list(way_to(end, before))[::-1]
        begin = way[0][0] if way else end
        source, place = next(((source, place) for source, place in way if place in called), (begin, None))
        if source in reported or (place is None and flow.steps[begin].label in mentioned):
            continue
        reported.add(source)
        yield _without_call(flow, begin, end) if place is None else _into(flow, source, place, end)


def _beginnings(flow: Flow, called: frozenset[int]) -> Iterator[int]:
    """The lines at which a program may be started, other than by a call."""
    inner = called | flow.branched()
    for at, step in enumerate(flow.steps):
        previous = flow.steps[at - 1] if step.follows else None
        alone = previous is None or (previous.statement is not None and previous.ends)
        first = previous is None and at not in called
        if step.label == AT_POWER_UP or first or (step.label and alone and at not in inner):
            yield at


def _into(flow: Flow, source: int, place: int, end: int) -> Problem:
    """Report a path into a subroutine: by running on, or by BR."""
    step, subroutine = flow.steps[source], flow.steps[place]
    rt = f"RT in line {flow.steps[end].line.number} then has nothing to return to"
    if step.word == "BR" and place != flow.next(source):
        name = subroutine.label or subroutine.line.text
        return _warn(step, f"BR goes into the subroutine {name}, and {rt}", f"call it: CL {name}")
    what = f"the program runs on into the subroutine of line {subroutine.line.number}, and {rt}"
    return _warn(step, what, "end it with E first")


def _without_call(flow: Flow, begin: int, end: int) -> Problem:
    """Report a beginning from which RT is reached, although nothing calls it."""
    step, rt = flow.steps[begin], f"RT in line {flow.steps[end].line.number}"
    if step.label in ("", AT_POWER_UP):
        return _warn(step, f"the program that begins here ends with {rt}", "end it with E")
    return _warn(
        step,
        f"nothing in this file calls {step.label}, which ends with {rt}",
        "call it (CL, OE or a trip), or end it with E",
    )
