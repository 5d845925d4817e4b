"""Conversations with a controller: typed commands, motion of both axes, status in words; identification and search."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from multidrop.base.errors import Inexpressible, NoAnswer, Refused
from multidrop.dialects.certifying import Certifying
from multidrop.dialects.codec import End, Kind, Priority, Procedure, Reply, Request
from multidrop.dialects.exchange import Exchange
from multidrop.dialects.family import Hints, Motion, Referencing
from multidrop.dialects.scanning import WINDOW, Found, Outcome, Reach, Scan, Step
from multidrop.dialects.state import who
from multidrop.families.pmx.host.codec import FACTORY, Pmx, PmxState
from multidrop.families.pmx.manual import table
from multidrop.families.pmx.manual.help import suggestion, syntax

# One request to a controller, and proof of its outcome.
#
# A controller replies to each command with one line: `OK`, a value, or `?` and a reason. A reply carries neither the
# controller's number nor its command, except that `?` precedes an unknown word. So the sync mark is an unknown word
# with the controller's number and a number of its own. (PMX-2ED-SA manual 6.2.3, 9; facts of real units.)


MARK = "Q"
"""The first letter of a sync mark; no command begins with it."""
INTEGER = r"-?\d{1,19}"


def _mark(state: PmxState, request: Request, sent: bool) -> Procedure[tuple[str, ...] | None]:
    """Send an unknown word with a fresh number, which precedes every reply to it."""
    text = f"{MARK}{state.address}{state.next_sync_mark() % 1000:03}"
    asked = replace(state.codec.request(state.address, text), kind=Kind.PRINT)
    reply = yield replace(asked, expect=re.escape(f"?{text}"), gather=True, priority=request.priority)
    if reply.end is not End.DONE:
        state.reply_outstanding()
        return None
    state.synchronised()
    return reply.lines[:-1]


def number(
    state: PmxState, text: str, priority: Priority = Priority.OPERATOR, doubts: list[Request] | None = None
) -> Procedure[int]:
    """Read a whole number for the host's own use. Raises Refused or NoAnswer."""
    asked = replace(state.codec.request(state.address, text), expect=INTEGER, priority=priority)
    reply = yield from answered(state, asked, doubts)
    return int(reply.text)


def refusal(state: PmxState, request: Request, reply: Reply) -> Refused | NoAnswer:
    """Describe a refusal: the reply where it says more than the command, its meaning, the remedy."""
    received, text = reply.text, request.text
    head = f"{who(state)} refused '{text}'"
    if (found := table.meaning(received)) is not None:
        return Refused(f"{head}: {received}: {found[0]} ({_valid(text, received) or found[1]})")
    if received != f"?{text}" and not text.startswith(received[1:]):
        return NoAnswer(
            f"{who(state)}: {received!r} came for '{text}': the line was disturbed, or another program uses it; it is "
            f"not known whether '{text}' was executed; it was sent once"
        )
    advice = _advice(text)
    row = table.lookup(text)
    moves = row is not None and text == text.upper() and {"place", "sign", "both"} & set(row.shapes)
    if moves:
        advice = "an axis with a limit error takes no move: /status shows it, CLRX and CLRY clear it"
        if beyond := [each for each in re.findall(r"-?\d+", text) if not -INT32 <= int(each) < INT32]:
            advice = f"{beyond[0]} is beyond the range, {-INT32} to {INT32 - 1}"
    what = "it does not take that now" if moves else "it does not know that command"
    return Refused(f"{head}: {received}: {what}" + (f" ({advice})" if advice else ""))


INT32 = 2**31
_SPOKEN_OF_VALUE = ("?Invalid Answer", "?Low speed out of range")


def _valid(text: str, received: str) -> str:
    """The values that a command takes, or the numbers that its name has; empty where the refusal is of neither."""
    name, sets, _ = text.strip().partition("=")
    row = table.lookup(name) or table.COMMANDS.get(table.head(name))
    if row is None:
        return ""
    if received == "?Index out of Range":
        return f"valid: {syntax(row).partition(';')[0]}"
    return f"{name.strip()} takes {row.takes}" if sets and row.takes and received in _SPOKEN_OF_VALUE else ""


