"""TMCL as a dialect: nine bytes out, nine bytes in, the stop, and the host's knowledge of one module.

Theory of operation. A frame is nine bytes: four of one byte, a value of four, a checksum. A reply repeats the address
of its module and its command, not its type or motor. The codec passes over whole frames with another address or command
as late; `exchange` finds out whether a reply with the right ones is late. A wrong checksum, in a reply or reported by a
module, means that the count of nine may be lost: the request then ends after a second of silence, in which host and
modules drop an unfinished message. A stop is repeated after it too.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from struct import Struct
from typing import ClassVar, NamedTuple

from multidrop.base.errors import Inexpressible
from multidrop.dialects.codec import Codec, Decoded, End, Kind, Reply, Request, Started, StopPiece
from multidrop.dialects.state import DriveState, Owed
from multidrop.families.tmcl.manual import commands
from multidrop.families.tmcl.manual.commands import Command, MoveType, SearchAction, Status, TmclCall, Version, accepted
from multidrop.families.tmcl.manual.instructions import spelled

LENGTH = 9
_FIELDS = Struct(">BBBBi")
_TEXT = frozenset(b"\r\n\t" + bytes(range(0x20, 0x7F)))


class ReplyFrame(NamedTuple):
    """A reply: addresses of host and module, status, the command that it repeats, and a value."""

    host: int
    module: int
    status: int
    command: int
    value: int


def frame_of(address: int, call: TmclCall) -> bytes:
    return _sealed(_FIELDS.pack(address, call.command, call.type, call.motor, call.value))


def parse_reply(frame: bytes) -> ReplyFrame | None:
    """The fields of a reply; None where its checksum is wrong."""
    return ReplyFrame(*_FIELDS.unpack(frame[:-1])) if _sealed(frame[:-1]) == frame else None


def line_in(frame: bytes) -> TmclCall:
    """The stored line in the reply to command 134: it has the places of module, status, command and value."""
    _, *fields = _FIELDS.unpack(frame[:-1])
    return TmclCall(*fields)


def call_of(frame: bytes) -> tuple[int, TmclCall]:
    address, command, kind, motor, value = _FIELDS.unpack(frame[:-1])
    return address, TmclCall(command, kind, motor, value)


def replies_in(data: bytes) -> tuple[str, ...]:
    """The addresses of modules whose replies are in these bytes, wherever one begins; plain text holds none."""
    frames = {}
    for at in range(len(data) - LENGTH + 1):
        fields = parse_reply(data[at : at + LENGTH])
        if fields is None or fields.status not in tuple(Status) or all(byte in _TEXT for byte in data[at : at + 8]):
            continue
        if fields.module and (fields.command in tuple(Command) or not accepted(fields.status)):
            frames[str(fields.module)] = True
    return tuple(frames)


def moves(frames: bytes) -> bool:
    """Whether requests can start a motion or a program; a part of one may belong to any."""
    pieces = [frames[at : at + LENGTH] for at in range(0, len(frames), LENGTH)]
    return any(len(piece) < LENGTH or call_of(piece)[1].moves for piece in pieces)


def _sealed(body: bytes) -> bytes:
    return body + bytes([sum(body) % 256])


FACTORY = "1"
"""The address of a new module."""
ADDRESSES = frozenset(str(number) for number in range(1, 256))
MOST_MOTORS = 6
"""Motors of the largest module; a module whose motors are not counted may have as many."""
WRONG_CHECKSUM = str(int(Status.WRONG_CHECKSUM))
STOP_PIECE_QUIET = 0.03
"""Seconds of quiet after each frame of a stop: its reply must not run into the next frame."""
RESYNC = 1.0
"""Seconds of silence after which a module has dropped an unfinished message."""
NO_REPLY_QUIET = 0.1
"""Seconds of quiet that end a request without a reply."""

STOP_BYTES = re.compile(rb"[\x01-\xff](?:\x03\x00[\x00-\x05]|\x0d\x01[\x00-\x05]|[\x80\x85]\x00\x00)\x00{4}[\x00-\xff]")
"""Each frame of a stop for any module, with any checksum: a module refuses a wrong one."""
STOPS = frozenset({Command.MST, Command.STOP_PROGRAM, Command.END_DOWNLOAD, Command.RFS})
"""The commands of a stop."""
REPORTED = re.compile(r"module \d+: target reached")
STORED_STOP = re.compile(r"module (\d+): in download mode: the stop was stored as a line of its program")


@dataclass(frozen=True)
class Tmcl(Codec):
    """The modules of a line. `motors`: how many each has, by address, where that was counted."""

    motors: tuple[tuple[str, int], ...] = ()
    storing: bool = False
    """The module is in download mode: a stop ends that first."""
    family: ClassVar[str] = "tmcl"
    framed: ClassVar[bool] = True
    stop_replies: ClassVar[bool] = True
    spares: ClassVar[bool] = True
    stop_debris: ClassVar[re.Pattern[str]] = re.compile(r"heard .*")

    def request(self, address: str, text: str, call: TmclCall) -> Request:
        """The request for a command; `text` is what it means to a person. Raises Inexpressible."""
        kind = Kind.QUIET if call.command == Command.FACTORY else Kind.PRINT if call.prints else Kind.COMMAND
        return Request(address, text, kind, self, body=frame_of(number_of(address), call))

    def encode(self, request: Request) -> bytes:
        return request.body

    def replied(self, sent: bytes, received: bytes) -> bool | None:
        """By address and command of a frame; a text in reply to one has neither."""
        if len(sent) != LENGTH or sum(sent[:-1]) & 0xFF != sent[-1]:
            return None
        frames = (received[at : at + LENGTH] for at in range(len(received) - LENGTH + 1))
        return any(frame[1] == sent[0] and frame[3] == sent[1] for frame in frames) or None

    def decode(self, request: Request, buffer: bytes) -> Decoded | None:
        """The first reply with the address and the command of the request; None while the count of nine may be lost."""
        decoded = self._reply_in(request, buffer)
        doubtful = decoded is not None and decoded.reply.end is End.REFUSED and decoded.reply.text == WRONG_CHECKSUM
        return None if doubtful else decoded

    def _reply_in(self, request: Request, buffer: bytes) -> Decoded | None:
        address, call = call_of(request.body)
        as_text = call.command == Command.VERSION and call.type == Version.TEXT
        strays: list[str] = []
        for at in range(0, len(buffer) - LENGTH + 1, LENGTH):
            frame, end = buffer[at : at + LENGTH], at + LENGTH
            if as_text and all(0x20 <= byte < 0x7F for byte in frame[1:]):  # it has no checksum
                return Decoded(Reply((frame[1:].decode("ascii"),), acknowledged=True, body=frame), end, tuple(strays))
            fields = parse_reply(frame)
            if fields is None:
                return None
            own = (fields.module, fields.command) == (address, call.command)
            if call.command == Command.READ_PROGRAM and not own and fields.command != Command.NOTIFY:
                line = spelled(line_in(frame))
                return Decoded(Reply((line,), acknowledged=True, body=frame), end, tuple(strays))
            if not own or fields.status == Status.TARGET_REACHED:
                strays.append(_described(fields))
                continue
            if request.gather:  # a refusal proves as much as a value
                reply = Reply((*strays, str(fields.value)), acknowledged=True, body=frame)
            elif not accepted(fields.status):
                reply = Reply((str(fields.status),), End.REFUSED, body=frame)
            else:
                lines = (str(fields.value),) if request.kind is Kind.PRINT else ()
                reply = Reply(lines, acknowledged=True, body=frame)
            return Decoded(reply, end, tuple(strays))
        return None

    def on_timeout(self, request: Request, buffer: bytes) -> Decoded:
        """TIMEOUT, or DAMAGED where bytes came; or the refusal of a damaged request."""
        refused = self._reply_in(request, buffer)
        if refused is not None:
            return refused
        if not buffer:
            return Decoded(Reply(end=End.TIMEOUT), 0)
        return Decoded(Reply(end=End.DAMAGED, detail=f"heard {buffer[:16].hex(' ')}"), len(buffer))

    def quiet_time(self, request: Request, buffer: bytes) -> float:
        """Seconds of quiet that end a request without a reply; others are given that long at least."""
        return (request.settle or NO_REPLY_QUIET) if request.kind is Kind.QUIET else RESYNC

    def parse_unsolicited(self, buffer: bytes) -> tuple[tuple[str, ...], int]:
        """Late replies and reached targets, a line each; replies to a stop give none."""
        used = len(buffer) - len(buffer) % LENGTH
        lines = []
        for at in range(0, used, LENGTH):
            frame = buffer[at : at + LENGTH]
            fields = parse_reply(frame)
            if fields is None:
                lines.append(f"heard {frame.hex(' ')}")
            elif fields.command not in STOPS:
                lines.append(_described(fields))
            elif fields.status == Status.STORED:
                lines.append(f"module {fields.module}: in download mode: the stop was stored as a line of its program")
        return tuple(lines), used

    def printed(self, line: str) -> bool:
        """Whether it is a reached target, which a module reports by itself (command 138)."""
        return REPORTED.match(line) is not None

    def stop(self, addresses: Sequence[str], sure: bool = True, half_sent: bool = False) -> bytes:
        """The first frame: MST for the first motor of the first module, or the end of its download."""
        return self._first(addresses)[0]

    def stop_again(self, addresses: Sequence[str], sure: bool = True) -> Sequence[StopPiece]:
        """The rest, then all once more: a lost byte makes a module swallow the first frame.

        Programs are halted before the motors, which they would start again. One MST for each module goes ahead of that.
        """
        first, whole = self._first(addresses), self._stops(addresses)
        begun = [StopPiece(piece, STOP_PIECE_QUIET) for piece in (*first[1:], *whole)]
        again = [*first, *whole] if self.storing else whole
        return [*begun, StopPiece(again[0], RESYNC), *(StopPiece(piece, STOP_PIECE_QUIET) for piece in again[1:])]

    def _first(self, addresses: Sequence[str]) -> list[bytes]:
        call = TmclCall(Command.END_DOWNLOAD if self.storing else Command.MST)
        return [frame_of(int(name), call) for name in _modules(addresses)]

    def _stops(self, addresses: Sequence[str]) -> list[bytes]:
        """The end of each program; MST for the first motor of each module, then for the second; so for the searches."""
        counted, modules = dict(self.motors), _modules(addresses)
        return [frame_of(int(name), TmclCall(Command.STOP_PROGRAM)) for name in modules] + [
            frame_of(int(name), TmclCall(command, kind, motor))
            for command, kind in ((Command.MST, 0), (Command.RFS, SearchAction.STOP))
            for motor in range(MOST_MOTORS)
            for name in modules
            if motor < counted.get(name, MOST_MOTORS)
        ]

    def hears_stop(self, data: bytes, address: str, sure: bool = True) -> bool:
        """Whether the stop of every motor of this module is in it."""
        return all(stop in data for stop in self._stops([address]) if stop[1] == Command.MST)

    def starts_motion(self, text: str) -> bool:
        """Look the line up in the table of commands; an invalid line may start anything."""
        call = commands.parsed(text)
        return call is None or call.moves

    def started(self, text: str) -> Started:
        call = commands.parsed(text)
        if call is None or call.row is None:
            return Started()
        together = call.command == Command.MVP and call.type == MoveType.COORD
        return Started(None if together else frozenset({str(call.motor)}), program=False, lasts=call.lasts)

    def stop_started(self, address: str, started: Started) -> Sequence[StopPiece]:
        """Return MST for each motor that was started, and the end of its search; with a program the usual stop."""
        if started.program or self.storing:
            return tuple(
                StopPiece(piece, STOP_PIECE_QUIET) for piece in (*self._first([address]), *self._stops([address]))
            )
        [name] = _modules([address])
        motors = range(dict(self.motors).get(name, MOST_MOTORS))
        return tuple(
            StopPiece(frame_of(int(name), TmclCall(command, kind, motor)), STOP_PIECE_QUIET)
            for command, kind in ((Command.MST, 0), (Command.RFS, SearchAction.STOP))
            for motor in motors
            if started.axes is None or str(motor) in started.axes
        )

    def answers(self, request: Request, line: str) -> bool:
        """Whether the line is a reply of this module to a command that only reads."""
        _, call = call_of(request.body)
        return request.kind is Kind.PRINT and line.startswith(
            f"module {request.address}: {late_reply_to(call.command)}:"
        )

    def stored_stop(self, line: str) -> str:
        """The address of a module whose reply to a stop was status 101."""
        match = STORED_STOP.match(line)
        return match[1] if match else ""


def number_of(address: str) -> int:
    """The number in an address. Raises Inexpressible."""
    if address not in ADDRESSES:
        raise Inexpressible(f"no module address '{address}'; valid: 1 to 255")
    return int(address)


def _modules(addresses: Sequence[str]) -> list[str]:
    return [name for name in addresses if name in ADDRESSES] or [FACTORY]


def _described(fields: ReplyFrame) -> str:
    if fields.command == Command.NOTIFY and fields.status == Status.TARGET_REACHED:
        motors = [str(n) for n in range(8) if fields.value >> n & 1]
        return f"module {fields.module}: target reached, motor {', '.join(motors) or 'not named'}"
    return f"module {fields.module}: {late_reply_to(fields.command)}: status {fields.status}, value {fields.value}"


def late_reply_to(command: int) -> str:
    name = Command(command).name if command in tuple(Command) else f"command {command}"
    return f"late reply to {name}"


@dataclass(eq=False)
class TmclState(DriveState):
    """One module."""

    title, unnamed = "module ", "module "

    codec: Tmcl
    lost_commands: set[int] = field(default_factory=set)
    """Commands whose replies did not come, and may come late."""

    motors: int = 0
    """Number of its motors; 0: not counted."""
    search_modes_unknown: set[int] = field(default_factory=set)
    """Motors whose axis parameter 193 was set without success, and neither read nor set since."""
    relative: dict[int, int] = field(default_factory=dict)
    """Axis parameter 127 of each motor: from where MVP REL counts; a motor without an entry: not known."""

    halted: bool = False
    """This session has halted its program between two lines, and has not let it go on."""

    def program_halted(self, halted: bool) -> None:
        self.halted = halted

    def reply_lost(self, command: int) -> None:
        self.lost_commands.add(command)
        self.reply_outstanding()

    def late_again(self, command: int) -> None:
        """Two replies to this command came, sent after all others: only its own and a stop's may still be late."""
        self.lost_commands &= STOPS | {command}

    def proved(self) -> None:
        """The reply to a mark came: all earlier replies are over."""
        self.lost_commands.clear()
        self.synchronised()

    def motors_counted(self, motors: int) -> None:
        self.motors = motors

    def relative_read(self, motor: int, value: int) -> None:
        self.relative[motor] = value

    def relative_forgotten(self) -> None:
        self.relative.clear()

    def counts_may_have_changed(self, restarted: bool = False) -> None:
        """Record it; of a module that was restarted it is not known either from where MVP REL counts."""
        super().counts_may_have_changed(restarted)
        if restarted:
            self.relative_forgotten()

    def search_mode_sent(self, motor: int) -> None:
        self.search_modes_unknown.add(motor)

    def search_mode_known(self, motor: int) -> None:
        self.search_modes_unknown.discard(motor)

    def follows(self, before: DriveState) -> None:
        super().follows(before)
        if isinstance(before, TmclState):
            self.search_modes_unknown |= before.search_modes_unknown

    def readdressed(self, address: int) -> None:
        """The module has another address from now on: requests and stops go there."""
        self.address = self.name = str(address)

    def found_storing(self) -> None:
        """The module is in download mode, or may be: it stores every command but the end of that mode."""
        self.programming, self.codec = True, replace(self.codec, storing=True)
        self.owes(Owed(0, self.name, self.product, self.version, self.part, self.serial))

    def executes(self) -> None:
        self.programming, self.codec = False, replace(self.codec, storing=False)

    def stopped(self) -> None:
        """A stop ends download mode; its replies may be late."""
        self.executes()
        self.halted = False
        self.lost_commands |= STOPS
        self.reply_outstanding()

    def line_counted(self, codec: Tmcl) -> None:
        """Record the codec that all modules of the line share: it has the motors of each."""
        self.codec = codec

    def settings_may_have_changed(self) -> None:
        """Do nothing: no setting changes its replies or its stop, so it is stopped together with the others."""
