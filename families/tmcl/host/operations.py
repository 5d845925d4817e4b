"""Procedures with modules: identification, a typed line, and the motion of the motors.

Identification only reads: nothing moves, and no error is cleared.
"""

from __future__ import annotations

from dataclasses import replace

from multidrop.base.errors import Inexpressible, NoAnswer, Refused, Stopped
from multidrop.dialects.certifying import Certifying
from multidrop.dialects.codec import End, Kind, Priority, Procedure, Reply, Request
from multidrop.dialects.exchange import Exchange
from multidrop.dialects.family import ADDRESSES, Motion, Referencing
from multidrop.dialects.state import OfDrive, who
from multidrop.families.tmcl.host.codec import (
    LENGTH,
    MOST_MOTORS,
    Tmcl,
    TmclState,
    call_of,
    late_reply_to,
    number_of,
    parse_reply,
)
from multidrop.families.tmcl.manual import commands
from multidrop.families.tmcl.manual.commands import (
    REFUSALS,
    AxisParameter,
    Command,
    Global,
    ProgramStatus,
    SearchAction,
    Status,
    TmclCall,
    Version,
)
from multidrop.families.tmcl.manual.instructions import CONTROL

# One request, and proof that its reply belongs to no other one; the motors of a module.
#
# A reply repeats the command and not what it was for. So the sync mark is a reading command whose number no lost reply
# bears.


SYNC_MARKS = (
    TmclCall(Command.GGP, Global.HOST_ADDRESS),
    TmclCall(Command.VERSION, Version.BINARY),
    TmclCall(Command.RFS, SearchAction.STATUS),
    TmclCall(Command.GAP, AxisParameter.ACTUAL_POSITION),
)
"""Reading commands. Each can prove that the replies to all other commands are over."""
ANY_VALUE = r"-?\d+"
END = "133 0, 0, 0"
"""The line that ends download mode."""


def status_of(reply: Reply) -> int | None:
    """The status in the frame of a reply; None: it is not one."""
    fields = parse_reply(reply.body) if len(reply.body) == LENGTH else None
    return fields.status if fields is not None else None


def read(state: TmclState, call: TmclCall, priority: Priority = Priority.OPERATOR) -> Procedure[int]:
    """The value of a reading command. Raises Refused or NoAnswer."""
    asked = state.codec.request(state.address, str(call), call)
    reply = yield from TmclExchange(state).answered(replace(asked, priority=priority))
    return int(reply.text)