def _advice(text: str) -> str:
    if text != text.upper() and table.lookup(text.upper()) is not None:
        return f"it reads capitals only: {text.upper()}"
    if " " in text and table.lookup(text.replace(" ", "")) is not None:
        return f"no spaces: {text.replace(' ', '')}"
    row = table.lookup(text)
    if row is not None and "=" in text and "W" not in row.access:
        return f"{row.name} cannot be set"
    return suggestion(text) if row is None else ""


class PmxExchange(Exchange):
    """The exchange with a PMX."""

    state: PmxState

    def mark(self, request: Request, after: bool) -> Procedure[tuple[str, ...] | None]:
        return _mark(self.state, request, after)

    def lost(self, request: Request) -> None:
        self.state.reply_outstanding()

    def refusal(self, request: Request, reply: Reply) -> Refused | NoAnswer:
        return refusal(self.state, request, reply)


def answered(state: PmxState, request: Request, doubts: list[Request] | None = None) -> Procedure[Reply]:
    """See `Exchange.answered`."""
    return PmxExchange(state).answered(request, doubts)


def beyond_doubt(state: PmxState, request: Request) -> Procedure[None]:
    """See `Exchange.beyond_doubt`."""
    return PmxExchange(state).beyond_doubt(request)


OK = "OK"
LATER = ("DN", "DB")
"""Words that take effect after STORE and a power cycle (6.2.2, 6.3)."""
HOMING = re.compile(r"(?:H|L|ZH|Z|HL)([XY])[+-]", re.ASCII)
SETS = re.compile(r"P([XY])=", re.ASCII)
PROGRAMS = (0, 1)
POINTS = (("DI", "inputs on"), ("DO", "outputs on"), ("EO", "motor drivers on"))


def perform(known: PmxState, text: str) -> Procedure[tuple[str, ...]]:
    """Send a command as typed; return the printed lines. Raises Refused, NoAnswer, Stopped or Inexpressible."""
    check(known, text)
    reply = yield from answered(known, known.codec.request(known.address, text))
    name, sets, _ = text.strip().partition("=")
    if sets and name in LATER:
        known.remark(f"{who(known)}: {name} acts after STORE and a power cycle")
    return () if reply.text == OK else reply.lines


def check(known: PmxState, text: str) -> None:
    """Raise Inexpressible for a command with a number in groups of digits, or with a comment."""
    wrong = table.grouped(text)
    if not wrong and ";" in text:
        wrong = "; begins a comment, which only program files have; leave it out"
    if wrong:
        raise Inexpressible(f"'{text}': {wrong}; nothing was sent")


def motion(known: PmxState, priority: Priority) -> Procedure[tuple[Motion, ...]]:
    """Read position, speed and status of each axis; a poll skips the speed of an axis that rests."""
    doubts: list[Request] = []
    found = []
    for axis in table.AXES:
        position = yield from number(known, f"P{axis}", priority, doubts)
        state = yield from number(known, f"MST{axis}", priority, doubts)
        speed = 0
        if state & table.MOVING or priority is not Priority.POLL:
            speed = yield from number(known, f"PS{axis}", priority, doubts)
        found.append(Motion(position, speed, axis.lower(), table.trouble_words(state)))
    if doubts:
        yield from beyond_doubt(known, doubts[0])
    return tuple(found)


def referencing(known: PmxState, text: str) -> Referencing | None:
    """Find out whether a command homes an axis or sets its position. (7.10.)"""
    if found := HOMING.fullmatch(text.strip()):
        return Referencing(found[1].lower(), homing=True)
    found = SETS.match(text.strip())
    return Referencing(found[1].lower(), homing=False) if found else None


def homed(known: PmxState) -> Procedure[bool]:
    return not any(axis.trouble for axis in (yield from motion(known, Priority.OPERATOR)))


def moving(known: PmxState) -> Procedure[bool]:
    for axis in table.AXES:
        if (yield from number(known, f"MST{axis}")) & table.MOVING:
            return True
    return False


def busy(known: PmxState) -> Procedure[bool]:
    for program in PROGRAMS:
        if (yield from number(known, f"SASTAT{program}")) == 1:
            return True
    return False


