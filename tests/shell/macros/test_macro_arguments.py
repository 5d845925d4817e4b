"""Values and roles of a macro before it is played: given, taken from what is open, or asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import cast as typed

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.drives.bus import Bus
from multidrop.macros import Macro, MacroStep
from multidrop.shell.channel import AskedValue
from multidrop.shell.events import Notified
from multidrop.shell.macro_arguments import settled
from multidrop.shell.session import Session

TURNS = Macro("turns", (MacroStep(0.0, "MR {far:int=7,1..9}"), MacroStep(0.0, "VM {fast:int}")))
GANTRY = Macro("home", (MacroStep(0.0, "@gantry:a HM 1"), MacroStep(0.0, "/wait @gantry:a I1=1")), roles=("gantry",))


def opened(session: Session, *names: str) -> Session:
    session.buses = dict.fromkeys(names, typed(Bus, None))
    return session


class Person:
    """Fills a form with what it was told, and keeps the fields."""

    def __init__(self, session: Session, **answers: str) -> None:
        self.answers, self.fields = answers, list[AskedValue]()
        session.front.fill = self.fill

    async def fill(self, title: str, fields: Sequence[AskedValue]) -> Mapping[str, str] | None:
        self.fields += fields
        return self.answers or None


async def test_what_is_missing_is_asked_for_with_default_and_limits(session: Session) -> None:
    person = Person(session, far="3", fast="100")
    assert (await settled(session, TURNS, {}))[0] == {"far": "3", "fast": "100"}
    far, fast = person.fields
    assert (far.default, far.valid, far.problem("12")) == (
        "7",
        "a whole number, 1 to 9",
        "macro turns: invalid far = '12'; valid: a whole number, 1 to 9",
    )
    assert (fast.default, fast.problem("5")) == (None, "")


async def test_what_is_given_is_not_asked_for(session: Session) -> None:
    person = Person(session)
    assert (await settled(session, TURNS, {"fast": "5"}))[0] == {"far": "7", "fast": "5"}
    assert person.fields == []


async def test_a_wrong_value_is_told_before_anything_is_asked(session: Session) -> None:
    person = Person(session, fast="5")
    with pytest.raises(Diagnostic, match="invalid far = '12'; valid: a whole number, 1 to 9"):
        await settled(session, TURNS, {"far": "12"})
    assert person.fields == []


async def test_without_a_person_what_is_missing_is_told(session: Session) -> None:
    with pytest.raises(Diagnostic, match=r"macro turns, step 2: no value for \{fast\}"):
        await settled(session, TURNS, {})
    opened(session, "press", "eth")
    with pytest.raises(Diagnostic, match="macro home: no bus for the role gantry; --role gantry=URL opens one"):
        await settled(session, GANTRY, {})


async def test_a_person_who_gives_up_plays_nothing(session: Session) -> None:
    Person(session)
    with pytest.raises(Diagnostic, match="macro turns: no values were given; nothing was sent"):
        await settled(session, TURNS, {})


@pytest.mark.parametrize(
    ("buses", "given", "bus"),
    [
        (("press", "gantry"), {}, "gantry"),
        (("press",), {}, "press"),
        (("press", "eth"), {"gantry": "eth"}, "eth"),
    ],
)
async def test_a_role_is_played_by_an_open_bus(
    session: Session, buses: tuple[str, ...], given: dict[str, str], bus: str
) -> None:
    told: list[str] = []
    session.subscribe(lambda event: told.append(event.text) if isinstance(event, Notified) else None)
    _, roles = await settled(opened(session, *buses), GANTRY, given)
    assert roles == {"gantry": bus}
    assert told == ([] if bus == "gantry" else [f"macro home: gantry is {bus}"])


async def test_the_bus_of_a_role_is_asked_for_where_several_are_open(session: Session) -> None:
    person = Person(opened(session, "press", "eth"), gantry="eth")
    assert (await settled(session, GANTRY, {}))[1] == {"gantry": "eth"}
    assert person.fields[0].choices == ("press", "eth")
    assert "no bus x for the role gantry; open: press, eth" in person.fields[0].problem("x")
    with pytest.raises(Diagnostic, match="no bus x for the role gantry"):
        await settled(session, GANTRY, {"gantry": "x"})
    with pytest.raises(Diagnostic, match="role gantry cannot be press: a bus gantry is open; leave gantry=press out"):
        await settled(opened(session, "press", "gantry"), GANTRY, {"gantry": "press"})
