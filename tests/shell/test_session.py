"""A session on simulated buses: where lines go, what is told, and what a stop does."""

import asyncio
import contextlib
import re
from dataclasses import replace

import pytest

from multidrop.base.errors import Diagnostic, DriveError, Inexpressible, NoAnswer, Refused, Stopped, TransportLost
from multidrop.drives.events import Notice, Sent, Unsolicited
from multidrop.macros import Macro, MacroStep
from multidrop.shell.channel import Front
from multidrop.shell.events import By, Entered, Failed, Notified, OnBus, Output, Printed, StateChanged
from multidrop.shell.scripts.executor import play
from multidrop.shell.streams.stdout import report
from tests.support.cell_session import ETHERNET, CellSession, bus, drive, party, pmx

pytestmark = pytest.mark.virtual

DWELL = 'program_text = """\nPG 1\nLB Ga\nH 2000\nE\nPG\n"""'
PRESS = bus("press", party("a"), f"{party('b')}\n{DWELL}", party("c"), baud=0)
ETH = bus("eth", ETHERNET, baud=0)


class Press(CellSession):
    """A session on the press, whose drives note what they carry out, prints excepted: `done`, as (drive, line)."""

    def __init__(self, folder, *buses):
        super().__init__(folder, *buses)
        self.done = []

    async def __aenter__(self):
        await super().__aenter__()
        for placed in self.floor.floor.drives:
            placed.device.execute = self._noting(placed.spec.name, placed.device.execute)
        return self

    def _noting(self, name, execute):
        def noted(text, now):
            answer = execute(text, now)
            if not answer.refused and not text.startswith("PR") and text.strip():
                self.done.append((name, text.strip()))
            return answer

        return noted

    def heard(self, kind):
        return [event for event in self.events if isinstance(event, kind)]

    async def run(self, *lines):
        for line in lines:
            await self.session.run(line)


@pytest.fixture
async def press(tmp_path):
    async with Press(tmp_path, PRESS) as cell:
        yield cell


@pytest.fixture
async def both(tmp_path):
    """The press, and another bus beside it."""
    async with Press(tmp_path, PRESS, ETH) as cell:
        yield cell


async def test_the_first_bus_and_its_first_drive_are_selected(both):
    assert (both.session.selected_bus, both.session.selected.address) == ("press", "a")
    await both.run("MR 100")
    assert both.done == [("a", "MR 100")]


@pytest.mark.parametrize(
    ("line", "bus", "sent"),
    [
        ("PR P", "press", b"aPR P"),
        ("  PR P  ", "press", b"aPR P"),
        ("@b MR 100", "press", b"bMR 100"),
        ("@gantry MR 100", "press", b"bMR 100"),
        ("@* SL 0", "press", b"*SL 0"),
        ("@^ MA 0", "press", b"^MA 0"),
        ("@x MR 100", "press", b"x"),
        ("@eth: PR P", "eth", b"PR P"),
    ],
)
async def test_a_line_goes_where_it_says(both, line, bus, sent):
    both.session.buses["press"].drives["b"].label = "gantry"
    with contextlib.suppress(NoAnswer):
        await both.run(line)
    other = "eth" if bus == "press" else "press"
    assert sent in both.written(bus) and both.written(other) == b""


@pytest.mark.parametrize(
    ("line", "right"),
    [
        ("bMR 10000", "@b MR 10000"),
        ("  bSL 0", "@b SL 0"),
        ("@b aPR P", "@a PR P"),
        ("aMR 10000", "@a MR 10000"),
        ("*SL 0", "@* SL 0"),
        ("^MA 0", "@^ MA 0"),
        ("@* bMR 5", "@b MR 5"),
        ("b MR 10000", "@b MR 10000"),
        ("b  SL 0", "@b SL 0"),
    ],
)
async def test_an_address_at_the_head_of_a_command_is_refused_with_the_right_spelling(both, line, right):
    with pytest.raises(Inexpressible, match=re.escape(f"is not a command: write {right}; nothing was sent")):
        await both.run(line)
    assert both.written("press") == both.written("eth") == b""
    with pytest.raises(Diagnostic, match=re.escape(f"write {right}")):
        await play(both.session, both.session.origin, Macro("m", (MacroStep(0.0, line),)), {})
    assert both.written("press") == both.written("eth") == b""


