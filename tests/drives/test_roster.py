"""The drives of a link: restarts of some and of others with them, homings, the list, the search and its limits."""

import asyncio
import math
from contextlib import suppress
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from multidrop.base.errors import DriveError, NoAnswer
from multidrop.dialects import Hints, Motion, Owed
from multidrop.dialects.families import FAMILIES
from multidrop.drives.events import Restarted
from multidrop.drives.motion_record import MotionRecord
from multidrop.drives.port_journal import Keeper
from multidrop.drives.roster import RETRY_PAUSE, Restarts, Roster, _compare, _shown, _text
from multidrop.drives.roster import _ran_on as ran_on
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.state import MCodeState
from tests.drives.told_link import ToldLink
from tests.support.cell_session import party
from tests.support.simulated_bus import SimulatedBus

pytestmark = pytest.mark.virtual


class Link(ToldLink):
    """A link as far as a look for restarts asks it."""

    def publish(self, event: Any) -> None:
        self.events.append((event.address, event.certain) if isinstance(event, Restarted) else event)


class Drive:
    """A drive that rests at a place and is read without a wire."""

    programming = transferring = calm = strict = missing = False
    hold = ""
    anchored: frozenset[str] = frozenset()
    commands = 0
    ends_well = True

    def __init__(self, name: str, *axes: Motion, rested: dict[str, int] | None = None) -> None:
        self.shown = self.address = name
        self.axes: Any = axes
        self.rested = rested or {}
        self.settings: dict[str, Any] = {}
        self.state = MCodeState(MCode(), name)
        self.motions = MotionRecord()
        self.reads = 0
        self.family = SimpleNamespace(values=SimpleNamespace(parts=lambda facts: ()))

    async def motion(self) -> Any:
        self.reads += 1
        if isinstance(self.axes, Exception):
            raise self.axes
        return self.axes

    async def rest(self) -> Any:
        axes = await self.motion()
        return None if any(each.velocity for each in axes) else tuple(each.position for each in axes)

    async def homing_ended(self, axis: str) -> bool:
        return self.ends_well


def at(position: int, velocity: int = 0, axis: str = "") -> Motion:
    return Motion(position, velocity, axis)


def looking(*drives: Drive) -> tuple[Restarts, Link, list[Any]]:
    link: Any = Link()
    every: Any = list(drives)
    return Restarts(link, lambda: every), link, every


SAID = (
    "{} may have been restarted, too, and nothing that can be read shows whether: the program, the settings and the "
    "position may be other ones than before"
)


@pytest.mark.parametrize(
    ("rested", "axes", "runs_on"),
    [
        ({"": 5}, [at(5)], True),
        ({"": 5}, [at(6)], False),
        ({"": 0}, [at(0)], False),
        ({}, [at(5)], False),
        ({"x": 0, "y": 7}, [at(0, axis="x"), at(7, axis="y")], True),
    ],
)
def test_a_drive_that_rests_elsewhere_than_at_0_as_before_has_run_on(rested, axes, runs_on):
    assert ran_on(rested, axes) is runs_on


@pytest.mark.parametrize(
    ("name", "shown"), [("VM", "VM"), ("run_current_0", "run current 0"), ("RC", "RC"), ("A_B", "a b")]
)
def test_a_setting_is_shown_as_a_person_knows_it(name, shown):
    assert _shown(name) == shown


@pytest.mark.parametrize(("value", "text"), [(5, "5"), ((1, 2), "1,2"), ("x", "x"), ((), "")])
def test_the_value_of_a_setting_is_shown_as_it_is_typed(value, text):
    assert _text(value) == text


async def test_a_restart_is_counted_and_published_and_the_scales_rest_on_nothing():
    drive = Drive("a", at(5))
    restarts, link, (a,) = looking(drive)
    assert restarts.count(a) == 0
    restarts.restarted(a, certain=False)
    restarts.restarted(a, certain=False)
    assert restarts.count(a) == 2 and drive.state.recounts == 2
    assert link.events == [("a", False), ("a", False)] and link.told == []
    await asyncio.sleep(10)
    assert drive.reads == 0


