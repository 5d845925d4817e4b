"""Conversations with an MCode drive: typed lines and proof of them, lists, motion, flags; program mode."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

from multidrop.base.errors import DriveError, Inexpressible, NoAnswer, Refused, Stopped
from multidrop.dialects.codec import End, Kind, Priority, Procedure, Reply, Request
from multidrop.dialects.exchange import unsent_if_stopped
from multidrop.dialects.family import Motion
from multidrop.dialects.owed_settings import repaired
from multidrop.dialects.state import Owed, who
from multidrop.families.lexium.host import classify
from multidrop.families.lexium.host.classify import INTEGER
from multidrop.families.lexium.host.errors import report_error
from multidrop.families.lexium.host.mcode import exchange
from multidrop.families.lexium.host.mcode.before_request import before_request, find_again, first_print, value_of
from multidrop.families.lexium.host.mcode.codec import EVERY_DRIVE, MCode
from multidrop.families.lexium.host.mcode.identity import find, set_wire
from multidrop.families.lexium.host.mcode.state import MCodeState, ReplyPlace, refuse_in_program
from multidrop.families.lexium.host.operations import LexiumOperations
from multidrop.families.lexium.manual import grammar
from multidrop.families.lexium.manual.grammar import Number, UnaryTerm, parsed
from multidrop.families.lexium.manual.groups import READ_BACK
from multidrop.families.lexium.manual.mnemonic import EXPANDED
from multidrop.families.lexium.manual.points import EXPANDED_INPUTS, INPUTS, STATUS, in_words
from multidrop.families.lexium.manual.program_file import commented
from multidrop.families.lexium.manual.table import lookup

# Program mode: between `PG n` and `PG` the drive stores every line.
#
# Only EM=0 shows program mode by its prompt (an address), so the host uses EM=0 as long as program mode lasts. It
# checks the prompt of every line: a drive that was restarted is out of program mode and executes what it receives.
# After a missing reply, and before a line that starts motion where it is executed, the host first sends an empty line,
# which is neither stored nor executed, and reads the prompt.
# (MCode reference 5.1.98; facts of real units.)


NOT_SENT = "was not sent"


def enter_program(state: MCodeState, request: Request) -> Procedure[tuple[str, ...]]:
    """Send PG n in EM=0, the only mode that shows whether the drive entered program mode."""
    request = yield from unsent_if_stopped(who(state), request, before_request(state, request))
    try:
        if state.codec.em != 0:
            yield from echo_everything(state)
    except DriveError:
        yield from put_back(state)
        raise
    request = replace(request, codec=state.codec)
    state.may_be_in_program_mode()  # until the reply shows it: no other line may slip in
    try:
        reply = yield from exchange.send_until_answered(state, request)
        if not exchange.ends_in_program_mode(reply):
            raise Refused(f"{who(state)} did not go into program mode after '{request.text}'")
    except Refused:
        state.left_program_mode()
        yield from put_back(state)
        raise
    except DriveError:
        yield from exchange.take_out(state, "made sure that it is not in program mode")
        yield from put_back(state)
        raise
    state.remark(f"{who(state)}: program mode: every line is stored until PG")
    return ()


def echo_everything(state: MCodeState) -> Procedure[None]:
    """Set EM=0 for a while; `state.restore` records the previous mode and the drive before that.

    A drive that was silent at the opening is identified first: nobody restores an unknown one.
    """
    if not state.product:
        place = ReplyPlace(state.codec.party, state.address, (int(state.codec.checksum > 0),))
        if not (yield from find(state, place)):
            raise NoAnswer(f"{who(state)} does not reply: 'EM=0' was not sent")
    if not state.serial:
        state.serial_read((yield from serial_number(state)))
    if state.restore is None:
        state.owes(Owed(state.codec.em, state.name, state.product, state.version, state.part, state.serial))
    yield from set_wire(state, state.codec.request(state.address, "EM=0"))


def serial_number(state: MCodeState) -> Procedure[str]:
    """Read the serial number; empty where the drive prints none, or may not know the word.

    Older products with Ethernet may not know it. A name or a checksum in use rules them out.
    """
    mode = state.codec
    if not (state.product.startswith("LM") or mode.party or mode.checksum):
        return ""
    try:
        reply = yield from exchange.send_until_answered(state, exchange.question(state, "SN", "[!-~][ -~]*"))
    except Refused:
        return ""
    if reply.end is not End.DONE:
        state.reply_lost()
        return ""
    return exchange.value(state, reply)


def restore_echo(state: MCodeState) -> Procedure[None]:
    """Restore the echo mode from before `echo_everything`."""
    if state.restore is None:
        return
    mode = state.restore.em
    asked = yield from before_request(state, state.codec.request(state.address, f"EM={mode}"))
    if state.codec.em != mode:
        yield from set_wire(state, asked)
    state.owes_nothing()


def put_back(state: MCodeState) -> Procedure[None]:
    """Restore the echo mode beside another task: a failure becomes a note, but for a stop, which nothing may follow.

    After a refusal the host gives up. Without a reply the echo mode stays owed.
    """
    try:
        yield from restore_echo(state)
    except DriveError as error:
        if isinstance(error, Refused):
            state.owes_nothing()
        state.note(f"{who(state)}: its echo mode may be EM=0 now: {error}")
        if isinstance(error, Stopped):
            raise


def put_back_found(state: MCodeState, owed: Sequence[Owed]) -> Procedure[None]:
    """Restore, in this very drive only, what our last use of the port left, and report it."""
    alike = [each for each in owed if each.like(state)]
    if not alike or state.settings_unknown:
        return
    if any(record.serial for record in alike):
        state.serial_read((yield from serial_number(state)))
    yield from repaired(state, owed, MCodeOperations(state).perform)
    mine = next((record for record in alike if record.serial == state.serial and not record.lines), None)
    if mine is None or state.codec.em != 0:  # another host has set it since
        return
    state.owes(mine)
    yield from put_back(state)
    if state.restore is None and state.codec.em == mine.em:
        state.note(
            f"{who(state)}: an interrupted download or program mode left EM=0; EM={mine.em} is set again; check "
            "the program in it"
        )


def program_line(state: MCodeState, request: Request) -> Procedure[tuple[str, ...]]:
    """Send a line in program mode: the drive stores it, and nothing else may be asked."""
    moves = classify.starts_motion(request.text)  # in a drive that was without power meanwhile
    if (moves or state.reply_pending or state.settings_unknown) and not classify.leaves_program(request.text):
        yield from unsent_if_stopped(who(state), request, _make_sure(state, request, NOT_SENT))
    reply = yield replace(request, kind=Kind.PROGRAM)
    if reply.end in (End.TIMEOUT, End.DAMAGED):
        state.reply_lost()
        raise NoAnswer(f"{who(state)}: it is not known whether '{request.text}' was stored ({reply.end.value})")
    leaving, inside = classify.leaves_program(request.text), exchange.ends_in_program_mode(reply)
    if leaving and not inside:
        yield from _left(state, reply)
    elif reply.end in (End.REFUSED, End.NAK):
        yield from _make_sure(state, request, "was refused or executed")
        raise Refused(
            f"{who(state)} refused '{request.text}' in program mode; it is not stored; after PG, PR ER says why"
        )
    elif not inside:
        yield from _left(state, reply)
        executed = f"'{request.text}' was executed and not stored"
        raise Refused(f"{who(state)} was not in program mode any more: {executed}", certain=False)
    return ()


def _left(state: MCodeState, reply: Reply) -> Procedure[None]:
    state.left_program_mode()
    state.error_flag_read(reply.prompt == "?")
    yield from restore_echo(state)


def _make_sure(state: MCodeState, request: Request, fate: str) -> Procedure[None]:
    """Verify by its prompt that the drive is still in program mode. Raises NoAnswer or Refused where it is not."""
    reply = yield Request(state.address, "", Kind.PROGRAM, state.codec)
    if exchange.ends_in_program_mode(reply):
        state.synchronised()
        state.settings_confirmed()
        return
    state.reply_outstanding()
    if reply.prompt == "?":
        shows = f"{who(state)} shows an error, and not whether it is in program mode"
        raise Refused(f"{shows}: '{request.text}' {fate}; type PG", certain=fate == NOT_SENT)
    if not reply.prompt:
        yield from find_again(state, request)
    state.synchronised()
    yield from _left(state, reply)
    raise Refused(f"{who(state)} is not in program mode any more: '{request.text}' {fate}", certain=fate == NOT_SENT)


# Proof of a command that shows no sign of its execution: its effect is read where reading is harmless.
#
# Theory of operation. In EM=2, and with CK=2 while a program runs, a drive does not show that it executed a command.
# EF=0 only shows that it refused none. An ACK or a line end may also be another drive's, late. So the host reads a
# setting back. A drive that was at rest and moves now, or runs a program now, has executed the command that starts it.
# Everything else is reported as not confirmed. (MCode reference 5.1.21, 5.1.39; decision 0010.)


ACTIVITY = 'BY," ",MV," ",P', f"[01] [01] {INTEGER}"
"""Items of PR and their form: whether a program runs, whether the drive moves, its position."""


def rest_before(state: MCodeState, request: Request) -> Procedure[list[int]]:
    """Read `ACTIVITY` before a command that can start motion, where only that can confirm it; else nothing."""
    silent = state.codec.em == 2 and request.kind is Kind.COMMAND
    if not silent or written(request.text) is not None or not state.codec.starts_motion(request.text):
        return []
    before = yield from _numbers(state, *ACTIVITY)
    if not before:
        raise NoAnswer(f"{who(state)} does not reply: '{request.text}' was not sent")
    return before


def confirm_effect(state: MCodeState, request: Request, before: list[int]) -> Procedure[None]:
    """Read the effect of a command that no sign of the drive confirms; note where that proves nothing.

    Raises NoAnswer if the setting that it wrote reads as another number.
    """
    if (setting := written(request.text)) is not None:
        word, number = setting
        numbers = yield from _numbers(state, f'{word}," ",BY', f"{INTEGER} [01]")
        if numbers and abs(numbers[0] - number) <= READ_BACK[word]:
            return
        if numbers and not numbers[1]:  # a running program may have written another number meanwhile
            fate = "it is not known whether it was executed; it was sent once"
            raise NoAnswer(f"{who(state)}: {word} reads {numbers[0]} after '{request.text}': {fate}")
    elif before[:2] == [0, 0]:  # at rest: nothing that happens next happens by itself
        after = yield from _numbers(state, *ACTIVITY)
        if after and after != before:
            return
    state.note(f"{who(state)}: '{request.text}' was sent once and not refused; its execution is not confirmed")


def written(text: str) -> tuple[str, int] | None:
    """Find the word that a line sets to a whole number, where the drive prints that number back; else None."""
    statement = parsed(text)
    if statement is None or len(statement.arguments) != 1:
        return None
    [argument] = statement.arguments
    sign = 1
    if isinstance(argument, UnaryTerm) and argument.op == "-":
        sign, argument = -1, argument.operand
    row = lookup(statement.word)
    if row is None or row.name not in READ_BACK or not isinstance(argument, Number) or argument.value % 1:
        return None
    return row.name, sign * int(argument.value)


def _numbers(state: MCodeState, items: str, form: str) -> Procedure[list[int]]:
    try:
        reply = yield from exchange.send_until_answered(state, exchange.question(state, items, form))
    except (NoAnswer, Refused):
        return []
    if not reply.lines:
        state.reply_lost()
        return []
    return [int(number) for number in exchange.value(state, reply).split()]


# Typed lines, lists, motion, flags. `exchange` has the single request.


class MCodeOperations(LexiumOperations):
    """What an MCode drive is asked to do, and what it says of its motion."""

    state: MCodeState

    def perform(self, text: str) -> Procedure[tuple[str, ...]]:
        """Send a typed line and prove its outcome; return the printed lines.

        Raises Refused, NoAnswer, Stopped or Inexpressible.
        """
        state = self.state
        self.check(text)
        request = state.codec.request(state.address, text)
        if state.address in EVERY_DRIVE:
            # Send to all drives. No drive replies, so lines that need a proof are refused.
            if classify.word_of(request.text)[0] == "PG":
                raise Refused(
                    f"'{request.text}' to all drives would make each of them store the next lines; name one drive"
                )
            if classify.setting_of(request.text) is not None:
                state.settings_may_have_changed()
            yield request
            state.remark(
                f"{state.address}: no drive replies to a command to all; it is not known whether it was executed"
            )
            return ()
        if state.programming:
            return (yield from program_line(state, request))
        if state.restore is not None and not state.restore.lines:
            yield from put_back(state)
            request = state.codec.request(state.address, text)
        if classify.enters_program(request.text):
            return (yield from enter_program(state, request))
        if classify.word_of(request.text)[0] == "PG":
            raise Refused(f"{who(state)} is not in program mode: 'PG' alone would enter it; type PG and an address")
        return (yield from self.immediate(request))

    def check(self, text: str) -> None:
        """Raise Inexpressible for a line with a number in groups of digits, or with a comment."""
        try:
            grammar.check_groups(text)
        except grammar.LineError as error:
            raise Inexpressible(f"'{text}': {error.why}; nothing was sent") from None
        if why := commented(text):
            raise Inexpressible(f"'{text}': {why}")

    def immediate(self, request: Request) -> Procedure[tuple[str, ...]]:
        """Send a line that is executed at once, not stored."""
        state = self.state
        if state.unconfirmed is not None and (lines := (yield from first_print(state, request))) is not None:
            return lines
        request = yield from unsent_if_stopped(who(state), request, before_request(state, request))
        if request.kind is Kind.SETTING:
            yield from set_wire(state, request)
            return ()
        if request.kind is Kind.PRINT:
            return (yield from self._print(request))
        before = yield from unsent_if_stopped(who(state), request, rest_before(state, request))
        if classify.acts_on_program(request.text):
            state.steps(False)
        if classify.word_of(request.text)[0] == "EX":
            state.program_started()
        target = classify.target_of(request.text, state.rest)
        if displaces := classify.may_displace(request.text):
            state.heads_for(None)
        reply = yield from exchange.send_persons_line(state, request)
        if request.kind is Kind.LIST:
            # Print a mark after a list: EM 1 to 3 give a list no end.
            lines = reply.lines
            rest: tuple[str, ...] | None = ()
            if state.codec.em != 0:
                rest = yield from exchange.rest_of_list(state, request.priority)
                lines += rest or ()
                if rest is not None and not lines:
                    yield from exchange.check_error_flag(state, request)
            if rest is None or exchange.lacks_lines(reply, lines):
                raise NoAnswer(f"{who(state)}: the list may be incomplete: its end or a line was damaged; ask again")
            return tuple(line for line in lines if line)
        if not reply.acknowledged:
            late = yield from exchange.check_error_flag(state, request, silent=reply.end is End.SILENT)
            if reply.doubtful or (reply.end is End.SILENT and not late):
                yield from confirm_effect(state, request, before)
        if displaces:
            state.heads_for(target)
        return reply.lines

    def _print(self, request: Request) -> Procedure[tuple[str, ...]]:
        """Send a person's print, signed so that no other line is taken for it."""
        state = self.state
        request = exchange.signed(state, request)
        reply = yield from exchange.send_persons_line(state, request)
        if reply.end is End.SILENT:
            # Find the reason for an empty print: a refusal, or a loss (with EM=2, where not even a line feed is sent).
            if state.codec.em == 2:
                state.reply_outstanding()
                yield from exchange.require_mark(state, request)
            yield from exchange.check_error_flag(state, request)
            if not classify.may_be_blank(request.text, request.expect):
                raise NoAnswer(f"{who(state)} printed nothing for '{request.text}', and has no error")
        own = exchange.sign(state).shown if request.signed else ""
        lines = tuple(line.removesuffix(own) for line in reply.lines)
        if classify.reads_error(request.text) and lines and lines[-1].strip().isdecimal():
            report_error(state, int(lines[-1]))
        return lines

    def listing(self, start: str) -> Procedure[tuple[str, ...]]:
        refuse_in_program(self.state, "list it")
        return (yield from self.perform(f"L {start}".rstrip()))

    def motion(self, priority: Priority) -> Procedure[tuple[Motion, ...]]:
        """Read position and velocity in one print, so that they belong together and use the wire half as long.

        The drive's signature is between them, so another drive's reply does not match. Only a poll leaves out BY, which
        is read before the velocity: after BY=0 no program sets a new one.
        """
        state = self.state
        refuse_in_program(state, "ask again")
        yield from before_request(state, _motion(state.codec, state.address, exchange.sign(state), priority))
        request = _motion(state.codec, state.address, exchange.sign(state), priority)
        reply = yield from exchange.send_once(state, request)
        exchange.check_printed(state, reply)
        match = re.fullmatch(request.expect or "", reply.text)
        assert match is not None
        return (Motion(int(match[2]), int(match[3]), program=match[1] == "1" if match[1] else None),)

    def status(self) -> Procedure[tuple[str, ...]]:
        """Describe motion, program, error and inputs from one print; nothing is cleared.

        Every product has these words: an error could start the drive's error subroutine.
        """
        state = self.state
        if state.programming:
            return ("program mode: lines are stored, not executed; PG ends it",)
        asked = '" ",'.join(f"{word}," for word in STATUS).rstrip(",")
        pattern = " ".join((INTEGER, INTEGER, "[01]", "[01]", "[01]", r"\d{1,4}"))
        flags = (yield from value_of(state, asked, pattern)).split()
        position, velocity, moving, busy, error, inputs = map(int, flags)
        state.error_flag_read(error == 1)
        points = EXPANDED_INPUTS if state.product in EXPANDED else INPUTS
        return in_words(position, velocity, moving, busy, error, inputs, points=points)

    def flag(self, name: str) -> Procedure[bool]:
        refuse_in_program(self.state, "ask again")
        return (yield from value_of(self.state, name, "[01]")) == "1"


@lru_cache(maxsize=256)
def _motion(codec: MCode, address: str, own: exchange.Sign, priority: Priority) -> Request:
    """Build the request once for each drive; telemetry sends it as fast as the wire allows."""
    busy = priority is not Priority.POLL
    asked = codec.request(address, f"PR {'BY,' if busy else ''}P,{own.item},V")
    expect = f"({'[01]' if busy else ''})({INTEGER}){re.escape(own.shown)}({INTEGER})"
    return replace(asked, expect=expect, signed=True, priority=priority)
