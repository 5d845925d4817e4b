"""Procedures with simulated modules, in memory: identification, typed lines, and replies lost, late, damaged."""

import contextlib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic, Inexpressible, NoAnswer, Refused, Stopped
from multidrop.dialects.codec import Priority
from multidrop.dialects.controls import BY
from multidrop.dialects.family import Hints
from multidrop.dialects.state import Owed
from multidrop.drives.line import Line
from multidrop.families.tmcl.host.codec import Tmcl
from multidrop.families.tmcl.host.family import TmclFamily
from multidrop.families.tmcl.manual.commands import Command, Status, TmclCall
from multidrop.families.tmcl.simulator.module import ModuleRefusal
from multidrop.simulator.cell.spec import Faults
from tests.conftest import Bench
from tests.support.cases import for_each
from tests.support.faults import disturb

MODULE = {"personality": "TMCM"}


class Shop(Bench):
    """Modules on a line. `delays` hold back the next replies for so many seconds each; None loses one."""

    def __init__(self, *drives, baud=0, **faults):
        super().__init__([{**MODULE, **drive} for drive in drives or ({},)], baud, **faults)
        self.line = Line(Tmcl(), baud=baud)
        self.delays = []
        self.late = []
        self.advance = self.wire.advance
        self.wire.advance = self.tampered

    def tampered(self, now):
        data = self.advance(now)
        if data and self.delays:
            delay = self.delays.pop(0)
            if delay is not None:
                before = self.late[-1][0] if self.late else now  # a module replies in order
                self.late.append((max(now + delay, before), data))
            data = b""
        while self.late and self.late[0][0] <= now:
            data += self.late.pop(0)[1]
        return data

    def lose(self, at):
        """Lose one byte of the next request."""
        receive = self.wire.receive

        def once(data, now):
            self.wire.receive = receive
            receive(data[:at] + data[at + 1 :], now)

        self.wire.receive = once

    def step(self, until):
        due = [at for at, _ in self.late]
        return super().step(min([until, *due]))

    def open(self, *names):
        return self.run(TmclFamily.identify(Hints(drives=names)))

    def position(self, state):
        return int(self.type(state, "GAP 1, 0")[0])

    def count(self, command):
        return sum(data[1] == command for data in self.written)


@pytest.fixture
def shop():
    return Shop()


@pytest.fixture
def state(shop):
    """The only module of the line, identified."""
    (found,) = shop.open()
    return found


def test_identification_reads_version_and_motors_and_moves_nothing(shop, state):
    assert (state.address, state.product, state.version, state.motors) == ("1", "TMCM-1241", "1.15", 1)
    assert {data[1] for data in shop.written} <= {Command.VERSION, Command.PROGRAM_STATUS, Command.GAP}


def test_several_modules_are_found_and_one_that_is_absent_is_named():
    shop = Shop({}, {"name": "7"})
    found = shop.open("1", "7", "9")
    assert [state.product for state in found] == ["TMCM-1241", "TMCM-1241", ""]
    assert found[2].notes == ["module 9 does not reply"]


def test_nobody_answers():
    with pytest.raises(NoAnswer, match=r"no module replies at 3; drives=1,2,"):
        Shop().open("3")


@pytest.mark.parametrize("hints", [Hints(em=1), Hints(checksum=0), Hints(addressed=False)])
def test_hints_of_other_families_are_refused(hints):
    with pytest.raises(Inexpressible, match="for other families"):
        Shop().run(TmclFamily.identify(hints))


def test_the_first_request_may_complete_a_message_of_somebody_else(shop):
    shop.wire.receive(b"\x01\x01\x00", 0.0)
    (state,) = shop.open()
    assert state.product == "TMCM-1241"
    assert shop.position(state) == 0


@pytest.mark.parametrize(
    ("text", "printed"),
    [
        ("GGP 66, 0", ("1",)),
        ("RFS STATUS, 0", ("0",)),
        ("MST 0", ()),
        ("136 0, 0, 0", ("1241V115",)),
        ("sap 4, 0, 1000", ()),
    ],
)
def test_only_what_reads_prints(text, printed, shop, state):
    assert shop.type(state, text) == printed


def test_a_refusal_names_its_status_and_what_to_do(shop, state):
    with pytest.raises(Refused, match=r"module 1 refused 'GAP 250, 0': status 3, wrong type \(this module has no such"):
        shop.type(state, "GAP 250, 0")