@pytest.mark.parametrize(
    ("rested", "axes", "unsure"),
    [
        ({"": 5}, (at(5),), False),
        ({"": 5}, (at(0),), True),
        ({"": 0}, (at(0),), True),
        ({}, (at(5),), True),
        ({"": 5}, NoAnswer("no reply"), False),
    ],
)
async def test_where_one_drive_was_restarted_the_others_are_looked_at_once(rested, axes, unsure):
    first, other = Drive("a", at(0)), Drive("b", rested=rested)
    other.axes = axes
    restarts, link, (a, b) = looking(first, other)
    restarts.restarted(a)
    await asyncio.sleep(2.9)
    assert other.reads == 0
    await asyncio.sleep(0.2)
    assert (first.reads, other.reads) == (1, 1)
    assert link.events == [("a", True), *([("b", False)] if unsure else [])]
    assert link.told == ([(SAID.format("b"), "b", True)] if unsure else [])
    assert (restarts.count(a), restarts.count(b)) == (1, int(unsure))


async def test_several_such_drives_are_named_in_one_message_of_no_one_drive():
    restarts, link, (a, *_) = looking(Drive("a", at(0)), Drive("b", at(0)), Drive("c", at(0)))
    restarts.restarted(a)
    await asyncio.sleep(4)
    assert link.told == [(SAID.format("b, c"), "", True)]


@pytest.mark.parametrize("how", ["programming", "transferring"])
async def test_a_drive_that_stores_lines_is_not_looked_at(how):
    other = Drive("b", at(0))
    restarts, link, (a, _) = looking(Drive("a", at(0)), other)
    setattr(other, how, True)
    restarts.restarted(a)
    await asyncio.sleep(4)
    assert other.reads == 0 and link.told == []


@pytest.mark.parametrize("how", ["programming", "silent"])
async def test_those_behind_a_drive_that_cannot_be_read_are_looked_at_too(how):
    other = Drive("b", at(0))
    restarts, link, (a, *_) = looking(Drive("a", at(0)), other, Drive("c", at(0)))
    if how == "silent":
        other.axes = NoAnswer("no reply")
    else:
        other.programming = True
    restarts.restarted(a)
    await asyncio.sleep(4)
    assert link.told == [(SAID.format("c"), "c", True)]


async def test_a_drive_that_is_being_looked_at_by_itself_is_judged_by_that():
    """It says its own sign-on, which takes a second; it may not be named as unsure before that."""
    restarts, link, (a, b) = looking(Drive("a", at(0)), Drive("b", at(0)))
    restarts.restarted(a)
    await asyncio.sleep(2.5)
    restarts.replied_again(b, "sign-on")
    await asyncio.sleep(4)
    assert [text.split(";")[0] for text, *_ in link.told] == ["b was restarted (sign-on"]
    assert link.events == [("a", True), ("b", True)]


async def test_a_second_restart_meanwhile_looks_once_and_a_later_one_again():
    other = Drive("b", at(5), rested={"": 5})
    restarts, _, (a, _) = looking(Drive("a", at(0)), other)
    restarts.restarted(a)
    await asyncio.sleep(1)
    restarts.restarted(a)
    await asyncio.sleep(3)
    assert other.reads == 1
    restarts.restarted(a)
    await asyncio.sleep(4)
    assert other.reads == 2


async def test_another_drive_that_was_found_restarted_shortly_before_is_not_named_again():
    restarts, link, (a, b) = looking(Drive("a", at(0)), Drive("b", at(0)))
    restarts.restarted(b, certain=False)
    await asyncio.sleep(2.9)
    restarts.restarted(a)
    await asyncio.sleep(4)
    assert link.told == [] and link.events == [("b", False), ("a", True)]


async def test_one_that_was_found_long_before_is_named():
    restarts, link, (a, b) = looking(Drive("a", at(0)), Drive("b", at(0)))
    restarts.restarted(b, certain=False)
    await asyncio.sleep(3.1)
    restarts.restarted(a)
    await asyncio.sleep(4)
    assert link.told == [(SAID.format("b"), "b", True)]