class TmclExchange(Exchange):
    """The exchange with a TMCL module."""

    state: TmclState

    def mark(self, request: Request, after: bool) -> Procedure[tuple[str, ...] | None]:
        """Send a mark; where the commands of all marks have lost replies, the first one twice before it.

        That one is sent again only once all have lost replies. So the second of two replies to it follows those to the
        others, and only its own and a stop's may still be late.
        """
        state = self.state
        lines: list[str] = []
        if state.lost_commands.issuperset(each.command for each in SYNC_MARKS):
            for _ in range(2):
                reply = yield from self._asked(SYNC_MARKS[0], request.priority)
                if reply is None:
                    return None
                lines += reply.lines[:-1]
            state.late_again(SYNC_MARKS[0].command)
        own = call_of(request.body)[1].command
        taken = state.lost_commands | ({own} if after else set())
        call = next((each for each in SYNC_MARKS if each.command not in taken), SYNC_MARKS[0])
        reply = yield from self._asked(call, request.priority)
        if reply is None or (call.command in taken and reply.doubtful):
            state.reply_lost(call.command)
            return None
        state.proved()
        name = f"{who(state)}: {late_reply_to(own)}"
        return tuple(line for line in (*lines, *reply.lines[:-1]) if not after or name in line)

    def lost(self, request: Request) -> None:
        self.state.reply_lost(call_of(request.body)[1].command)

    def refusal(self, request: Request, reply: Reply) -> Refused | NoAnswer:
        code = int(reply.text)
        meaning, advice = REFUSALS.get(code, ("", ""))
        text = f"{meaning} ({advice})" if meaning else "unknown status"
        return Refused(f"{who(self.state)} refused '{request.text}': status {code}, {text}", code)

    def send(self, request: Request) -> Procedure[Reply]:
        """The reply to a request; a reply that is not awaited to its end is lost."""
        state = self.state
        try:
            reply = yield request
            status = status_of(reply) if call_of(request.body)[1].command != Command.READ_PROGRAM else None
            if status == Status.STORED:
                state.found_storing()
                state.note(f"{who(state)} is in download mode and stored '{request.text}'; {END} or a stop ends that")
            elif status == Status.DONE and state.restore is not None and not state.restore.lines:
                state.owes_nothing()
            return reply
        except (Stopped, GeneratorExit):
            self.lost(request)
            raise

    def answered(self, request: Request, doubts: list[Request] | None = None) -> Procedure[Reply]:
        """Send a request once, a reading one once more where no reply comes; its reply. Raises Refused or NoAnswer.

        After a SAP 193 that was refused or got no reply, no search begins until 193 is read or set.
        """
        state = self.state
        call = call_of(request.body)[1]
        begins = (call.command, call.type) == (Command.RFS, SearchAction.START)
        if begins and call.motor in state.search_modes_unknown:
            raise Refused(
                f"{who(state)}: SAP 193 for motor {call.motor} was refused or got no reply: '{request.text}' would "
                f"search in another mode and was not sent; read it (GAP 193, {call.motor}) or set it"
            )
        if state.programming:
            raise Refused(f"{who(state)} is in download mode and would store '{request.text}'; {END} ends that")
        yield from self.synchronised(request)
        if state.programming:
            raise Refused(f"{who(state)} is in download mode; '{request.text}' was not sent", int(Status.STORED))
        sets = (call.command, call.type) == (Command.SAP, AxisParameter.SEARCH_MODE)
        if sets:
            state.search_mode_sent(call.motor)
        try:
            reply = yield from super().answered(request, doubts)
        except NoAnswer as lost:
            if request.kind is not Kind.PRINT or call.changed_by_reading:
                raise
            reply = yield from self._asked_again(request, lost)
        if sets or (call.command, call.type) == (Command.GAP, AxisParameter.SEARCH_MODE):
            state.search_mode_known(call.motor)
        return reply

    def _asked(self, call: TmclCall, priority: Priority) -> Procedure[Reply | None]:
        """Send a reading command, and gather what comes before its reply; None without a reply."""
        state = self.state
        asked = replace(state.codec.request(state.address, str(call), call), priority=priority)
        reply = yield from self.send(replace(asked, expect=ANY_VALUE, gather=True))
        if reply.end is not End.DONE:
            state.reply_lost(call.command)
            return None
        return reply

    def _asked_again(self, request: Request, lost: NoAnswer) -> Procedure[Reply]:
        """Send a reading request once more, when a mark has shown that all replies to the first one are over."""
        state = self.state
        try:
            yield from self.synchronised(request)
        except NoAnswer:
            raise lost from None
        except Stopped:
            raise Stopped(f"{who(state)}: '{request.text}' was stopped before its reply came") from None
        if state.programming:  # it would store the request
            raise lost
        try:
            return (yield from super().answered(request))
        except NoAnswer:
            raise NoAnswer(f"{who(state)} does not reply: '{request.text}' only reads, and was sent twice") from None

    def store(self, request: Request, call: TmclCall, by_hand: bool = True) -> Procedure[None]:
        """Begin a download, store a line, or end the download; nothing else may go to the module meanwhile."""
        state = self.state
        if not state.programming:
            yield from self.synchronised(request)
            state.found_storing()
            if by_hand:
                state.remark(f"{who(state)}: download mode: every command is stored until {END}, or a stop")
        begins, ends = call.command == Command.DOWNLOAD, call.command == Command.END_DOWNLOAD
        reply = yield replace(request, kind=Kind.PROGRAM)
        status = status_of(reply)
        if status is None:
            state.reply_lost(call.command)
            raise NoAnswer(f"{who(state)}: it is not known whether '{request.text}' was stored; it was sent once")
        control = call.command >= CONTROL and not ends
        if status == Status.STORED or (status == Status.DONE and control):  # a module executes a control command
            return
        if status == Status.DONE or begins:
            state.executes()
            state.owes_nothing()
        if status != Status.DONE:
            raise self.refusal(request, reply)
        if not ends:
            raise Refused(
                f"{who(state)} was not in download mode any more: '{request.text}' was executed and not stored"
            )