@pytest.mark.parametrize("text", ["", "ROR 0", "MR 100", "ROR 0, 1\nROR 0, 2", "GAP 1, 0 ; x"])
def test_what_is_no_command_is_not_sent(text, shop, state):
    sent = len(shop.written)
    with pytest.raises(Inexpressible, match="nothing was sent"):
        shop.type(state, text)
    assert len(shop.written) == sent


def test_motion_is_position_and_velocity(shop, state):
    shop.type(state, "ROR 0, -5000")
    shop.wait(1.0)
    (axis,) = shop.run(TmclFamily(state).motion(Priority.POLL))
    assert axis.velocity == -5000 and axis.position < 0 and axis.axis == ""
    assert shop.run(TmclFamily(state).moving()) and not shop.run(TmclFamily(state).busy())


def test_a_search_counts_as_motion_between_its_phases():
    shop = Shop({"world": {"limit_minus": -1000.0}})
    (state,) = shop.open()
    shop.type(state, "RFS START, 0")
    seen = 0
    while shop.run(TmclFamily(state).moving()):
        shop.wait(0.01)
        seen += 1
    assert seen > 5 and shop.position(state) == 0 and shop.type(state, "GAP 11, 0") == ("0",)


def test_what_was_lost_is_not_sent_again_and_the_next_value_is_its_own(shop, state):
    shop.delays = [None]
    with pytest.raises(NoAnswer, match="it is not known whether 'ROR 0, 700' was executed; it was sent once"):
        shop.type(state, "ROR 0, 700")
    assert shop.count(Command.ROR) == 1
    shop.wait(2.0)
    assert shop.type(state, "GAP 2, 0") == ("700",)
    assert shop.count(Command.ROR) == 1


@pytest.mark.slow
@pytest.mark.parametrize("delay", [1.05, 1.2, 1.5, 2.0, 3.0])
@pytest.mark.parametrize("second", ["GAP 4, 0", "GGP 66, 0", "GAP 3, 0"])
def test_a_late_reply_is_never_the_next_ones(delay, second, shop, state):
    right, other = shop.type(state, second), shop.type(state, "GAP 6, 0")
    shop.delays = [delay]
    with contextlib.suppress(NoAnswer):
        assert shop.type(state, "GAP 6, 0") == other
    for _ in range(6):
        try:
            assert shop.type(state, second) == right
        except NoAnswer:
            shop.wait(0.3)
    shop.wait(12.0)
    assert shop.type(state, second) == right


@pytest.mark.slow
@pytest.mark.parametrize("text", ["GAP 4, 0", "GGP 76, 0", "RFS STATUS, 0", "136 1, 0, 0", "135 0, 0, 0"])
@pytest.mark.parametrize("delay", [None, 1.1])
def test_a_read_whose_reply_was_lost_is_asked_once_more_after_a_mark(delay, text, shop, state):
    right, sent = shop.type(state, text), len(shop.written)
    shop.delays = [delay]
    assert shop.type(state, text) == right
    first, mark, again = shop.written[sent:]
    assert first == again and mark[1] != first[1] and not state.reply_pending


def test_a_read_is_never_sent_a_third_time(shop, state):
    sent = len(shop.written)
    shop.delays = [None, 0.0, None]
    with pytest.raises(NoAnswer, match="module 1 does not reply: 'GAP 4, 0' only reads, and was sent twice"):
        shop.type(state, "GAP 4, 0")
    assert len(shop.written) - sent == 3


def test_a_module_that_replies_to_no_mark_is_not_asked_again(shop, state):
    sent = len(shop.written)
    shop.delays = [None, None]
    with pytest.raises(NoAnswer, match="'GAP 4, 0' was executed; it was sent once"):
        shop.type(state, "GAP 4, 0")
    assert [data[1] for data in shop.written[sent:]] == [Command.GAP, Command.GGP]


@pytest.mark.parametrize("text", ["GAP 207, 0", "GAP 207, 1", "SAP 4, 0, 5", "SIO 0, 2, 1"])
def test_what_changes_something_is_sent_once(text, shop, state):
    sent = len(shop.written)
    shop.delays = [None]
    with pytest.raises(NoAnswer, match="it was sent once"):
        shop.type(state, text)
    assert len(shop.written) - sent == 1