async def test_a_drive_that_replies_again_is_looked_at_where_something_is_known_of_it():
    known, unknown, signed = Drive("a", at(5), rested={"": 5}), Drive("b", at(5)), Drive("c", at(5))
    restarts, link, every = looking(known, unknown, signed)
    restarts.replied_again(every[0])
    restarts.replied_again(every[1])
    restarts.replied_again(every[2], "sign-on")
    await asyncio.sleep(0.5)
    assert (known.reads, unknown.reads, signed.reads) == (1, 0, 0)
    await asyncio.sleep(0.6)
    assert signed.reads == 1
    assert [text.split(":")[0] for text, *_ in link.told] == ["c was restarted (sign-on; position 5 now)"]


@pytest.mark.parametrize(("sign", "counted"), [("", 1), ("sign-on", 0)])
async def test_a_restart_that_a_look_finds_ends_the_motions_and_one_with_a_sign_has_done_so_before(sign, counted):
    drive = Drive("a", at(0), rested={"": 5})
    restarts, link, (a,) = looking(drive)
    restarts.replied_again(a, sign)
    await asyncio.sleep(2)
    assert drive.motions.restarts == counted and len(link.told) == 1


async def test_a_look_that_is_under_way_is_not_begun_again():
    drive = Drive("a", at(5))
    restarts, _, (a,) = looking(drive)
    restarts.replied_again(a, "sign-on")
    restarts.replied_again(a, "sign-on")
    await asyncio.sleep(2)
    assert drive.reads == 1
    restarts.replied_again(a, "sign-on")
    await asyncio.sleep(2)
    assert drive.reads == 2


@pytest.mark.parametrize(("calm", "commands", "looks"), [(True, 3, True), (False, 3, False), (True, 2, False)])
async def test_settings_that_were_read_since_the_last_command_are_known(calm, commands, looks):
    drive = Drive("a", at(5))
    drive.calm, drive.commands, drive.settings = calm, 3, {"slow": ({"VM": 5}, commands)}
    restarts, _, (a,) = looking(drive)
    restarts.replied_again(a)
    await asyncio.sleep(1)
    assert drive.reads == int(looks)


@pytest.mark.parametrize("early", [30.0, 59.0, 61.0])
async def test_a_drive_that_was_silent_may_have_been_restarted_with_another_one_shortly_before(early):
    silent, first = Drive("a", at(0), rested={"": 0}), Drive("b", at(0))
    restarts, link, (b,) = looking(first)
    restarts.restarted(b)
    await asyncio.sleep(early)
    link.told.clear()
    a: Any = silent
    restarts.replied_again(a)
    await asyncio.sleep(0.1)
    assert link.told == ([(SAID.format("a"), "a", True)] if early < 60 else [])
    restarts.replied_again(a)
    await asyncio.sleep(0.1)
    assert len(link.told) == int(early < 60)


async def test_a_restart_that_is_not_certain_makes_no_other_drive_unsure():
    silent = Drive("a", at(0), rested={"": 0})
    restarts, link, (b,) = looking(Drive("b", at(0)))
    restarts.restarted(b, certain=False)
    a: Any = silent
    restarts.replied_again(a)
    await asyncio.sleep(1)
    assert link.told == []


async def test_its_own_restart_or_a_place_that_it_kept_makes_no_drive_unsure():
    own, kept = Drive("a", at(0), rested={"": 0}), Drive("c", at(5), rested={"": 5})
    restarts, link, (b,) = looking(Drive("b", at(0)))
    a: Any = own
    c: Any = kept
    restarts.restarted(a)
    restarts.replied_again(a)
    restarts.replied_again(c)
    await asyncio.sleep(1)
    assert link.told == []