async def test_the_name_of_a_drive_that_is_alone_is_no_part_of_its_commands(tmp_path):
    async with Press(tmp_path, bus("alone", drive("LMDCM", "b"), baud=0)) as cell:
        with pytest.raises(Inexpressible, match="write MR 5; nothing was sent"):
            await cell.run("bMR 5")
        assert cell.written("alone") == b""


@pytest.mark.parametrize(
    ("line", "right"),
    [("01PX", "@01 PX"), ("01X1000", "@01 X1000"), ("00 STOPX", "@00 STOPX"), ("@00 01EX=1", "@01 EX=1")],
)
async def test_a_number_at_the_head_of_a_command_of_a_controller_is_refused_likewise(tmp_path, line, right):
    async with Press(tmp_path, bus("p", pmx("00"), pmx("01"))) as cell:
        with pytest.raises(Inexpressible, match=re.escape(f"is not a command: write {right}; nothing was sent")):
            await cell.run(line)
        assert cell.written("p") == b""


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("@01PX", "with a blank between them"),
        ("@01X1000", "with a blank between them"),
        ("@bMR 5", "'@bMR 5' is not a command: write @b MR 5; nothing was sent"),
        ("@2GAP 1, 0", "no module address '2GAP'; valid: 1 to 255"),
    ],
)
async def test_an_address_without_a_blank_behind_it_is_told_so(tmp_path, line, told):
    module = 'personality = "TMCM"\nname = "2"'
    cells = {"@0": bus("l", pmx("00"), pmx("01")), "@b": bus("l", party("a"), party("b")), "@2": bus("l", module)}
    async with Press(tmp_path, cells[line[:2]]) as cell:
        with pytest.raises((Inexpressible, Diagnostic), match=re.escape(told)):
            await cell.run(line)
        assert cell.written("l") == b""


@pytest.mark.parametrize("line", ["PR P", "aS=0", "xMR 5", "bX 5", "b", "BX=5", "b R1", "b P"])
async def test_a_command_that_begins_like_an_address_is_sent_as_it_is(both, line):
    with contextlib.suppress(Refused):
        await both.run(line)
    assert b"a" + line.encode() in both.written("press")


async def test_what_a_drive_prints_and_what_it_says_by_itself_are_told(press):
    await press.run("@b PR A,D", "@b PR VM")
    link = press.session.buses["press"].link
    link.publish(Unsolicited(5.0, ("Hello", "there")))
    link.publish(Notice(5.0, "taken out of program mode", "b", warning=True))
    assert [(each.address, each.text) for each in press.heard(Printed)] == [("b", "10000001000000"), ("b", "768000")]
    assert OnBus("press", Unsolicited(5.0, ("Hello", "there"))) in press.heard(OnBus)
    assert press.heard(Notified)[-1].warning
    assert [(each.line, each.bus, each.address) for each in press.heard(Entered)][0] == ("@b PR A,D", "press", "b")


@pytest.mark.parametrize(
    ("world", "failure"), [("", Refused), ("/sim power b off", NoAnswer), ("/sim unplug press", TransportLost)]
)
async def test_a_failure_is_told_once_and_raised(press, world, failure):
    if world:
        press.world(world)
    with pytest.raises(failure) as caught:
        await press.run("@b VX")
    assert [(each.text, each.address) for each in press.heard(Failed) if each.address] == [(str(caught.value), "b")]


async def test_where_several_buses_are_open_a_failure_says_which_it_was(both):
    with pytest.raises(Refused) as caught:
        await both.run("@eth: VX")
    assert report(caught.value).startswith("eth: ")


async def test_a_failure_in_the_background_is_told_and_not_raised(press):
    await press.session.start("VX")
    assert len(press.heard(Failed)) == 1