def motors(state: TmclState, priority: Priority = Priority.OPERATOR) -> Procedure[int]:
    """The number of motors; where it is not known, read motors until the module refuses one. Raises NoAnswer.

    It is read together with parameter 127 of each motor; a module that refuses that for one lacks it.
    """
    if state.motors:
        return state.motors
    count = 1
    try:
        while count < MOST_MOTORS:
            yield from read(state, TmclCall(Command.GAP, AxisParameter.ACTUAL_POSITION, count), priority)
            count += 1
    except Refused:
        pass
    state.motors_counted(count)
    try:
        for motor in range(count):
            call = TmclCall(Command.GAP, AxisParameter.RELATIVE_FROM, motor)
            state.relative_read(motor, (yield from read(state, call, priority)))
    except (Refused, NoAnswer):
        pass
    return count


PROGRAM = TmclCall(Command.PROGRAM_STATUS)
LACKS = (Status.INVALID_COMMAND, Status.WRONG_TYPE, Status.INVALID_VALUE)
"""The statuses of a module that does not know a command or a parameter."""


class TmclOperations(OfDrive):
    """What a TMCL module is asked to do, and what it says of its motion."""

    state: TmclState

    def perform(self, text: str) -> Procedure[tuple[str, ...]]:
        """Send a command in TMCL's notation; the value where it prints one.

        Raises Refused, NoAnswer, Stopped or Inexpressible.
        """
        state = self.state
        request, call = self.parsed(text)
        if state.programming or call.command == Command.DOWNLOAD:
            yield from TmclExchange(state).store(request, call)
            return ()
        if call.command == Command.FACTORY or (
            call.command in (Command.SAP, Command.RSAP) and call.type == AxisParameter.RELATIVE_FROM
        ):
            state.relative_forgotten()
        reply = yield from TmclExchange(state).answered(request)
        self._remark(call)
        return reply.lines if request.kind is Kind.PRINT else ()

    def check(self, text: str) -> None:
        """Raise Inexpressible for a line that is wrong in the language."""
        self.parsed(text)

    def parsed(self, text: str) -> tuple[Request, TmclCall]:
        """Build the request for a command. Raises Inexpressible for one that no module gets."""
        state = self.state
        try:
            call = commands.parse(text)
        except commands.TmclLineError as error:
            if state.address not in ("", *ADDRESSES):
                number_of(state.address)  # in `@2GAP 1, 0` the address is what is wrong
            raise Inexpressible(f"'{text.strip()}': {error}; nothing was sent") from None
        return state.codec.request(state.address, text.strip(), call), call

    def motion(self, priority: Priority) -> Procedure[tuple[Motion, ...]]:
        state = self.state
        motions = []
        count = yield from motors(state, priority)
        for motor in range(count):
            position = yield from read(state, TmclCall(Command.GAP, AxisParameter.ACTUAL_POSITION, motor), priority)
            velocity = yield from read(state, TmclCall(Command.GAP, AxisParameter.ACTUAL_VELOCITY, motor), priority)
            motions.append(Motion(position, velocity, str(motor) if count > 1 else ""))
        return tuple(motions)

    def moving(self) -> Procedure[bool]:
        """Whether a motor has a velocity, or searches its reference."""
        state = self.state
        for motor in range((yield from motors(state))):
            if (yield from read(state, TmclCall(Command.GAP, AxisParameter.ACTUAL_VELOCITY, motor))):
                return True
            try:
                if (yield from read(state, TmclCall(Command.RFS, SearchAction.STATUS, motor))):
                    return True
            except Refused:  # a module without reference search
                pass
        return False

    def busy(self, priority: Priority = Priority.OPERATOR) -> Procedure[bool]:
        """Whether its program runs; a module that knows neither question has none."""
        for call in (TmclCall(Command.GGP, Global.PROGRAM_STATUS), PROGRAM):
            try:
                return mode_of((yield from read(self.state, call, priority))) == ProgramStatus.RUNS
            except Refused as refused:
                if refused.code not in LACKS:
                    raise
        return False

    def referencing(self, text: str) -> Referencing | None:
        if (call := commands.parsed(text)) is None:
            return None
        searches = call.command == Command.RFS and call.type == SearchAction.START
        if searches or (call.command == Command.SAP and call.type == AxisParameter.ACTUAL_POSITION):
            return Referencing(str(call.motor) if self.state.motors > 1 else "", searches)
        return None

    def status(self) -> Procedure[tuple[str, ...]]:
        state = self.state
        lines = []
        for motor in range((yield from motors(state))):
            parts = []
            for name, parameter in (
                ("position", AxisParameter.ACTUAL_POSITION),
                ("target", AxisParameter.TARGET_POSITION),
                ("velocity", AxisParameter.ACTUAL_VELOCITY),
            ):
                parts.append(f"{name} {(yield from read(state, TmclCall(Command.GAP, parameter, motor)))}")
            for name, parameter in (
                ("left", AxisParameter.LEFT_SWITCH),
                ("right", AxisParameter.RIGHT_SWITCH),
                ("home", AxisParameter.HOME_SWITCH),
            ):
                try:
                    closed = yield from read(state, TmclCall(Command.GAP, parameter, motor))
                except Refused:  # not every module has each switch
                    continue
                parts.append(f"{name} switch {'on' if closed else 'off'}")
            lines.append(f"motor {motor}: {', '.join(parts)}")
        return tuple(lines)

    def _remark(self, call: TmclCall) -> None:
        """Tell a person that the module is reached in another way from now on; follow it to its new address."""
        state = self.state
        if call.command == Command.SAP and call.type == AxisParameter.RELATIVE_FROM:
            state.relative_read(call.motor, call.value)
        if call.command == Command.FACTORY:
            state.remark(
                f"{who(state)}: factory settings; it may now have address 1 and 9600 baud: open the line again"
            )
        of_module = call.command == Command.SGP and call.motor == 0  # in bank 2 the same numbers are user variables
        if of_module and call.type == Global.BAUD:
            state.remark(f"{who(state)}: its baud code is {call.value} from now on: open the line again with it")
        if of_module and call.type == Global.ADDRESS:
            state.remark(f"{who(state)}: its address is {call.value} from now on: type @{call.value}")
            state.readdressed(call.value)


