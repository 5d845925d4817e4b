"""Session over buses that are not there: where lines go, what is told, and what a stop does."""

import asyncio
from dataclasses import dataclass, field

import pytest

from multidrop.dialects import Diagnostic, DriveError, Hints, Motion, NoAnswer, Refused, Stopped
from multidrop.dialects.families import DEFAULT, FAMILIES
from multidrop.dialects.mcode.host.codec import MCode
from multidrop.dialects.mcode.host.state import MCodeState
from multidrop.drives.events import Changed, Lost, Notice, Unsolicited
from multidrop.drives.stopping import Halt
from multidrop.macros import Macro, Step
from multidrop.shell.connect.opening import Opened
from multidrop.shell.connect.settings import SavedConnection, Settings
from multidrop.shell.events import By, Entered, Failed, Notified, OnBus, Printed, StateChanged
from multidrop.shell.session import Session
from multidrop.shell.streams.stdout import report
from multidrop.transports import TransportLost


@dataclass(eq=False)
class FakeDrive:
    bus: "FakeBus"
    address: str
    label: str = ""
    product: str = "LMDCM"
    version: str = "6.002"
    programming: bool = False
    family: object = FAMILIES[DEFAULT]
    state: object = field(default_factory=lambda: MCodeState(MCode()))

    seen = running = None
    commands = 0
    started_at = commanded_at = float("-inf")
    starting = 0

    def starts(self, text):
        return not text.startswith("PR")

    @property
    def link(self):
        return self.bus

    async def send(self, text):
        self.bus.sent.append((self.address, text))
        answer = self.bus.answers.get(text, ())
        if isinstance(answer, BaseException):
            raise answer
        if isinstance(answer, asyncio.Event):
            await answer.wait()
            return ()
        return answer

    async def motion(self):
        return (Motion(0, 0),)

    async def rest(self):
        return () if not self.bus.standing or self.bus.standing.pop(0) else None

    async def busy(self):
        return self.bus.programs.pop(0) if self.bus.programs else False


class FakeBus:
    def __init__(self, name, addresses):
        self.name, self.lost, self.stops, self.closed = name, None, 0, False
        self.addresses, self.drives, self.sent, self.watchers = addresses, {}, [], []
        self.answers, self.standing, self.programs = {}, [], []
        self.halts, self.told_of, self.last_stop, self.fails = [], [], None, None

    @property
    def link(self):
        return self

    @property
    def away(self):
        return self.lost

    loss = away

    def watch(self, watcher):
        self.watchers.append(watcher)
        return lambda: self.watchers.remove(watcher)

    def publish(self, event):
        for watcher in list(self.watchers):
            watcher(event)

    def start(self):
        pass

    async def identify(self, hints):
        if isinstance(self.addresses, BaseException):
            raise self.addresses
        self.drives = {address: FakeDrive(self, address) for address in self.addresses}
        return list(self.drives.values())

    def at(self, address):
        return self.drives.get(address) or FakeDrive(self, address)

    @property
    def all_drives(self):
        return list(self.drives.values())

    def halt(self, only=None):
        """Noted as the real one does it; `fails` is raised in place of that."""
        if self.fails:
            raise self.fails
        self.stops += 1
        drives = tuple(self.all_drives if only is None else only)
        self.halts.append(Halt(self, asyncio.get_running_loop().time(), self.stops, only is None, drives, data=b"!"))
        self.last_stop = self.halts[-1] if only is None else self.last_stop
        return self.halts[-1]

    def halted(self, halt):
        self.told_of.append(halt)

    async def settled(self):
        pass

    async def close(self):
        self.closed = True


class Shop:
    """What the fake URLs lead to, by scheme-less name."""

    def __init__(self):
        self.buses = {}

    def put(self, name, addresses="abc"):
        self.buses[name] = FakeBus(name, addresses)
        return self.buses[name]

    async def opener(self, connection, naming):
        wanted = connection.target.removeprefix("/").split("+")
        for name in wanted:
            self.buses[name].name = naming(self.buses[name].name)
        return [Opened(self.buses[name], Hints()) for name in wanted]


@pytest.fixture
def shop():
    return Shop()


@pytest.fixture
async def session(shop, tmp_path):
    names = {"b": "gantry"}
    settings = Settings({"saved": SavedConnection("saved", "/press", names)}, tmp_path / "c", tmp_path / "s")
    made = Session(settings, shop.opener)
    made.events = []
    made.subscribe(made.events.append)
    yield made
    await made.close()


def told(session, kind):
    return [event for event in session.events if isinstance(event, kind)]