@pytest.mark.parametrize(
    ("axis", "anchored", "text"),
    [
        ("", frozenset(), "a is referenced: the homing has ended"),
        ("x", frozenset(), "a x is referenced: the homing has ended"),
        (
            "x",
            frozenset("x"),
            "a x is referenced: the homing has ended; check its place, as a homing may leave the position",
        ),
    ],
)
async def test_a_homing_that_ends_well_gives_its_axis_a_reference(axis, anchored, text):
    drive = Drive("a", at(5, velocity=100))
    drive.anchored = anchored
    drive.state.reference_lost([axis, "z"])
    restarts, link, (a,) = looking(drive)
    restarts.homes(a, axis)
    await asyncio.sleep(3 * RETRY_PAUSE)
    assert link.told == [] and axis in drive.state.unreferenced
    drive.axes = (at(5),)
    await asyncio.sleep(2 * RETRY_PAUSE)
    assert link.told == [(text, "a", False)] and drive.state.unreferenced == {"z"}


async def test_a_homing_that_fails_or_is_not_heard_of_gives_none():
    bad, silent = Drive("a", at(5)), Drive("b")
    bad.ends_well, silent.axes = False, NoAnswer("no reply")
    for each in (bad, silent):
        each.state.reference_lost([""])
    restarts, link, every = looking(bad, silent)
    for each in every:
        restarts.homes(each, "")
    await asyncio.sleep(2)
    assert link.told == [] and bad.state.unreferenced == silent.state.unreferenced == {""}


async def test_another_homing_of_the_axis_takes_the_place_of_the_first_and_one_of_another_axis_does_not():
    drive = Drive("a", at(5, velocity=100))
    restarts, link, (a,) = looking(drive)
    for axis in ("x", "x", "y"):
        restarts.homes(a, axis)
    await asyncio.sleep(RETRY_PAUSE)
    drive.axes = (at(5),)
    await asyncio.sleep(2)
    assert [text for text, *_ in link.told] == [
        "a x is referenced: the homing has ended",
        "a y is referenced: the homing has ended",
    ]


async def test_at_the_end_nothing_is_looked_at_any_more():
    first, second = Drive("a", at(5, velocity=100)), Drive("b", at(0), rested={"": 4})
    restarts, link, (a, b) = looking(first, second)
    restarts.homes(a, "")
    restarts.replied_again(b, "sign-on")
    restarts.restarted(a)
    await asyncio.sleep(0.01)
    first.reads = 0
    restarts.close()
    await asyncio.sleep(10)
    assert first.reads == second.reads == 0 and link.told == []


async def test_a_defect_in_a_look_is_reported():
    drive = Drive("a")
    drive.axes = ValueError("no axes")
    restarts, link, (a,) = looking(drive)
    restarts.homes(a, "")
    await asyncio.sleep(1)
    assert link.told == [("a defect: ValueError", "", True)]


# Another drive after a loss


def state(**known: Any) -> MCodeState:
    made = MCodeState(
        known.pop("codec", MCode()), "a", **({"product": "LMDCM", "version": "6.0", "part": "p", "serial": "1"} | known)
    )
    return made


@pytest.mark.parametrize(
    ("before", "now", "notes"),
    [
        ({}, {}, []),
        ({}, {"label": "left"}, []),
        ({}, {"serial": "2"}, ["a: another drive replies than before the loss (serial number 1 before, 2 now)"]),
        (
            {},
            {"product": "MAI", "version": "5", "part": "q", "label": "left"},
            [
                "left: another drive replies than before the loss (product LMDCM before, MAI now; version 6.0 before, "
                "5 now; part p before, q now)"
            ],
        ),
        ({"serial": ""}, {"serial": "2"}, []),
        ({}, {"serial": ""}, []),
        ({}, {"codec": MCode(em=1)}, ["a: its settings are not those of before the loss; they were read again"]),
        ({}, {"address": "b"}, ["b: its settings are not those of before the loss; they were read again"]),
        (
            {"address": ""},
            {"address": "", "codec": MCode(em=1)},
            ["the drive: its settings are not those of before the loss; they were read again"],
        ),
        ({"product": ""}, {"serial": "2"}, []),
        ({}, {"product": "", "serial": "2"}, []),
        (
            {},
            {"serial": "2", "codec": MCode(em=1)},
            ["a: another drive replies than before the loss (serial number 1 before, 2 now)"],
        ),
    ],
)
def test_what_replies_after_a_loss_is_compared_with_what_was_there(before, now, notes):
    def made(known: dict[str, Any]) -> MCodeState:
        each = state(**{key: value for key, value in known.items() if key not in ("codec", "address")})
        each.codec, each.address = known.get("codec", MCode()), known.get("address", "a")
        return each

    found = made(now)
    _compare(made(before), found)
    assert found.take_messages() == (notes, [])


