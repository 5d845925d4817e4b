"""Conversations with an Ethernet drive over Modbus: typed lines, motion and flags.

A device that does not identify itself as a Lexium drive
is a stranger (`DriveState.stranger`): it is sent the request of a typed line, and no request more.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from multidrop.base.errors import Inexpressible, NoAnswer, Refused
from multidrop.dialects.certifying import Certifying
from multidrop.dialects.codec import End, Kind, Priority, Procedure, Reply, Request
from multidrop.dialects.exchange import unanswered
from multidrop.dialects.family import Motion
from multidrop.dialects.state import who
from multidrop.families.lexium.host.classify import starts_motion
from multidrop.families.lexium.host.errors import described, earlier_error, report_error
from multidrop.families.lexium.host.modbus import framing, limits, mapping
from multidrop.families.lexium.host.modbus.codec import USER, ModbusState, pdu_codec
from multidrop.families.lexium.host.modbus.mapping import ReadRequest
from multidrop.families.lexium.host.operations import LexiumOperations
from multidrop.families.lexium.manual import grammar
from multidrop.families.lexium.manual.errors import BY_ITSELF
from multidrop.families.lexium.manual.modbus.help import shown as shown_limits
from multidrop.families.lexium.manual.modbus.registers import ALTERNATIVE, REGISTERS, ROWS, SETUPS
from multidrop.families.lexium.manual.points import STATUS, in_words
from multidrop.families.lexium.manual.program_file import commented, spaced

# One request to an Ethernet drive over Modbus, and proof of its outcome.
#
# Theory of operation. A reply has its request's number, so a late reply is never taken for another's. A refusal is an
# exception. The drive's own error number says more, so the host then reads EF and, if it is 1, ER. A drive may accept
# a write and fail to execute it, so the host reads EF after a typed command too. Reading ER clears it: an earlier
# error is read and reported first. The host never repeats a request.


ILLEGAL_VALUE, FAILURE = 3, 4
NO_REGISTER = frozenset({1, 2, ILLEGAL_VALUE})
"""Exceptions of a device that lacks a function or a register; others pass, as of a gateway that is busy."""
READS = frozenset(
    {framing.READ_COILS, framing.READ_INPUTS, framing.READ_REGISTERS, framing.IDENTIFY, framing.READ_SPECIFIC}
)


def request(state: ModbusState, text: str, pdu: bytes, priority: Priority = Priority.OPERATOR) -> Request:
    """Build the request around a PDU; `text` describes it to a person."""
    kind = Kind.PRINT if pdu[0] in READS else Kind.COMMAND
    return Request(state.address, text, kind, state.codec, priority, body=pdu)


def answered(state: ModbusState, asked: Request) -> Procedure[bytes]:
    """Send a request once; return the reply. Raises Refused (exception and drive's own error) or NoAnswer."""
    reply = yield asked
    if reply.end is End.REFUSED:
        code, valid = None, ""
        if reply.body[1] in (ILLEGAL_VALUE, FAILURE) and not state.stranger:
            code = yield from error_number(state)
            valid = yield from valid_values(state, asked, reply)
        raise refusal(state, asked, reply, code, valid)
    return sure(state, asked, reply)


def sure(state: ModbusState, asked: Request, reply: Reply) -> bytes:
    """Return the content of a reply. Raises NoAnswer where there is none, Refused for an exception."""
    if reply.end is End.REFUSED:
        raise refusal(state, asked, reply, None)
    if reply.end is not End.DONE:
        raise unanswered(who(state), asked, reply)
    return reply.body


def value(state: ModbusState, name: str, priority: Priority = Priority.OPERATOR) -> Procedure[int]:
    """Read a register without a look at the drive's error, which would clear it. Raises Refused or NoAnswer."""
    register = REGISTERS[name]
    asked = request(state, f"PR {name}", mapping.read(register), priority)
    return mapping.value_of(register, pdu_codec().registers(sure(state, asked, (yield asked))))


def printed(state: ModbusState, word: str, priority: Priority = Priority.OPERATOR) -> Procedure[str]:
    """Read what PR prints of a word, as `value` does."""
    reading = mapping.reading(word)
    asked = request(state, f"PR {word}", reading.pdu, priority)
    return shown(state, word, reading, sure(state, asked, (yield asked)))


def shown(state: ModbusState, word: str, reading: mapping.ReadRequest, answer: bytes) -> str:
    try:
        return reading.shown(answer)
    except framing.NotModbus:
        raise NoAnswer(f"{who(state)}: the reply to 'PR {word}' is damaged") from None


def refusal(state: ModbusState, asked: Request, reply: Reply, code: int | None, valid: str = "") -> Refused | NoAnswer:
    """Describe an exception: its number and name, its place, the valid values there, and the drive's own error.

    An exception that does not say that the request was not executed is no refusal.
    """
    number = reply.body[1]
    name, place = framing.EXCEPTIONS.get(number, "unknown"), mapping.place(asked.body)
    exception = f"exception {number:02} {name} at {place}"
    gateway = f"; {framing.GATEWAYS[number]}" if number in framing.GATEWAYS else ""
    reads = asked.kind is Kind.PRINT
    if number in framing.NO_RESULT or not (number in framing.NOT_EXECUTED or code or reads):
        fate = "" if reads else "; it is not known whether it was executed; it was sent once"
        return NoAnswer(f"{who(state)}: '{asked.text}' has no result: {exception}{gateway}{fate}")
    if number == framing.NO_PATH:
        return Refused(f"'{asked.text}' did not reach {who(state)}: {exception}{gateway}")
    text = f"{who(state)} refused '{asked.text}': {exception}{valid}"
    return Refused(f"{text}; {described(code, state)}" if code else text, code)


def valid_values(state: ModbusState, asked: Request, reply: Reply) -> Procedure[str]:
    """Say which values are valid where a value was refused: the register's range, or the unit's own limit in it."""
    row, value = mapping.written(asked.body)
    if row is None or reply.body[1] != ILLEGAL_VALUE:
        return ""
    if value is None:
        return f", which is a part of {row.name}: write both registers, as in /register 0x{row.address:04X} =VALUE"
    if not row.allows(value):
        return f", which takes {shown_limits(row.limits)}"
    now: dict[str, int] = {}
    for word in limits.rests_on(row.name):
        if REGISTERS[word].only and state.product.startswith(OPEN_LOOP):  # reading it is an error of the drive
            now[word] = 0
        elif (number := (yield from _quietly(state, word))) is not None:
            now[word] = number
    if taken := limits.own(row.name, value, now):
        return f", which takes {taken}"
    return f": {value} is in the range of the register, and this unit does not take it now"


def error_number(state: ModbusState) -> Procedure[int | None]:
    """Read the drive's own error, which clears it; None for no error, or where it cannot be read."""
    state.error_flag_read(True)  # until it is read: its reply may be lost, and a stop may come in between
    reply = yield request(state, "PR EF", mapping.read(REGISTERS["EF"]))
    refused = reply.end is End.REFUSED and reply.body[1] in NO_REGISTER
    if refused or (reply.end is End.DONE and not any(pdu_codec().registers(reply.body))):
        state.error_flag_read(False)  # a device that has no register for the flag has none
    if reply.end is not End.DONE or not state.error:
        return None
    if (number := (yield from _quietly(state, "ER"))) is not None:
        state.error_flag_read(False, number)
    return number


def _quietly(state: ModbusState, name: str) -> Procedure[int | None]:
    register = REGISTERS[name]
    reply = yield request(state, f"PR {name}", mapping.read(register))
    return mapping.value_of(register, pdu_codec().registers(reply.body)) if reply.end is End.DONE else None


def carried_out(state: ModbusState, text: str, pdu: bytes) -> Procedure[bytes]:
    """Send a command and verify that the drive executed it. Raises Refused or NoAnswer.

    An earlier error is read and reported first, so that the command is not blamed for it. Of a stranger no error is
    read: its reply is all that is known.
    """
    if state.stranger:
        return (yield from answered(state, request(state, text, pdu)))
    if state.error and (code := (yield from error_number(state))):
        state.note(f"{who(state)}: {earlier_error(code, state)}")
    clear = not state.error
    state.error_flag_read(True)  # until it is read: a command that is not answered in time may still be refused
    answer = yield from answered(state, request(state, text, pdu))
    if code := (yield from error_number(state)):
        if not clear:
            old = f"{described(code, state)}; it may be older than '{text}', as the flag could not be read before"
            raise NoAnswer(f"{who(state)}: {old}: it is not known whether '{text}' was executed; it was sent once")
        if code in BY_ITSELF and not starts_motion(text):  # the reply confirms the write
            state.note(f"{who(state)}: '{text}' was executed, and meanwhile: {described(code, state)}, now cleared")
            return answer
        raise NoAnswer(
            f"{who(state)} accepted '{text}' and then showed {described(code, state)}, now cleared: it is not known "
            "whether it was executed, or the error is another program's; it was sent once"
        )
    return answer


def flagged(state: ModbusState) -> Procedure[bool]:
    """Whether the error flag is set, as far as it can be read."""
    state.error_flag_read(bool((yield from _quietly(state, "EF"))))
    return state.error


OUTPUTS = 3
OPEN_LOOP = "LMDO"
"""The beginning of the names of products without an encoder and hMT."""
_ESCAPES = {"b": "\b", "c": "\x03", "e": "\x1b", "g": "\a", "n": "\n", "r": "\r", "t": "\t"}


class ModbusOperations(LexiumOperations):
    """What an Ethernet drive is asked to do, and what it says of its motion."""

    state: ModbusState

    def check(self, text: str) -> None:
        """Raise Inexpressible for a line that is wrong in the language, or has a comment."""
        parsed(text)

    def perform(self, text: str) -> Procedure[tuple[str, ...]]:
        """Carry out a line of MCode; return the printed lines. Raises Refused, NoAnswer, Stopped or Inexpressible."""
        text = spaced(text)
        statement = parsed(text)
        if statement is None:
            return ()
        if not statement.word:
            raise Inexpressible(f"'{text}' has no register; an answer to IV goes through {ALTERNATIVE}")
        if statement.word == "PR":
            return (yield from self._printed(statement))
        yield from carried_out(self.state, text, mapping.command(statement))
        return ()

    def _printed(self, statement: grammar.Statement) -> Procedure[tuple[str, ...]]:
        """Print the items of a PR: one request for each name; the host inserts the rest."""
        state = self.state
        if [argument.word for argument in statement.arguments if isinstance(argument, grammar.NameTerm)] == ["AL"]:
            return (yield from self.every_register())
        pieces = []
        for item in list(_items(statement)):  # every item is checked before the first request
            if isinstance(item, str):
                pieces.append(item)
                continue
            word, reading = item
            answer = yield from answered(state, request(state, f"PR {word}", reading.pdu))
            pieces.append(shown(state, word, reading, answer))
            if state.stranger:
                continue
            if word == "ER":
                report_error(state, int(pieces[-1]))
            elif word == "EF":
                state.error_flag_read(pieces[-1] == "1")
        return tuple("".join(pieces).replace("\r", "").split("\n"))

    def every_register(self) -> Procedure[tuple[str, ...]]:
        """Print every readable register of this drive and the set-ups, in alphabetical order (PR AL).

        It neither clears an error nor raises one, which could start the drive's error subroutine. So it omits ER while
        EF is 1. It omits V1 to V8 always: reading one is an error unless a program has declared it (over MCode UV
        prints them).
        """
        state = self.state
        if state.stranger:
            raise Inexpressible(
                f"'PR AL' was not sent, as {state.stranger}. Read one register: PR P, or /register 0x57"
            )
        if (yield from flagged(state)):
            state.note(f"{who(state)}: ER is left out, as reading it clears it; its error flag is set (EF=1)")
        plain = state.product.startswith(OPEN_LOOP)
        rows = [row for row in ROWS if row.readable and row.name not in USER and not (plain and row.only)]
        lines: list[str] = []
        for word in sorted({row.name for row in rows} | {"IS", "OS"}):
            if word == "ER" and state.error:
                continue
            try:
                text = yield from printed(state, word)
            except Refused:
                continue  # this drive lacks the register
            if word in SETUPS - REGISTERS.keys():  # a set-up has lines of its own
                lines += [line for line in text.replace("\r", "").split("\n") if line]
            else:
                lines.append(f"{word} = {text}")
        return tuple(lines)

    def motion(self, priority: Priority) -> Procedure[tuple[Motion, ...]]:
        """Read position and velocity in two requests, since one carries two registers at most."""
        position = yield from value(self.state, "P", priority)
        return (Motion(position, (yield from value(self.state, "V", priority))),)

    def flag(self, name: str) -> Procedure[bool]:
        answer = yield from answered(self.state, request(self.state, f"PR {name}", mapping.read(REGISTERS[name])))
        return pdu_codec().registers(answer)[0] != 0

    def status(self) -> Procedure[tuple[str, ...]]:
        """Describe motion, program, error, inputs and outputs; nothing is cleared."""
        state = self.state
        values = []
        for name in STATUS:
            register = REGISTERS[name]
            answer = yield from answered(state, request(state, f"PR {name}", mapping.read(register)))
            values.append(mapping.value_of(register, pdu_codec().registers(answer)))
        state.error_flag_read(bool(values[STATUS.index("EF")]))
        asked = request(state, "O1 to O3", pdu_codec().read(framing.READ_COILS, 0, OUTPUTS))
        outputs = pdu_codec().bits((yield from answered(state, asked)), OUTPUTS)
        states = ", ".join(f"{n} {'active' if on else 'inactive'}" for n, on in enumerate(outputs, 1))
        return (*in_words(*values), f"outputs: {states}")


def parsed(text: str) -> grammar.Statement | None:
    """Parse a line of MCode. Raises Inexpressible for one that is wrong in the language, or has a comment."""
    try:
        grammar.check_groups(text, USER)
        if why := commented(text):
            raise Inexpressible(f"'{text}': {why}")
        return grammar.parse(text, USER)
    except grammar.LineError as error:
        raise Inexpressible(f"'{text}': {error.why}; nothing was sent") from None


def _items(statement: grammar.Statement) -> Iterator[str | tuple[str, ReadRequest]]:
    rest = [argument for argument in statement.arguments if argument is not None]
    while rest:
        item = rest.pop(0)
        if isinstance(item, grammar.Text):
            yield re.sub(r"\\(.)", lambda found: _ESCAPES.get(found[1], found[0]), item.value)
        elif isinstance(item, grammar.Number):
            yield str(item.value)
        elif isinstance(item, grammar.NameTerm):
            yield item.word, mapping.reading(item.word)
            sensor = item.word == "IT" and rest and isinstance(rest[0], grammar.Number)
            if sensor and rest.pop(0) != grammar.Number(1):
                raise Inexpressible(f"a register has one sensor of IT, the first; {ALTERNATIVE} has others")
        else:
            raise Inexpressible(f"expressions are not evaluated over Modbus; {ALTERNATIVE} prints them")


class ModbusCertifying(Certifying):
    """The questions of a certificate to an Ethernet drive."""

    state: ModbusState

    module = __file__
    reads = "PR {}"
    writes = "{}={}"

    def traits(self) -> set[str]:
        return {"closed"} if self.state.product.startswith("LMDC") else set()


"""All only read: over Modbus no program is listed, so nothing that may raise an error is asked."""
