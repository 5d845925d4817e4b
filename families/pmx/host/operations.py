"""Conversations with a controller: typed commands, motion of both axes, status in words; identification."""

from __future__ import annotations

import re
from dataclasses import replace

from multidrop.base.errors import Inexpressible, NoAnswer, Refused
from multidrop.dialects.certifying import Certifying
from multidrop.dialects.codec import End, Kind, Priority, Procedure, Reply, Request
from multidrop.dialects.exchange import Exchange
from multidrop.dialects.family import Motion, Referencing
from multidrop.dialects.state import OfDrive, who
from multidrop.families.pmx.host.codec import PmxState
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


def number(
    state: PmxState, text: str, priority: Priority = Priority.OPERATOR, doubts: list[Request] | None = None
) -> Procedure[int]:
    """Read a whole number for the host's own use. Raises Refused or NoAnswer."""
    asked = replace(state.codec.request(state.address, text), expect=INTEGER, priority=priority)
    reply = yield from PmxExchange(state).answered(asked, doubts)
    return int(reply.text)


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
        """Send an unknown word with a fresh number, which precedes every reply to it."""
        state = self.state
        text = f"{MARK}{state.address}{state.next_sync_mark() % 1000:03}"
        asked = replace(state.codec.request(state.address, text), kind=Kind.PRINT)
        reply = yield replace(asked, expect=re.escape(f"?{text}"), gather=True, priority=request.priority)
        if reply.end is not End.DONE:
            state.reply_outstanding()
            return None
        state.synchronised()
        return reply.lines[:-1]

    def lost(self, request: Request) -> None:
        self.state.reply_outstanding()

    def refusal(self, request: Request, reply: Reply) -> Refused | NoAnswer:
        """Describe a refusal: the reply where it says more than the command, its meaning, the remedy."""
        received, text = reply.text, request.text
        head = f"{self._who} refused '{text}'"
        if (meaning := table.meaning(received)) is not None:
            return Refused(f"{head}: {received}: {meaning[0]} ({_valid(text, received) or meaning[1]})")
        if received != f"?{text}" and not text.startswith(received[1:]):
            return NoAnswer(
                f"{self._who}: {received!r} came for '{text}': the line was disturbed, or another program uses it; "
                f"it is not known whether '{text}' was executed; it was sent once"
            )
        advice = _advice(text)
        row = table.lookup(text)
        moves = row is not None and text == text.upper() and {"place", "sign", "both"} & set(row.shapes)
        if moves:
            advice = "an axis with a limit error takes no move: /status shows it, CLRX and CLRY clear it"
            if beyond := [number for number in re.findall(r"-?\d+", text) if not -INT32 <= int(number) < INT32]:
                advice = f"{beyond[0]} is beyond the range, {-INT32} to {INT32 - 1}"
        what = "it does not take that now" if moves else "it does not know that command"
        return Refused(f"{head}: {received}: {what}" + (f" ({advice})" if advice else ""))


OK = "OK"
"""Words that take effect after STORE and a power cycle (6.2.2, 6.3)."""
HOMING = re.compile(rf"(?:{'|'.join(table.HOMINGS)})([XY])[+-]", re.ASCII)
SETS = re.compile(r"P([XY])=", re.ASCII)
PROGRAMS = (0, 1)
POINTS = (("DI", "inputs on"), ("DO", "outputs on"), ("EO", "motor drivers on"))


class PmxOperations(OfDrive):
    """What a PMX is asked to do, and what it says of its motion."""

    state: PmxState

    def perform(self, text: str) -> Procedure[tuple[str, ...]]:
        """Send a command as typed; return the printed lines. Raises Refused, NoAnswer, Stopped or Inexpressible."""
        known = self.state
        self.check(text)
        reply = yield from PmxExchange(known).answered(known.codec.request(known.address, text))
        name, sets, _ = text.strip().partition("=")
        if sets and name in table.WIRE:
            known.remark(f"{who(known)}: {name} acts after STORE and a power cycle")
        return () if reply.text == OK else reply.lines

    def check(self, text: str) -> None:
        """Raise Inexpressible for a command with a number in groups of digits, or with a comment."""
        wrong = table.grouped(text)
        if not wrong and ";" in text:
            wrong = "; begins a comment, which only program files have; leave it out"
        if wrong:
            raise Inexpressible(f"'{text}': {wrong}; nothing was sent")

    def motion(self, priority: Priority) -> Procedure[tuple[Motion, ...]]:
        """Read position, speed and status of each axis; a poll skips the speed of an axis that rests."""
        known = self.state
        doubts: list[Request] = []
        motions = []
        for axis in table.AXES:
            position = yield from number(known, f"P{axis}", priority, doubts)
            state = yield from number(known, f"MST{axis}", priority, doubts)
            speed = 0
            if state & table.MOVING or priority is not Priority.POLL:
                speed = yield from number(known, f"PS{axis}", priority, doubts)
            motions.append(Motion(position, speed, axis.lower(), table.trouble_words(state)))
        if doubts:
            yield from PmxExchange(known).beyond_doubt(doubts[0])
        return tuple(motions)

    def moving(self) -> Procedure[bool]:
        for axis in table.AXES:
            if (yield from number(self.state, f"MST{axis}")) & table.MOVING:
                return True
        return False

    def busy(self) -> Procedure[bool]:
        for program in PROGRAMS:
            if (yield from number(self.state, f"SASTAT{program}")) == 1:
                return True
        return False

    def referencing(self, text: str) -> Referencing | None:
        """Find out whether a command homes an axis or sets its position. (7.10.)"""
        if match := HOMING.fullmatch(text.strip()):
            return Referencing(match[1].lower(), homing=True)
        match = SETS.match(text.strip())
        return Referencing(match[1].lower(), homing=False) if match else None

    def homed(self) -> Procedure[bool]:
        return not any(axis.trouble for axis in (yield from self.motion(Priority.OPERATOR)))

    def status(self) -> Procedure[tuple[str, ...]]:
        known = self.state
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


# Identification


PRODUCT = re.compile(r"(?i)performax-(\S+)")
NAME = re.compile(r"\d[A-Za-z]+(\d\d)")
SEARCH = "multidrop scan PORT --dialect pmx tries every number and baud rate"
SYNC_TRIES = 2
"""The first question may follow the rest of another line."""


def find(state: PmxState) -> Procedure[PmxState | None]:
    """Identify one controller; None where it is silent."""
    text = ""
    for tried in range(SYNC_TRIES):
        # A gateway's greeting came in its place: the controller's reply is late.
        late = tried and not text.startswith("?")
        if late and (yield from PmxExchange(state).mark(state.codec.request(state.address, "ID"), False)) is None:
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


class PmxCertifying(Certifying):
    """The questions of a certificate to a PMX."""

    state: PmxState

    module = __file__
    reads = "{}"
    writes = "{}={}"
    refused = "{text}"


"""A refused command runs nothing in a controller (7.19.4: only a running program has a subroutine for errors)."""