def test_a_parameter_that_reading_clears_is_neither_plotted_nor_watched(state):
    for refuses in (
        lambda state, word: TmclFamily(state).values.check(word),
        lambda state, word: TmclFamily(state).debugging.names([word]),
    ):
        for word in ("AP207", "AP207/1"):
            with pytest.raises(Diagnostic, match=f"{word} cannot be .*: reading it clears it"):
                refuses(state, word)
    assert TmclFamily(state).values.check("AP206") == "AP206"


def test_after_a_stop_a_late_reply_is_not_taken_for_a_value(shop, state):
    shop.delays = [0.5]
    asked = shop.count(Command.GAP) + 1

    def stop(_):
        if shop.count(Command.GAP) == asked and not shop.line.waiting:
            shop.line.stop(shop.now)

    with pytest.raises(Stopped):
        shop.run(TmclFamily(state).perform("GAP 5, 0"), at=stop)
    try:
        assert shop.type(state, "GAP 140, 0") == ("8",)
    except NoAnswer as error:
        assert "late reply" in str(error) or "does not reply" in str(error)
    shop.wait(12.0)
    assert shop.type(state, "GAP 140, 0") == ("8",)


def test_after_a_stop_in_a_mark_the_next_mark_has_another_command():
    state = TmclFamily.new_state(Tmcl(), "1")
    state.reply_outstanding()
    commands = []
    for _ in range(3):
        typed = TmclFamily(state).perform("GGP 66, 0")
        commands.append(next(typed).body[1])
        with pytest.raises(Stopped):
            typed.throw(Stopped("stopped"))
    assert len(set(commands)) == 3


def test_a_damaged_reply_is_no_value(shop):
    disturb(shop.wire, Faults(flip=0.02), 5)
    state = TmclFamily.new_state(Tmcl(), "1")
    values, failures = set(), 0
    for _ in range(200):
        try:
            values.add(shop.type(state, "GAP 5, 0"))
        except (NoAnswer, Refused):
            failures += 1
    assert failures and len(values) <= 2  # a flip in both a byte and the sum goes unseen in 1 of 2000


def test_a_new_address_is_told(shop, state):
    assert shop.run(TmclFamily(state).perform("SGP 66, 0, 5")) == ()
    assert state.remarks == ["module 1: its address is 5 from now on: type @5"]
    assert state.address == "5" and shop.type(state, "GGP 66, 0") == ("5",)
    state.take_messages()
    assert shop.run(TmclFamily(state).perform("137 0, 0, 1234")) == ()
    assert "factory settings" in state.remarks[0]


@pytest.mark.slow
@settings(max_examples=25)
@given(st.lists(st.sampled_from([None, 0.0, 0.02, 1.1, 2.5]), max_size=12), st.integers(0, 3))
def test_whatever_is_late_a_value_is_right_or_not_given(delays, start):
    shop = Shop()
    (state,) = shop.open()
    asked = [("GAP 4, 0", "51200"), ("GAP 140, 0", "8"), ("GGP 76, 0", "2"), ("GAP 6, 0", "128")]
    shop.delays = list(delays)
    for number in range(10):
        text, value = asked[(start + number) % 4]
        with contextlib.suppress(NoAnswer):
            assert shop.type(state, text) == (value,)


def test_the_whole_stop_stops_a_module_that_lost_a_byte_of_the_frame_before(shop, state):
    shop.type(state, "ROR 0, 1000")
    shop.wait(1.0)
    shop.wire.receive(bytes.fromhex("01 01 00 00 00 03 E8 ED"), shop.now)  # a byte of nine is lost
    codec = state.codec
    first = codec.stop(["1"])
    shop.wire.receive(first, shop.now)
    shop.line.note_written(first, shop.now)
    shop.line.stop(shop.now, *codec.stop_again(["1"]))
    shop.wait(3.0)
    assert shop.type(state, "GAP 3, 0") == ("0",)


@pytest.mark.parametrize("at", range(9))
def test_a_byte_lost_of_one_request_is_not_filled_up_by_the_next(at, shop):
    """Also where the user's timeout is shorter than the pause after which a module drops an unfinished message."""
    shop.line.timeout = 0.1
    (state,) = shop.open()
    shop.lose(at)
    with pytest.raises(NoAnswer, match="it was sent once"):
        shop.type(state, "ROR 0, 1000")
    assert shop.type(state, "GAP 2, 0") == ("0",)
    assert not any("status 1" in text for text in shop.strays)


def test_an_address_that_cannot_be_is_refused_before_the_first_module_is_asked(shop):
    with pytest.raises(Inexpressible, match="no module address '999'; valid: 1 to 255"):
        shop.open("1", "999")
    assert not shop.written