async def test_the_first_bus_and_its_first_drive_are_selected(session, shop):
    press = shop.put("press")
    shop.put("eth", "!")
    await session.open("/press")
    await session.open("/eth")
    assert (session.selected_bus, session.selected.address) == ("press", "a")
    await session.run("MR 100")
    assert press.sent == [("a", "MR 100")]


@pytest.mark.parametrize(
    ("line", "bus", "sent"),
    [
        ("PR P", "press", ("a", "PR P")),
        ("  PR P  ", "press", ("a", "PR P")),
        ("@b MR 100", "press", ("b", "MR 100")),
        ("@gantry MR 100", "press", ("b", "MR 100")),
        ("@* SL 0", "press", ("*", "SL 0")),
        ("@^ MA 0", "press", ("^", "MA 0")),
        ("@x MR 100", "press", ("x", "MR 100")),
        ("@eth:! PR P", "eth", ("!", "PR P")),
    ],
)
async def test_a_line_goes_where_it_says(session, shop, line, bus, sent):
    shop.put("press"), shop.put("eth", "!")
    await session.open("saved", "press")
    await session.open("/eth")
    await session.run(line)
    assert shop.buses[bus].sent == [sent]


async def test_what_a_drive_prints_and_what_it_says_by_itself_are_told(session, shop):
    press = shop.put("press")
    await session.open("/press")
    press.answers["PR AL"] = ("A = 1", "D = 2")
    await session.run("@b PR AL")
    press.publish(Unsolicited(5.0, ("Hello", "there")))
    press.publish(Notice(5.0, "taken out of program mode", "b", warning=True))
    assert [(each.address, each.text) for each in told(session, Printed)] == [("b", "A = 1"), ("b", "D = 2")]
    unsolicited = [each for each in told(session, OnBus) if isinstance(each.event, Unsolicited)]
    assert unsolicited == [OnBus("press", Unsolicited(5.0, ("Hello", "there")))]
    assert told(session, Notified)[-1].warning
    assert [(each.line, each.bus, each.address) for each in told(session, Entered)] == [("@b PR AL", "press", "b")]


@pytest.mark.parametrize("failure", [Refused("b: 20", 20), NoAnswer("b"), TransportLost("gone")])
async def test_a_failure_is_told_once_and_raised(session, shop, failure):
    shop.put("press").answers["VX"] = failure
    await session.open("/press")
    with pytest.raises(type(failure)):
        await session.run("@b VX")
    assert [(each.text, each.address) for each in told(session, Failed)] == [(str(failure), "b")]


async def test_where_several_buses_are_open_a_failure_says_which_it_was(session, shop):
    shop.put("press"), shop.put("eth", "!").answers.update(VX=Refused("! refused"))
    await session.open("/press")
    await session.open("/eth")
    with pytest.raises(Refused) as caught:
        await session.run("@eth:! VX")
    assert report(caught.value) == "eth: ! refused"


async def test_a_failure_in_the_background_is_told_and_not_raised(session, shop):
    shop.put("press").answers["VX"] = Refused("no")
    await session.open("/press")
    await session.start("VX")
    assert [each.text for each in told(session, Failed)] == ["no"]


@pytest.mark.parametrize("line", ["/nothing", "@ ", "@b", "@b /wait stopped", "@nowhere:b PR P", "/use", "/use x"])
async def test_a_line_that_means_nothing_is_a_diagnostic_and_nothing_is_sent(session, shop, line):
    press = shop.put("press")
    await session.open("/press")
    with pytest.raises(Diagnostic):
        await session.run(line)
    assert press.sent == []
    assert len(told(session, Failed)) == 1


async def test_with_nothing_open_a_line_says_how_to_open(session):
    with pytest.raises(Diagnostic, match="/open"):
        await session.run("PR P")


async def test_a_drive_that_answers_where_none_was_known_is_known_from_then_on(session, shop):
    press = shop.put("press")
    press.answers["VX"] = NoAnswer("x")
    await session.open("/press")
    with pytest.raises(NoAnswer):
        await session.run("@x VX")
    assert "x" not in press.drives
    await session.run("@x PR P")
    assert "x" in press.drives


async def test_a_bus_that_cannot_be_identified_is_closed_again(session, shop):
    press = shop.put("press", NoAnswer("nobody"))
    with pytest.raises(NoAnswer):
        await session.open("/press")
    assert press.closed and session.buses == {} and session.selected_bus == ""


async def test_buses_of_the_same_name_are_told_apart(session, shop):
    shop.put("press"), shop.put("other")
    shop.buses["other"].name = "press"
    await session.open("/press")
    await session.open("/other")
    assert list(session.buses) == ["press", "press-2"]
    with pytest.raises(Diagnostic, match="already open"):
        await session.open("/other", "press")


