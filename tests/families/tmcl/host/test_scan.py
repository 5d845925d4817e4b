"""The search for modules over all addresses: what is asked, how long each reply is awaited, what is found and said."""

from __future__ import annotations

from multidrop.dialects import End, Kind, Reply
from multidrop.dialects.scanning import Reach, SearchOutcome
from multidrop.families.tmcl.host import scan
from multidrop.families.tmcl.host.codec import call_of
from multidrop.families.tmcl.manual.commands import AxisParameter, Command
from tests.support.procedure import ProcedureRunner

BINARY = 1241 << 16 | 0x10F
SLOW = 0.3
FIRST = 1.0


def frame(address, status, command, value):
    body = bytes((2, address, status, command)) + value.to_bytes(4, "big", signed=True)
    return body + bytes((sum(body) % 256,))


class Bus:
    """Modules that reply by themselves. `lost`: numbers of questions that reach none; `noise`: replies by address."""

    def __init__(self, *modules, lost=(), noise=None, late=None):
        self.modules, self.lost, self.noise, self.late = modules, lost, noise or {}, late or {}
        self.asked, self.count = [], 0

    def __call__(self, request):
        address, call = call_of(request.body)
        if request.kind is Kind.QUIET:
            self.asked.append((address, round(request.settle, 3)))
            assert request.timeout == request.settle
            self.count += 1
        if str(address) in self.noise:
            heard = self.noise[str(address)]
            return Reply(raw=heard.pop(0)) if heard else Reply(end=End.TIMEOUT)
        if self.count in self.lost or str(address) not in self.modules:
            return Reply(end=End.TIMEOUT)
        if call.command == Command.GAP and (call.type, call.motor) == (AxisParameter.ACTUAL_POSITION, 1):
            return Reply(("4",), End.REFUSED, body=frame(address, 4, 6, 0))
        value = BINARY if call.command == Command.VERSION else 0
        heard = frame(address, 100, call.command, value)
        return Reply((str(value),), acknowledged=True, body=heard, raw=heard)


def searched(bus, **reach):
    found, steps = [], []
    runner = ProcedureRunner(
        scan.SCAN.search(Reach(**{"everything": True, **reach}), found.append, lambda: steps.append(0))
    )
    while runner.request is not None:
        runner.answer(bus(runner.request))
    return runner.result, [(state.address, state.product, state.motors) for state in found], len(steps)


def block(first, last, window=0.05):
    return [(address, window) for address in range(first, last + 1)]


def whole(known, window=0.05):
    """All addresses, with the module that is known asked behind each block of 32."""
    made = [(1, FIRST)]
    for first in range(1, 256, 32):
        last = min(first + 31, 255)
        made += [(address, SLOW if address == 255 else window) for address in range(first, last + 1) if address > 1] + [
            (known, SLOW)
        ]
    return made


def test_each_address_is_asked_once_and_a_module_that_replied_behind_each_block():
    bus = Bus("1")
    assert searched(bus) == (SearchOutcome(), [("1", "TMCM-1241", 1)], 255)
    assert bus.asked == whole(1)


def test_the_window_of_a_slow_line_is_added_to_the_gap():
    bus = Bus("1")
    assert searched(bus, window=0.2) == (SearchOutcome(), [("1", "TMCM-1241", 1)], 255)
    assert bus.asked == whole(1, 0.23)


def test_the_module_that_replied_last_is_the_one_that_shows_the_count():
    bus = Bus("1", "40")
    _, found, _ = searched(bus)
    assert [address for address, _, _ in found] == ["1", "40"]
    assert [address for address, settle in bus.asked if settle == SLOW] == [1, *[40] * 6, 255, 40]


def test_a_block_without_a_module_is_asked_again_after_a_second_of_silence():
    bus = Bus("200")
    outcome, found, steps = searched(bus)
    assert (outcome, [address for address, _, _ in found], steps) == (SearchOutcome(), ["200"], 255)
    begin = [(1, FIRST), (1, FIRST), *block(2, 32), (1, FIRST), *block(1, 32), *block(33, 64), (1, FIRST)]
    assert bus.asked[: len(begin)] == begin
    assert bus.asked[-34:] == [*block(224, 224), (200, SLOW), *block(225, 254), (255, SLOW), (200, SLOW)]