def test_a_late_reply_of_another_module_costs_nothing():
    shop = Shop({}, {"name": "7"})
    one, seven = shop.open("1", "7")
    shop.delays = [None]
    with pytest.raises(NoAnswer):
        shop.type(seven, "GAP 207, 0")
    late = [bytes.fromhex("02 07 64 06 00 00 C8 00 3B")]

    def before_the_mark(_):
        if shop.count(Command.GGP) and late:
            shop.line.receive(late.pop(), shop.now)

    assert shop.run(TmclFamily(one).perform("GAP 5, 0"), at=before_the_mark) == ("51200",)
    assert shop.strays == []


def test_a_module_that_comes_back_has_its_motors_counted():
    shop = Shop({}, {"name": "7"})
    shop.devices["7"].power(False, 0.0)
    _, seven = shop.open("1", "7")
    assert seven.motors == 0
    shop.devices["7"].power(True, shop.now)
    assert len(shop.run(TmclFamily(seven).motion(Priority.POLL))) == 1
    assert seven.motors == 1


def test_every_module_of_a_line_is_stopped_with_the_others():
    shop = Shop({}, {"name": "7"})
    one, seven = shop.open("1", "7")
    assert one.codec == seven.codec
    one.settings_may_have_changed()
    assert not one.settings_unknown


def test_a_module_found_in_download_mode_is_taken_out_of_it_and_that_is_said(shop):
    program = shop.devices["1"].program
    program.download(0)
    (state,) = shop.open()
    assert (program.storing, state.programming, state.product, state.motors) == (False, False, "TMCM-1241", 1)
    assert any("found in download mode" in note and "133" in note for note in state.notes)


def test_the_last_session_s_download_is_ended_before_anything_is_stored(shop):
    program = shop.devices["1"].program
    (state,) = shop.open()
    shop.type(state, "132 0, 0, 0")
    shop.type(state, "MST 0")
    assert state.restore is not None and state.programming and len(program.memory) == 1
    (again,) = shop.run(TmclFamily.identify(Hints(drives=("1",), owed=(state.restore,))))
    assert (program.storing, len(program.memory), again.programming, again.restore) == (False, 1, False, None)


def test_a_module_that_is_owed_nothing_is_sent_no_end_of_a_download(shop):
    (state,) = shop.open()
    before = len(shop.written)
    shop.run(TmclFamily.identify(Hints(drives=("1",), owed=(Owed(0, "7", state.product, state.version, ""),))))
    assert not [data for data in shop.written[before:] if data[1] == Command.END_DOWNLOAD]


def test_a_line_of_a_download_that_was_executed_is_said(shop, state):
    shop.type(state, "132 0, 0, 0")
    shop.devices["1"].program.storing = False  # by another host
    with pytest.raises(Refused, match="was executed and not stored"):
        shop.type(state, "MVP ABS, 0, 5")
    assert not state.programming and state.restore is None


@pytest.mark.parametrize(("without", "runs"), [((), True), ((135,), True), ((135, 10), False)])
def test_whether_a_program_runs_is_read_by_135_or_global_parameter_128(without, runs, monkeypatch, shop, state):
    for line in ("132 0, 0, 0", "27 0, 0, 1000", "133 0, 0, 0", "129 1, 0, 0"):
        shop.type(state, line)
    device = shop.devices["1"]
    execute = device._execute

    def lacking(call, now):
        if call.command in without:
            raise ModuleRefusal(Status.INVALID_COMMAND)
        return execute(call, now)

    monkeypatch.setattr(device, "_execute", lacking)
    assert shop.run(TmclFamily(state).busy()) is runs


def damaged(data, place, how):
    """The bytes with one lost, doubled or flipped."""
    at = place % len(data)
    middle = {"lost": b"", "doubled": data[at : at + 1] * 2, "flipped": bytes([data[at] ^ 1 << place % 8])}[how]
    return data[:at] + middle + data[at + 1 :]