async def test_closing_the_selected_bus_selects_another(session, shop):
    shop.put("press"), shop.put("eth", "!")
    await session.open("/press")
    await session.open("/eth")
    await session.run("/close press")
    assert session.selected_bus == "eth" and shop.buses["press"].closed
    await session.run("/close eth")
    assert session.selected is None


async def test_a_lost_bus_is_told_once(session, shop):
    press = shop.put("press")
    await session.open("/press")
    press.lost = TransportLost("unplugged")
    press.publish(Lost(1.0, press.lost))
    press.publish(Changed(1.0))
    assert [each.text for each in told(session, Failed)] == ["unplugged"]


# Stop


async def test_a_stop_reaches_every_bus_ends_what_runs_and_latches(session, shop):
    press, eth = shop.put("press"), shop.put("eth", "!")
    await session.open("/press")
    await session.open("/eth")
    waiting = [asyncio.create_task(session.run(line)) for line in ("/sleep 1000", "/wait stopped 1000")]
    press.standing = [False] * 1000
    await asyncio.sleep(0)
    session.stop("test")
    session.stop("test")
    assert (press.stops, eth.stops, session.latched) == (2, 2, True)
    for each in waiting:
        with pytest.raises(Stopped):
            await each
    assert not session.busy


async def test_a_stop_latches_against_automation_but_not_against_a_person(session, shop):
    press = shop.put("press")
    await session.open("/press")
    session.stop()
    for by in (By.MACRO, By.SCRIPT):
        with pytest.raises(Stopped, match="/resume"):
            await session.run("MR 100", by)
    with pytest.raises(Stopped):
        await session.run("/resume", By.SCRIPT)
    await session.run("PR P")
    await session.run("/resume")
    await session.run("MR 100", By.SCRIPT)
    assert [text for _, text in press.sent] == ["PR P", "MR 100"]


async def test_a_line_typed_before_a_stop_is_not_sent_after_it(session, shop):
    press = shop.put("press")
    await session.open("/press")
    typed = session.stops
    waiting = session.start("MR 5")
    session.stop()
    with pytest.raises(Stopped, match="'MR 51200' was typed"):
        await session.run("MR 51200", since=typed)
    await waiting
    assert press.sent == []
    await session.run("MR 7", since=session.stops)
    assert press.sent == [("a", "MR 7")]


async def test_a_stop_before_anything_is_open_does_no_harm(session):
    session.stop()
    assert session.latched


async def test_cancelling_a_wait_from_outside_is_no_stop(session, shop):
    shop.put("press")
    await session.open("/press")
    waiting = asyncio.create_task(session.run("/sleep 1000"))
    await asyncio.sleep(0)
    waiting.cancel()
    with pytest.raises(asyncio.CancelledError):
        await waiting
    assert not session.latched


# Waits


async def test_wait_stopped_wants_two_readings_of_every_drive_that_was_addressed(session, shop):
    press = shop.put("press")
    await session.open("/press")
    await session.run("@b MR 1")
    await session.run("@* SL 0")
    press.standing = [True, False, True, True, True, True, True, False]
    await session.run("/wait stopped 5")
    assert press.standing == []


async def test_a_wait_that_runs_out_is_a_failure_that_names_the_drive(session, shop):
    press = shop.put("press")
    await session.open("/press")
    await session.run("@b SL 100")
    press.standing = [False] * 1000
    with pytest.raises(DriveError, match=r"/wait stopped: b .* after 0 s"):
        await session.run("/wait stopped 0")


async def test_wait_idle_also_waits_for_the_program(session, shop):
    press = shop.put("press")
    await session.open("/press")
    press.programs = [True, True, False, False]
    await session.run("/wait idle 5")
    assert press.programs == []
    press.programs = [True]
    await session.run("/wait stopped 5")
    assert press.programs == [True]


async def test_a_drive_in_program_mode_is_not_asked(session, shop):
    press = shop.put("press")
    await session.open("/press")
    press.drives["a"].programming = True
    with pytest.raises(DriveError, match="program mode"):
        await session.run("/wait stopped")


@pytest.mark.parametrize("line", ["/wait", "/wait running", "/wait stopped soon", "/sleep", "/sleep -1", "/sleep 1e9"])
async def test_a_wait_that_is_not_understood_shows_its_usage(session, shop, line):
    shop.put("press")
    await session.open("/press")
    with pytest.raises(Diagnostic, match="usage: /"):
        await session.run(line)


# Macros


async def test_a_macro_keeps_lines_with_their_address_and_only_what_drives_see(session, shop):
    press = shop.put("press")
    await session.open("/press")
    for line in (
        "/record shuttle",
        "MR 100",
        "/use b",
        "MR 200",
        "/wait stopped",
        "@c PR P",
        "/drives",
        "/record stop",
    ):
        await session.run(line)
    assert [step.line for step in session.macros.load("shuttle").steps] == [
        "@a MR 100",
        "@b MR 200",
        "/wait stopped",
        "@c PR P",
    ]
    press.sent.clear()
    await session.run("/play shuttle")
    assert press.sent == [("a", "MR 100"), ("b", "MR 200"), ("c", "PR P")]