@pytest.mark.parametrize("line", ["/nothing", "@ ", "@b", "@b /wait stopped", "@nowhere:b PR P", "/use", "/use x"])
async def test_a_line_that_means_nothing_is_a_diagnostic_and_nothing_is_sent(press, line):
    with pytest.raises(Diagnostic):
        await press.run(line)
    assert press.written("press") == b"" and len(press.heard(Failed)) == 1


async def test_with_nothing_open_a_line_says_how_to_open(tmp_path):
    with pytest.raises(Diagnostic, match="/open"):
        await Press(tmp_path, PRESS).run("PR P")


async def test_a_drive_that_answers_where_none_was_known_is_known_from_then_on(press):
    await press.run("/close press")
    [line] = await press.session.open(f"{press.url}?drives=a,b")
    press.world("/sim power c off")
    with pytest.raises(NoAnswer):
        await press.run("@c VX")
    assert list(line.drives) == ["a", "b"]
    press.world("/sim power c on")
    await asyncio.sleep(1)
    await press.run("@c PR P")
    assert list(line.drives) == ["a", "b", "c"]


async def test_a_bus_that_cannot_be_identified_is_closed_again(press):
    await press.run("/close press")
    with pytest.raises(NoAnswer):
        await press.session.open(f"{press.url}?drives=q")
    assert press.session.buses == press.session.cells == {} and press.session.selected_bus == ""


async def test_buses_of_the_same_name_are_told_apart(press):
    await press.session.open(press.url)
    assert list(press.session.buses) == ["press", "press-2"]
    with pytest.raises(Diagnostic, match="already open"):
        await press.session.open(press.url, "press")


async def test_for_a_person_closing_the_selected_bus_selects_another(both):
    both.session.front = Front(before_quit=agreed)
    await both.run("/close press")
    assert both.session.selected_bus == "eth" and list(both.session.buses) == ["eth"]
    await both.run("/close eth")
    assert both.session.selected is None


async def test_a_line_after_the_close_of_the_selected_bus_goes_to_no_other_one(both):
    await both.run("/close press")
    with pytest.raises(Diagnostic, match="no bus is selected since the selected one was closed; /use selects one: eth"):
        await both.run("SL 200000")
    assert both.written("eth") == b""
    await both.run("/use eth")
    await both.run("PR P")
    assert both.written("eth")


async def test_closing_another_bus_leaves_the_selection(both):
    await both.run("/close eth")
    await both.run("PR P")
    assert both.session.selected_bus == "press" and both.written("press")


async def test_after_an_accepted_quit_a_line_of_a_person_is_refused_and_a_macro_ends_its_work(press):
    await press.run("/quit")
    for line in ("SL 200000", "@b SL 5", "/open sim:", "/play m"):
        with pytest.raises(Diagnostic, match=f"multidrop is ending, so '{line}' was not sent"):
            await press.session.run(line)
    assert press.written("press") == b""
    await press.session.run("PR P", replace(press.session.origin, by=By.MACRO))  # of its `on_early_end`
    await press.session.run("/stop")
    assert press.session.stops == 1


async def test_a_quit_that_is_declined_fails_its_line_and_changes_nothing(press):
    async def declined():
        return False

    press.session.front = Front(before_quit=declined)
    with pytest.raises(Diagnostic, match="multidrop goes on"):
        await press.session.run("/quit")
    await press.session.run("PR P")
    assert not press.session.quitting


async def test_a_lost_bus_is_told_once(press):
    press.world("/sim unplug press")
    await asyncio.sleep(1)
    [failed] = press.heard(Failed)
    assert "unplugged" in failed.text


# Stop


async def test_a_stop_reaches_every_bus_ends_what_runs_and_latches(both):
    session = both.session
    await both.run("@b SL 50000")
    waiting = [asyncio.create_task(session.run(line)) for line in ("/sleep 1000", "/wait stopped 1000")]
    await asyncio.sleep(0)
    both.events.clear()
    session.stop("test")
    assert b"\x1b" in both.written("press") and b"\x1b" in both.written("eth") and session.latched
    for each in waiting:
        with pytest.raises(Stopped):
            await each
    assert not session.busy