def status(known: PmxState) -> Procedure[tuple[str, ...]]:
    lines = []
    for axis in table.AXES:
        state = yield from number(known, f"MST{axis}")
        loop = yield from number(known, f"SLS{axis}")
        lines.append(f"{axis}: {', '.join(table.status_words(state))}; StepNLoop {table.loop_words(loop)}")
    for program in PROGRAMS:
        lines.append(f"program {program}: {table.program_words((yield from number(known, f'SASTAT{program}')))}")
    for word, what in POINTS:
        bits = yield from number(known, word)
        on = ", ".join(str(n + 1) for n in range(bits.bit_length()) if bits >> n & 1)
        lines.append(f"{what}: {on or 'none'}")
    return tuple(lines)


def troubles(known: PmxState) -> Procedure[None]:
    """Note the errors that are set, with their remedies. Clears none."""
    for axis in table.AXES:
        try:
            state = yield from number(known, f"MST{axis}")
            loop = yield from number(known, f"SLS{axis}")
        except Refused:
            continue
        if state & table.LIMIT_ERROR:
            known.note(f"{who(known)}: {axis} has a {table.trouble_words(state)}; CLR{axis} clears it")
        if loop in table.LOOP_ERRORS:
            known.note(f"{who(known)}: StepNLoop of {axis} is in {table.loop_words(loop)}; CLR{axis} clears it")


# The controllers on a line: identification, and the search at one baud rate. Both only ask.
#
# The search asks every device number, then none, for `ID`. The first number is tried twice: the first question may
# follow the rest of another line. (PMX-2ED-SA manual 6.2.3, 6.3.)


PRODUCT = re.compile(r"(?i)performax-(\S+)")
NAME = re.compile(r"\d[A-Za-z]+(\d\d)")
SEARCH = "multidrop scan PORT --dialect pmx tries every number and baud rate"
TRIES = 2
"""The first question may follow the rest of another line."""


def identify(hints: Hints) -> Procedure[list[PmxState]]:
    """Find the controllers on a line, in the order of `hints.drives`. Raises NoAnswer where none replies.

    Without numbers, try the factory's number, then none, as on a gateway.
    """
    if hints.checksum is not None or hints.em is not None:
        raise Inexpressible("checksum= and em= are for MCode; this controller has neither")
    if not hints.addressed:
        alone = yield from find(PmxState(Pmx(addressed=False)))
        if alone is None:
            raise NoAnswer("no controller replies without an address")
        return [alone]
    if wrong := [name for name in hints.drives if not re.fullmatch(r"\d\d", name, re.ASCII)]:
        raise Inexpressible(f"no device number '{wrong[0]}'; valid: 00 to 99, as in drives=00,01")
    named = tuple(name for name in hints.tried if re.fullmatch(r"\d\d", name, re.ASCII))
    found = []
    for name in hints.drives or named or (FACTORY,):
        state = PmxState(Pmx(), name)
        if (yield from find(state)) is None:
            state.note(f"{who(state)} does not reply")
        found.append(state)
    if any(state.product for state in found):
        return found
    if not hints.drives:
        alone = yield from find(PmxState(Pmx(addressed=False)))
        if alone is not None:
            return [alone]
    tried = ", ".join(state.address for state in found)
    raise NoAnswer(f"no controller replies at {tried}; drives=00,01,... names others; {SEARCH}")


def find(state: PmxState) -> Procedure[PmxState | None]:
    """Identify one controller; None where it is silent."""
    text = ""
    for tried in range(TRIES):
        # A gateway's greeting came in its place: the controller's reply is late.
        late = tried and not text.startswith("?")
        if late and (yield from _mark(state, state.codec.request(state.address, "ID"), False)) is None:
            return None
        text = yield from _ask(state, "ID")
        if not text or PRODUCT.search(text):
            break
    if not text:
        return None
    product = PRODUCT.search(text)
    if product is None:
        if text.startswith("?"):
            return None  # it does not understand the command, perhaps because of the number before it
        state.note(f"{who(state)} says that it is {text!r}: its commands may mean other things")
    state.identified(f"PMX-{product[1]}" if product else text, (yield from _ask(state, "VER", r"(?i)v.+")))
    state.named((yield from _ask(state, "DN", NAME.pattern)))
    number = NAME.fullmatch(state.name)
    if state.address and number and number[1] != state.address:
        state.note(f"{who(state)}: its DN is {state.name}, so it will answer at {number[1]} after a power cycle")
    try:
        yield from troubles(state)
    except NoAnswer:
        state.reply_outstanding()
    return state