async def test_with_several_buses_a_macro_keeps_the_bus_too(session, shop):
    shop.put("press"), shop.put("eth", "!")
    await session.open("/press")
    await session.open("/eth")
    for line in ("/record m", "MR 1", "@eth:! MR 2", "/record stop"):
        await session.run(line)
    assert [step.line for step in session.macros.load("m").steps] == ["@press:a MR 1", "@eth:! MR 2"]


async def test_what_a_playing_macro_sends_is_not_recorded(session, shop):
    shop.put("press")
    await session.open("/press")
    for line in ("/record inner", "MR 1", "/record stop", "/record outer", "/play inner", "/record stop"):
        await session.run(line)
    assert [step.line for step in session.macros.load("outer").steps] == ["/play inner"]


async def test_recording_is_seen_and_ends_well(session, shop):
    shop.put("press")
    await session.open("/press")
    await session.run("/record m")
    assert session.recording == "m"
    with pytest.raises(Diagnostic):
        await session.run("/record other")
    with pytest.raises(Diagnostic, match="nothing was typed"):
        await session.run("/record stop")
    assert session.recording == ""


async def test_a_stop_ends_a_playing_macro_and_refuses_the_next(session, shop):
    press = shop.put("press")
    await session.open("/press")
    for line in ("/record m", "MR 1", "/sleep 0", "MR 2", "/record stop"):
        await session.run(line)
    press.sent.clear()
    press.answers["MR 1"] = asyncio.Event()
    playing = asyncio.create_task(session.run("/play m"))
    while not press.sent:
        await asyncio.sleep(0)
    assert [each.name for each in session.playing] == ["m"]
    session.stop()
    with pytest.raises(Stopped):
        await playing
    with pytest.raises(Stopped, match="/resume"):
        await session.run("/play m")
    assert press.sent == [("a", "MR 1")] and session.playing == []


async def test_a_macro_goes_on_with_the_drive_that_was_selected_as_it_began(session, shop):
    press, eth = shop.put("press"), shop.put("eth", "!")
    await session.open("/press")
    await session.open("/eth")
    lines = ("MR 1", "MR 2", "@b MR 3", "@eth: MR 4", "/use eth", "MR 5")
    session.macros.save(Macro("m", tuple(Step(0.0, line) for line in lines)))
    press.answers["MR 1"] = gate = asyncio.Event()
    playing = asyncio.create_task(session.run("/play m"))
    while not press.sent:
        await asyncio.sleep(0)
    session.select("", "eth")
    gate.set()
    await playing
    assert press.sent == [("a", "MR 1"), ("a", "MR 2"), ("b", "MR 3")]
    assert eth.sent == [("!", "MR 4"), ("!", "MR 5")]


async def test_a_failing_line_ends_the_macro_and_is_told_once(session, shop):
    press = shop.put("press")
    await session.open("/press")
    for line in ("/record m", "MR 1", "MR 2", "/record stop"):
        await session.run(line)
    press.answers["MR 1"] = Refused("a: no")
    press.sent.clear()
    with pytest.raises(Refused):
        await session.run("/play m")
    assert press.sent == [("a", "MR 1")]
    assert [each.text for each in told(session, Failed)] == ["a: no"]


async def test_a_macro_that_plays_itself_is_refused(session, shop):
    shop.put("press")
    await session.open("/press")
    session.macros.save(Macro("m", (Step(0.0, "/play n"),)))
    session.macros.save(Macro("n", (Step(0.0, "/play m"),)))
    with pytest.raises(Diagnostic, match=r"macro n, step 1 .*: m would call itself: m -> n -> m; use /repeat"):
        await session.run("/play m")
    assert session.playing == []


async def test_a_key_plays_one_macro(session, shop):
    shop.put("press")
    await session.open("/press")
    for name in ("m", "n"):
        for line in (f"/record {name}", "MR 1", "/record stop", f"/key f3 {name}"):
            await session.run(line)
    assert session.macros.by_key("F3").name == "n"
    assert session.macros.load("m").key == ""
    await session.run("/record n --replace")
    await session.run("MR 2")
    await session.run("/record stop")
    assert session.macros.load("n").key == "F3"
    await session.run("/key F3 off")
    assert session.macros.by_key("F3") is None


async def test_quit_is_for_the_front_end_to_see(session):
    await session.run("/quit")
    assert session.quitting and told(session, StateChanged)