async def test_a_stop_latches_against_automation_but_not_against_a_person(press):
    session = press.session
    session.stop()
    for by in (By.MACRO, By.SCRIPT):
        with pytest.raises(Stopped, match="/resume"):
            await session.run("MR 100", replace(session.origin, by=by))
    with pytest.raises(Stopped):
        await session.run("/resume", replace(session.origin, by=By.SCRIPT))
    await session.run("R1=5")
    await session.run("/resume")
    await session.run("MR 100", replace(session.origin, by=By.SCRIPT))
    assert press.done == [("a", "R1=5"), ("a", "MR 100")]


async def test_a_line_typed_before_a_stop_is_not_sent_after_it(press):
    session = press.session
    typed = session.stops
    waiting = session.start("MR 5")
    session.stop()
    with pytest.raises(Stopped, match="'MR 51200' was typed"):
        await session.run("MR 51200", since=typed)
    await waiting
    assert press.done == []
    await session.run("MR 7", since=session.stops)
    assert press.done == [("a", "MR 7")]


async def test_a_stop_before_anything_is_open_does_no_harm(tmp_path):
    session = Press(tmp_path, PRESS).session
    session.stop()
    assert session.latched


async def test_cancelling_a_wait_from_outside_is_no_stop(press):
    waiting = asyncio.create_task(press.session.run("/sleep 1000"))
    await asyncio.sleep(0)
    waiting.cancel()
    with pytest.raises(asyncio.CancelledError):
        await waiting
    assert not press.session.latched


# Waits


async def test_wait_stopped_wants_two_readings_of_every_drive_that_was_addressed(press):
    await press.run("@b MR 1", "@* SL 0")
    press.events.clear()
    await press.run("/wait stopped 5")
    asked = [each.event.request.address for each in press.heard(OnBus) if isinstance(each.event, Sent)]
    assert [asked.count(name) >= 2 for name in "abc"] == [True] * 3


async def test_a_wait_that_runs_out_is_a_failure_that_names_the_drive(press):
    await press.run("@b SL 100")
    with pytest.raises(DriveError, match=r"/wait stopped: b .* after 0 s"):
        await press.run("/wait stopped 0")


async def test_wait_idle_also_waits_for_the_program(press):
    loop = asyncio.get_running_loop()
    for wait, most in (("/wait stopped 5", 1.0), ("/wait idle 5", 5.0)):
        begun = loop.time()
        await press.run("@b EX Ga", wait)
        took = loop.time() - begun
        assert took < most and press.device("press:b").running is (wait == "/wait stopped 5")
    assert took > 2.0


async def test_a_drive_in_program_mode_is_not_asked(press):
    await press.run("PG 1")
    with pytest.raises(DriveError, match="program mode"):
        await press.run("/wait stopped")


@pytest.mark.parametrize("line", ["/wait", "/wait running", "/wait stopped soon", "/sleep", "/sleep -1", "/sleep 1e9"])
async def test_a_wait_that_is_not_understood_shows_its_usage(press, line):
    with pytest.raises(Diagnostic, match="usage: /"):
        await press.run(line)


# Macros


def steps(cell, name):
    return [step.line for step in cell.session.macros.load(name).steps]


async def test_a_macro_keeps_lines_with_their_address_and_only_what_drives_see(press):
    await press.run(
        "/record shuttle", "MR 100", "/use b", "MR 200", "/wait stopped", "@c R1=5", "/drives", "/record stop"
    )
    assert steps(press, "shuttle") == ["@a MR 100", "@b MR 200", "/wait stopped", "@c R1=5"]
    press.done.clear()
    await press.run("/play shuttle")
    assert press.done == [("a", "MR 100"), ("b", "MR 200"), ("c", "R1=5")]


async def test_with_several_buses_a_macro_keeps_the_bus_too(both):
    await both.run("/record m", "MR 1", "@eth: MR 2", "/record stop")
    assert steps(both, "m") == ["@press:a MR 1", "@eth: MR 2"]


async def test_what_a_playing_macro_sends_is_not_recorded(press):
    await press.run("/record inner", "MR 1", "/record stop", "/record outer", "/play inner", "/record stop")
    assert steps(press, "outer") == ["/play inner"]