# The list


async def roster_of(*names: str, **more: Any) -> tuple[SimulatedBus, Roster]:
    shop = await SimulatedBus(*map(party, names), **more).open(*names)
    return shop, shop.bus.roster


async def test_an_address_that_was_used_is_stopped_until_a_question_shows_that_no_drive_has_it():
    shop, roster = await roster_of("a")
    missing = roster.at("b")
    assert missing is not roster.at("b") and roster.all_drives == [roster.at("a")]
    assert missing.state.settings_unknown and not missing.state.stranger
    assert roster.conversation_begins(missing) is False
    assert roster.at("b") is missing and roster.all_drives == [missing, roster.at("a")]
    assert roster.conversation_begins(missing) is True
    roster.conversation_ended(missing, "b", True)
    assert roster.all_drives == [missing, roster.at("a")]
    roster.conversation_ended(missing, "b", False)
    assert roster.all_drives == [roster.at("a")]


@pytest.mark.parametrize("everyone", ["*", "^"])
async def test_the_address_of_all_drives_is_not_listed_and_is_set_like_the_first(everyone):
    shop, roster = await roster_of("a")
    to_all = roster.at(everyone)
    assert roster.conversation_begins(to_all) is False
    assert roster.unlisted == {} and to_all.codec == roster.at("a").codec
    assert not to_all.state.settings_unknown


async def test_a_drive_that_is_listed_is_not_one_that_was_only_addressed():
    shop, roster = await roster_of("a", "b")
    assert roster.conversation_begins(roster.at("b")) is False
    assert roster.unlisted == {} and len(roster.all_drives) == 2


async def test_an_address_of_a_line_of_strangers_is_one_and_of_a_line_of_known_drives_is_none():
    roster = SimulatedBus(party("a")).bus.roster
    roster.family = FAMILIES["modbus"]
    device = roster.at("")
    assert roster.strange and device.state.stranger
    device.state.identified("LMDCE", "6.0")
    roster.drives[""] = device
    assert not roster.strange and roster.at("other").state.stranger == ""


async def test_a_homing_of_a_drive_of_the_list_is_watched_to_its_end():
    shop, roster = await roster_of("a")
    drive: Any = Drive("a", at(5))
    roster.homes(drive, "x")
    await asyncio.sleep(2)
    assert [each for each in shop.told if "homing" in each] == ["a x is referenced: the homing has ended"]


async def test_a_drive_that_gets_another_address_is_listed_under_it():
    shop, roster = await roster_of("a", "b")
    a = roster.drives["a"]
    a.state.address = "c"
    roster.conversation_ended(a, "a", True)
    assert list(roster.drives) == ["c", "b"] and roster.drives["c"] is a


async def test_a_drive_that_is_being_looked_for_is_probed_once():
    shop, roster = await roster_of("a")
    assert roster.probing == ()
    roster.probes("x")
    roster.probes("y")
    roster.probes("x")
    assert roster.probing == ("x", "y")


async def test_a_line_is_strange_while_no_drive_of_it_is_known():
    shop = SimulatedBus(party("a"))
    roster = shop.bus.roster
    assert roster.strange == bool(roster.family.new_state(roster.family.codec, "").stranger)
    await shop.open("a")
    assert not roster.strange
    roster.drives["a"].state.identified("", "", stranger="it said nothing")
    assert roster.strange


async def test_bytes_without_a_question_are_noted_for_each_drive():
    shop, roster = await roster_of("a", "b")
    for each in roster.all_drives:
        each.state.program_read(error=False, running=False)
    shop.bus.link.on_unasked()
    assert [each.state.others_heard for each in roster.all_drives] == [True, True]


SIGN_ON = ("Copyright 2010 by Schneider Electric Motion USA, Inc.",)