def _ask(state: PmxState, text: str, expect: str | None = None) -> Procedure[str]:
    """Return its reply, also a refusal; empty without a reply."""
    reply = yield replace(state.codec.request(state.address, text), expect=expect)
    return reply.text if reply.end in (End.DONE, End.REFUSED) else ""


NUMBERS = tuple(f"{number:02}" for number in range(100))
NOTHING = "~~~"
"""A word that no controller knows."""
NO_REPLY = b"\r\n\0"
LATE = 4
"""Numbers before the present one whose reply may come now."""
CERTAIN = 5
"""Windows in which a late reply comes."""
SHOWN = 3
"""Replies that could not be read, until the rest is only counted."""
BUSY = 2.5
"""The longest wait, in windows, where something else arrives."""


def search(reach: Reach, found: Found, step: Step) -> Procedure[Outcome]:
    """Search for every controller at one baud rate; report each as soon as it is identified."""
    remarks: list[str] = []
    seen = set(reach.known)
    states = [PmxState(Pmx(addressed=bool(number)), number) for number in _numbers(reach)]
    for at, state in enumerate(states):
        if state.address not in seen and not (seen and not state.address):
            heard = yield from _replies(state, reach.window)
            if heard.strip(NO_REPLY) and not (yield from _identified(states[max(0, at - LATE) : at + 1], seen, found)):
                remarks.append(f"{heard[:40]!r} was received at {state.address or 'no number'}: no controller's reply")
        step()
    yield from _identified([state for state in states if state.address == NUMBERS[-1]], seen, found)
    more = [f"at {len(remarks) - SHOWN} more numbers something was received"] if len(remarks) > SHOWN else []
    return Outcome((*remarks[:SHOWN], *more))


def _numbers(reach: Reach) -> tuple[str, ...]:
    """The device numbers to try; the empty one is for a unit that takes none."""
    return ("",) if reach.alone else (*NUMBERS, FACTORY, "")


def _identified(states: Sequence[PmxState], seen: set[str], found: Found) -> Procedure[bool]:
    """Identify the controllers whose replies came: the last of these, or those before it. A reply bears no number."""
    before = len(seen)
    for state in reversed(states):
        if state.address in seen or not (yield from _replies(state, CERTAIN * WINDOW)):
            continue
        if (yield from find(state)) is not None:
            seen.add(state.address)
            found(state)
    return len(seen) > before


def _replies(state: PmxState, quiet: float) -> Procedure[bytes]:
    """Ask for the identification; return what was received until it was quiet."""
    asked = state.codec.request(state.address, "ID")
    reply = yield replace(asked, kind=Kind.QUIET, settle=quiet, timeout=BUSY * quiet)
    return reply.raw


def _clear() -> Procedure[None]:
    """End a half-sent command, whose number no controller has."""
    asked = Pmx(addressed=False).request("", NOTHING)
    yield replace(asked, kind=Kind.QUIET, settle=WINDOW, timeout=BUSY * WINDOW)


CLEARS = "ends half a command in a controller with a word that no controller knows. It moves and erases nothing"


class PmxScan(Scan):
    """The search for PMX controllers."""

    title = "PMX"
    bauds = (9600, 19200, 38400, 57600, 115200)
    clears = CLEARS

    def places(self, reach: Reach) -> int:
        return len(_numbers(reach))

    def search(self, reach: Reach, found: Found, step: Step) -> Procedure[Outcome]:
        return search(reach, found, step)

    def clear(self) -> Procedure[None]:
        return _clear()

    def asked(self, reach: Reach) -> str:
        return "numbers 00 to 99"


SCAN = PmxScan()


class PmxCertifying(Certifying):
    """The questions of a certificate to a PMX."""

    state: PmxState

    module = __file__
    reads = "{}"
    writes = "{}={}"
    refused = "{text}"


"""A refused command runs nothing in a controller (7.19.4: only a running program has a subroutine for errors)."""