def mode_of(value: int) -> int:
    """What a program does, in the reply to command 135: all of it, or its upper byte; and in global parameter 128."""
    return value if value in tuple(ProgramStatus) else value >> 24 & 0xFF


SYNC_TRIES = 2
"""The first request may complete an unfinished message in a module."""
IDENTITY = TmclCall(Command.VERSION, Version.BINARY)


def count_line(states: list[TmclState]) -> None:
    """Give the modules of a line the codec that they share: a stop of one motor each is shorter than one of six."""
    codec = Tmcl(tuple((state.address, state.motors) for state in states if state.motors))
    for state in states:
        state.line_counted(codec)


def find(state: TmclState) -> Procedure[bool]:
    """Ask one module for its version and count its motors; whether it replied."""
    for _ in range(SYNC_TRIES):
        reply = yield state.codec.request(state.address, "136 1, 0, 0", IDENTITY)
        damaged = reply.end is End.REFUSED and int(reply.text) == Status.WRONG_CHECKSUM
        if reply.end in (End.DONE, End.REFUSED) and not damaged:
            break
    else:
        return False
    if reply.end is End.DONE:
        number = int(reply.text) & 0xFFFFFFFF
        state.identified(f"TMCM-{number >> 16}", f"{number >> 8 & 0xFF}.{number & 0xFF:02}")
    else:
        state.identified("TMCL module", "")
    reply = yield state.codec.request(state.address, "135 0, 0, 0", PROGRAM)
    if reply.end is End.DONE and mode_of(int(reply.text)) == ProgramStatus.STORES:
        yield from end_download(state, "found in download mode")
    try:
        yield from motors(state)
        if state.programming:  # it stores what it is asked, and does not know that question
            state.executes()
            state.owes_nothing()
            state.motors_counted(0)
            yield from end_download(state, "found in download mode, where it stored one command more")
            yield from motors(state)
    except NoAnswer as error:
        state.note(f"{who(state)}: its motors are not counted; a stop is for {MOST_MOTORS} ({error})")
    return True


def end_download(state: TmclState, why: str) -> Procedure[None]:
    yield state.codec.request(state.address, END, TmclCall(Command.END_DOWNLOAD))
    state.note(f"{who(state)}: {why}; it was ended with 133: check the program in the module")


class TmclCertifying(Certifying):
    """The questions of a certificate to a TMCL module."""

    state: TmclState

    module = __file__
    reads = "GAP {}"
    writes = "SAP {}, {}"
    refused = "status {code}"

    def masked(self, raw: bytes) -> str:
        return raw[2:-1].hex(" ")


"""A refused command runs nothing in a module. Replies are shown without their two addresses and their checksum."""