def sign_on(roster: Roster) -> tuple[str, ...]:
    codec = roster.link.line.inbox.codec
    found = [
        each for each in (*SIGN_ON, "Copyright 2001-2011 by Intelligent Motion Systems, Inc.") if codec.restarted(each)
    ]
    return tuple(found[:1])


@pytest.mark.parametrize(
    ("names", "text", "certain"),
    [
        (("a",), "a was restarted (sign-on); its settings are read before the next line", True),
        (("a", "b"), "one of a, b was restarted (sign-on); its settings are read before the next line", False),
    ],
)
async def test_a_sign_on_is_reported_once_and_is_certainly_that_of_a_drive_that_is_alone(names, text, certain):
    shop, roster = await roster_of(*names)
    lines = sign_on(roster)
    assert lines
    roster.link.on_unsolicited(("a print", *lines))
    assert [each for each in shop.told if "(sign-on)" in each] == [text]
    assert [each.certain for each in shop.events if isinstance(each, Restarted)] == [certain] * len(names)
    assert [drive.motions.restarts for drive in roster.all_drives] == [int(certain)] * len(names)
    assert all(drive.state.settings_unknown for drive in roster.all_drives)
    roster.restarts.close()


async def test_a_print_is_no_sign_on():
    shop, roster = await roster_of("a")
    roster.link.on_unsolicited(("a print",))
    assert not any(isinstance(each, Restarted) for each in shop.events)


# The search


@pytest.mark.parametrize(
    ("baud", "timeout", "probing", "hints", "limit"),
    [
        (9600, 1.0, (), Hints(), 12.0),
        (0, 1.0, (), Hints(), 12.0),
        (4800, 1.0, ("a",), Hints(), 12.0),
        (2400, 1.0, ("a", "b"), Hints(), 32.0),
        (9600, 3.0, ("a",), Hints(), 36.0),
        (1200, 3.0, ("a",), Hints(), 48.0),
        (9600, 0.5, ("a",), Hints(cut="aMR 1"), 72.0),
        (9600, 1.0, ("a",), Hints(owed=(Owed(1, "a", "x", "1", "p"),)), 72.0),
    ],
)
async def test_a_search_has_a_limit_for_itself_its_places_and_its_repairs(baud, timeout, probing, hints, limit):
    roster = SimulatedBus(party("a"), baud=baud, timeout=timeout).bus.roster

    async def never(*_: Any, **named: Any) -> Any:
        await asyncio.sleep(math.inf)

    roster.conversations.run = never  # type: ignore[method-assign]
    begun = asyncio.get_running_loop().time()
    with pytest.raises(NoAnswer, match=f"no drive could be identified within {limit:.0f} s"):
        await roster.search(replace(hints, drives=probing))
    assert asyncio.get_running_loop().time() - begun == pytest.approx(limit)


async def searched(roster: Roster, hints: Hints, *found: Any) -> list[Hints]:
    """The hints of each search, where these are the outcomes."""
    asked: list[Hints] = []
    outcomes = iter(found)

    async def search(hints: Hints) -> Any:
        asked.append(hints)
        outcome = next(outcomes)
        if isinstance(outcome, Exception):
            raise outcome
        return outcome

    roster.search = search  # type: ignore[method-assign]
    with suppress(DriveError):
        await roster.search_again(hints)
    return asked


async def test_after_a_loss_drives_are_looked_for_where_they_were_and_then_where_they_were_at_first():
    shop, roster = await roster_of("a", "b")
    roster.drives["b"].state.sync_marks = 9
    mark = max(each.state.sync_marks for each in roster.all_drives)
    owed = Owed(1, "b", "x", "1", "p")
    roster.drives["b"].state.owes(owed)
    given = Hints(
        drives=("a",), party=True, checksum=1, em=1, addressed=False, cut="aMR", owed=(Owed(0, "z", "", "", ""),)
    )
    first = replace(given, checksum=None, em=None, cut="", owed=(owed,), first_mark=mark)
    last = replace(first, drives=("a", "b"), party=True, addressed=True)
    assert await searched(roster, given, NoAnswer("none"), []) == [last, first]
    assert await searched(roster, given, []) == [last]