def test_on_a_silent_line_every_block_is_asked_twice():
    bus = Bus()
    assert searched(bus) == (SearchOutcome(), [], 255)
    assert len(bus.asked) == 2 * 255 + 1 + 8
    assert bus.asked.count((255, SLOW)) == 2 and bus.asked.count((1, FIRST)) == 2 + 8


def test_a_lost_byte_has_the_block_asked_again():
    bus = Bus("1", "20", lost=range(10, 35))  # all from address 10 to the check of the first block
    outcome, found, _ = searched(bus)
    assert (outcome, [address for address, _, _ in found]) == (SearchOutcome(), ["1", "20"])
    assert bus.asked[31:35] == [(32, 0.05), (1, SLOW), (1, FIRST), (2, 0.05)]
    assert (20, SLOW) in bus.asked


def test_a_line_that_goes_on_losing_bytes_is_reported():
    bus = Bus("1", lost=range(10, 1000))
    outcome, found, _ = searched(bus)
    assert [address for address, _, _ in found] == ["1"]
    assert outcome.remarks[0] == "the line loses bytes: modules at 1 to 32 may have been missed"
    assert outcome.remarks[-1] == "the line loses bytes: modules at 225 to 255 may have been missed"
    assert len(outcome.remarks) == 8


def test_what_cannot_be_read_has_the_addresses_before_it_asked_once_more():
    bus = Bus("1", noise={"9": [b"\1\2\3"]})
    outcome, found, _ = searched(bus)
    assert outcome.remarks == (
        "what came at 9 is no module's reply: several may reply at once, or drives of another kind",
    )
    at = bus.asked.index((9, 0.05))
    assert bus.asked[at : at + 7] == [(9, 0.05), *block(5, 9, SLOW), (10, 0.05)]


def test_an_address_is_asked_with_the_longest_time_once():
    bus = Bus("1", noise={"9": [b"\1"], "10": [b"\1"], "11": [b"\1"]})
    outcome, _, _ = searched(bus)
    assert outcome.remarks[0].startswith("what came at 9, 10, 11 is no module's reply")
    at = bus.asked.index((9, 0.05))
    again = [(9, 0.05), *block(5, 9, SLOW), (10, 0.05), (10, SLOW), (11, 0.05), (11, SLOW), (12, 0.05)]
    assert bus.asked[at : at + len(again)] == again


def test_a_late_reply_belongs_to_the_module_whose_address_it_bears():
    bus = Bus("1", "9", noise={"11": [b"\1" + frame(9, 100, 136, BINARY)]}, lost=(9,))
    outcome, found, _ = searched(bus)
    assert (outcome, [address for address, _, _ in found]) == (SearchOutcome(), ["1", "9"])


def test_a_module_that_replies_to_another_address_is_named_once():
    other = frame(77, 100, 136, BINARY)
    bus = Bus("1", "77", noise={"9": [other], "10": [other]})
    outcome, found, _ = searched(bus)
    assert [address for address, _, _ in found] == ["1", "77"]
    assert outcome.remarks == ("module 77 replied to address 9: it replies to every address, or another host asks it",)


def test_a_module_whose_reply_came_and_that_then_is_silent_is_not_found():
    bus = Bus("1", noise={"9": [frame(9, 100, 136, BINARY)]})
    outcome, found, _ = searched(bus)
    assert [address for address, _, _ in found] == ["1"]
    assert outcome.remarks == (
        "what came at 9 is no module's reply: several may reply at once, or drives of another kind",
    )


def test_known_modules_are_not_identified_again():
    bus = Bus("1", "9")
    _, found, _ = searched(bus, known=("9",))
    assert [address for address, _, _ in found] == ["1"]