@pytest.mark.slow
@for_each("place", range(9))
@pytest.mark.parametrize("how", ["lost", "doubled", "flipped"])
@pytest.mark.parametrize(("way", "frame"), [("out", 0), ("out", 1), ("back", 0), ("back", 1)])
def test_a_harmed_frame_turns_no_module_otherwise_than_typed_and_gives_no_wrong_value(way, frame, how, place):
    shop = Shop({"set": {"4": 1111}}, {"name": "7", "set": {"4": 4444}})
    modules = shop.open("1", "7")
    receive, advance, passed = shop.wire.receive, shop.wire.advance, {"out": 0, "back": 0}

    def hurt(data, direction):
        passed[direction] += bool(data)
        chosen = data and (direction, passed[direction] - 1) == (way, frame)
        return damaged(data, place, how) if chosen else data

    shop.wire.receive = lambda data, now: receive(hurt(data, "out"), now)
    shop.wire.advance = lambda now: hurt(advance(now), "back")
    for state, value in zip(modules, ("1111", "4444"), strict=True):
        with contextlib.suppress(NoAnswer, Refused):
            shop.type(state, "ROR 0, 700")
        with contextlib.suppress(NoAnswer, Refused):
            assert shop.type(state, "GAP 4, 0") == (value,)
    assert shop.count(Command.ROR) <= 2
    for device in shop.devices.values():
        assert device.execute(TmclCall(Command.GAP, 2), shop.now).value in (0, 700)


@pytest.mark.parametrize(("option", "counted"), [(0, "counts from the last target"), (1, "counts from here")])
def test_the_host_says_from_where_a_relative_move_counts(option, counted):
    shop = Shop({"set": {"127": option}})
    (state,) = shop.open()
    assert TmclFamily(state).values.controls("")[BY].about == counted
    shop.type(state, f"SAP 127, 0, {1 - option}")
    assert TmclFamily(state).values.controls("")[BY].about != counted
    shop.delays = [None]
    with pytest.raises(NoAnswer):
        shop.type(state, "SAP 127, 0, 0")
    assert "not known" in TmclFamily(state).values.controls("")[BY].about


def test_a_module_without_parameter_127_counts_from_a_place_that_is_not_known():
    (state,) = Shop({"personality": "TMCM-1140"}).open()
    assert state.motors == 1
    assert "not known" in TmclFamily(state).values.controls("")[BY].about


def interrupted(shop, state, procedure, delay):
    """Run a procedure into a stop that comes after its first request; the reply to that comes `delay` seconds late."""
    sent = len(shop.written)
    shop.delays = [delay]

    def stop(_):
        if len(shop.written) > sent and not shop.line.waiting:
            shop.line.stop(shop.now)

    with pytest.raises(Stopped):
        shop.run(procedure, at=stop)
    state.stopped()


@for_each("stops", range(1, 9))
def test_a_resting_module_is_known_after_stops_that_wore_out_every_mark(stops):
    shop = Shop()
    (state,) = shop.open()
    for _ in range(stops):
        interrupted(shop, state, TmclFamily(state).moving(), 0.05)
    assert shop.run(TmclFamily(state).moving()) is False


@pytest.mark.slow
@settings(max_examples=25)
@given(st.lists(st.sampled_from([0.02, 0.3, 1.1, 2.5]), min_size=3, max_size=9), st.integers(0, 3))
def test_after_any_stops_a_value_is_right_or_not_given(delays, start):
    shop = Shop()
    (state,) = shop.open()
    asked = [("GGP 66, 0", "1"), ("GAP 4, 0", "51200"), ("GGP 76, 0", "2"), ("GAP 140, 0", "8")]
    for delay in delays:
        interrupted(shop, state, TmclFamily(state).perform(asked[start][0]), delay)
    for number in range(8):
        text, value = asked[(start + number) % 4]
        with contextlib.suppress(NoAnswer):
            assert shop.type(state, text) == (value,)


@pytest.mark.parametrize("lost", [True, False])
@pytest.mark.parametrize("remedy", ["GAP 193, 0", "SAP 193, 0, 1"])
def test_no_search_begins_after_a_mode_that_was_not_set(remedy, lost, shop, state):
    shop.delays = [None] if lost else []
    with pytest.raises(NoAnswer if lost else Refused):
        shop.type(state, "SAP 193, 0, 2" if lost else "SAP 193, 0, 9")
    with pytest.raises(Refused, match=r"SAP 193 for motor 0 was refused or got no reply: 'RFS START, 0' would search"):
        shop.type(state, "RFS START, 0")
    assert not any(data[1:3] == bytes([Command.RFS, 0]) for data in shop.written)
    shop.wait(2.0)
    shop.type(state, remedy)
    shop.type(state, "RFS START, 0")
    assert any(data[1:3] == bytes([Command.RFS, 0]) for data in shop.written)