async def test_a_second_search_that_would_ask_the_same_is_not_made():
    shop, roster = await roster_of("a")
    given = Hints(drives=("a",), party=True)
    mark = roster.drives["a"].state.sync_marks
    assert await searched(roster, given, NoAnswer("none")) == [replace(given, first_mark=mark)]


async def test_without_a_drive_the_first_search_is_made_again():
    shop = SimulatedBus(party("a"))
    given = Hints(drives=("a",), party=True, em=1, cut="x")
    assert await searched(shop.bus.roster, given, []) == [given]
    assert shop.bus.roster.stated == ("a",)


async def test_a_drive_without_a_name_is_looked_for_without_one():
    shop = await SimulatedBus('personality = "LMDCM"').open()
    mark = shop.bus.roster.drives[""].state.sync_marks
    given = Hints(addressed=False)
    [again] = await searched(shop.bus.roster, given, [])
    assert again == replace(given, party=False, first_mark=mark)


async def test_what_is_to_be_remembered_goes_to_the_keeper():
    kept: list[Any] = []

    class Kept(Keeper):
        def remember(self, drives: Any) -> None:
            kept.append(drives)

    shop, roster = await roster_of("a", keeper=Kept())
    kept.clear()
    roster.remember()
    assert kept == [{"a": roster.drives["a"].family.remember()}]
    roster.drives = {}
    roster.remember()
    assert len(kept) == 1


async def test_after_a_loss_a_drive_that_is_there_keeps_what_is_known_of_it_and_one_that_is_not_is_still_stopped():
    shop, roster = await roster_of("a", "b")
    a, b = roster.drives["a"], roster.drives["b"]
    a.label, a.missing, looked = "left", True, list[Any]()
    roster.restarts.replied_again = lambda drive, sign="": looked.append((drive, sign))  # type: ignore[method-assign]
    b.state.settings_confirmed()
    now, other = state(codec=MCode(em=1)), MCodeState(MCode(em=1), "c")
    roster.found_again([now, other])
    assert list(roster.drives) == ["a", "c"] and roster.drives["a"] is a and looked == [(a, "")]
    assert a.state is now and (a.label, a.missing) == ("left", False)
    assert roster.unlisted == {"b": b} and b.state.settings_unknown
    assert roster.link.line.inbox.codec is now.codec
    assert len(roster.all_drives) == 3


async def test_a_sole_drive_that_was_renamed_is_the_same_one():
    shop, roster = await roster_of("a")
    a = roster.drives["a"]
    roster.found_again([MCodeState(MCode(em=1), "z", product="LMDCM")])
    assert roster.drives == {"z": a} and roster.unlisted == {} and a.address == "z"


@pytest.mark.parametrize(
    ("hints", "probing"),
    [
        (Hints(drives=("a", "b")), ("a", "b")),
        (Hints(drives=("a",), tried=("t",)), ("a",)),
        (Hints(tried=("t", "u")), ("t", "u")),
        (Hints(), ()),
    ],
)
async def test_while_drives_are_looked_for_a_stop_reaches_the_addresses_that_may_be_asked(hints, probing):
    shop = SimulatedBus(party("a"))
    roster, seen = shop.bus.roster, list[Any]()

    async def run(procedure: Any, state: Any, searching: bool) -> Any:
        procedure.close()
        seen.append((roster.probing, state.address, searching))
        return []

    roster.conversations.run = run  # type: ignore[assignment]
    assert await roster.search(hints) == []
    assert seen == [(probing, "", True)]


async def test_a_search_that_takes_too_long_ends_with_the_likely_causes():
    shop = SimulatedBus(party("a"))
    roster = shop.bus.roster

    async def run(procedure: Any, state: Any, searching: bool) -> Any:
        procedure.close()
        await asyncio.sleep(1e5)

    roster.conversations.run = run  # type: ignore[assignment]
    began = shop.bus.now()
    with pytest.raises(NoAnswer, match=r"^no drive could be identified within 16 s; nothing was received; check power"):
        await roster.search(Hints(drives=("a", "b")))
    assert shop.bus.now() - began == pytest.approx(16.0)