async def test_recording_is_seen_and_ends_well(press):
    await press.run("/record m")
    assert press.session.recording == "m"
    with pytest.raises(Diagnostic):
        await press.run("/record other")
    with pytest.raises(Diagnostic, match="nothing was typed"):
        await press.run("/record stop")
    assert press.session.recording == ""


def save(cell, *lines):
    cell.session.macros.save(Macro("m", tuple(MacroStep(0.0, line) for line in lines)))


async def test_a_stop_ends_a_playing_macro_and_refuses_the_next(press):
    save(press, "MR 1", "/sleep 5", "MR 2")
    playing = asyncio.create_task(press.session.run("/play m"))
    await asyncio.sleep(2)
    assert [each.name for each in press.session.playing] == ["m"]
    press.session.stop()
    with pytest.raises(Stopped):
        await playing
    with pytest.raises(Stopped, match="/resume"):
        await press.run("/play m")
    assert press.done == [("a", "MR 1")] and press.session.playing == []


async def test_a_macro_goes_on_with_the_drive_that_was_selected_as_it_began(both):
    save(both, "R1=1", "/sleep 5", "R1=2", "@b R1=3", "@eth: R1=4", "/use eth", "R1=5")
    playing = asyncio.create_task(both.session.run("/play m"))
    await asyncio.sleep(2)
    both.session.select("", "eth")
    await playing
    assert both.done == [("a", "R1=1"), ("a", "R1=2"), ("b", "R1=3"), ("!", "R1=4"), ("!", "R1=5")]


async def test_a_failing_line_ends_the_macro_and_is_told_once(press):
    save(press, "VX", "MR 2")
    with pytest.raises(Refused):
        await press.run("/play m")
    assert press.done == [] and len(press.heard(Failed)) == 1


async def test_a_macro_that_plays_itself_is_refused(press):
    press.session.macros.save(Macro("n", (MacroStep(0.0, "/play m"),)))
    save(press, "/play n")
    with pytest.raises(Diagnostic, match=r"macro n, step 1 .*: m would call itself: m -> n -> m; use /repeat"):
        await press.run("/play m")
    assert press.session.playing == []


async def test_a_key_plays_one_macro(press):
    macros = press.session.macros
    for name in ("m", "n"):
        await press.run(f"/record {name}", "MR 1", "/record stop", f"/key f3 {name}")
    assert [macro.name for macro in macros.on_key("F3")[0]] == ["n"] and macros.load("m").key == ""
    await press.run("/record n --replace", "MR 2", "/record stop")
    assert macros.load("n").key == "F3"
    await press.run("/key F3 off")
    assert macros.on_key("F3")[0] == []


async def test_quit_is_for_the_front_end_to_see(press):
    await press.run("/quit")
    assert press.session.quitting and press.heard(StateChanged)


@pytest.mark.parametrize("word", ["exit", "quit", "help", "?", " Help "])
async def test_a_bare_word_that_a_person_types_is_the_verb_and_goes_to_no_drive(press, word):
    press.session.front = Front(before_quit=agreed)
    await press.run(word)
    assert press.done == []
    assert press.session.quitting is (word in ("exit", "quit"))
    assert any("/open" in each.text for each in press.heard(Output)) is not press.session.quitting


async def agreed():
    return True


@pytest.mark.parametrize("by", [By.OPERATOR, By.MACRO])
@pytest.mark.parametrize("word", ["exit", "quit", "help", "?"])
async def test_a_bare_word_of_a_script_or_a_pipe_is_refused_and_goes_to_no_drive(press, word, by):
    with pytest.raises(Diagnostic, match="not a command of a drive: .*; nothing was sent"):
        await press.session.run(word, replace(press.session.origin, by=by))
    assert (press.done, press.heard(Sent)) == ([], [])


async def test_program_mode_and_an_address_take_a_bare_word_as_it_is(press):
    press.session.front = Front(before_quit=agreed)
    await press.run("PG 100")
    with pytest.raises(Refused, match="in program mode"):
        await press.run("help")
    await press.run("PG")
    with pytest.raises(Refused):
        await press.run("@a exit")
    assert not press.session.quitting
