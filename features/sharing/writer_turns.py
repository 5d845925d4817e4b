"""The rules for the writer of a shared port, without clock and sockets. Bytes and times in, actions out.

The first client to write is the writer, until it leaves or is silent for ten seconds. Bytes of another one are refused,
and its connection is closed. A stop passes from any client, before what waits: those bytes are dropped. Every client is
sent what the drives send. No drive executes a line of which two clients have written a part: what one has begun is made
harmless before the next one writes, and the rest of it is dropped.

A stop that the drives may not have received, because the port is lost, is owed: it is the first thing written once the
port is back.
"""

from __future__ import annotations

from dataclasses import dataclass

from multidrop.base.text import counted, visible
from multidrop.drives.half_line import HalfLine
from multidrop.features.sharing.client import ClientRequest, ClientStream, Input
from multidrop.features.sharing.settling import Settling
from multidrop.features.sharing.stop_bytes import ENDS, NOTICED, OwedStop, StopBytes
from multidrop.transports.telnet import FLOW, FLOW_IN, GROUPS, NEEDED, PURGE_RECEIVED, Control, Setting, group_of


@dataclass(frozen=True)
class Send:
    """Send bytes to a client."""

    client: int
    data: bytes


@dataclass(frozen=True)
class Close:
    """Close a client's connection, after the bytes that give the reason."""

    client: int
    farewell: bytes


@dataclass(frozen=True)
class ClientWrite:
    """Write bytes to the port, for a client."""

    client: int
    data: bytes


@dataclass(frozen=True)
class Stop:
    """Drop what the port has not sent, and write a stop: `mended` where something was dropped."""

    data: bytes
    mended: bytes


@dataclass(frozen=True)
class Purge:
    """Drop what the port has not sent."""


@dataclass(frozen=True)
class Set:
    """Change a setting of the port for a client; `applied` follows."""

    client: int
    setting: int
    value: int


@dataclass(frozen=True)
class Say:
    """Report an event to a person: the client, the event, and more about it."""

    client: str
    event: str
    detail: str = ""


Action = Send | Close | ClientWrite | Stop | Purge | Set | Say


WRITER_TIMEOUT = 10.0
"""Seconds of silence after which another client may write."""
WRITES_A_TURN = 8
"""The requests and writes of one client that are worked off before the others are read."""
WAITING = 1024
"""The requests and writes that may wait for one client."""
NOT_REACHED = "NOT REACHED"
OWED = "the stop is written first once the port is back; until then drives may run on"
NEVER = "the stop is never written, drives may run on: stop them at the machine"
_ASKS = (Control.ASK_FLOW, Control.ASK_BREAK, Control.ASK_DTR, Control.ASK_RTS, Control.ASK_FLOW_IN)


class PortClients:
    """The clients of a port, by number."""

    def __init__(self, stops: StopBytes, baud: int) -> None:
        self.clients: dict[int, ClientStream] = {}
        self.writer: int | None = None
        self.framed = stops.framed
        self.values: dict[str, int] = {
            "baud": baud,
            FLOW: Control.NO_FLOW,
            FLOW_IN: Control.NO_FLOW_IN,
            "break": Control.BREAK_OFF,
            "DTR": Control.DTR_ON,
            "RTS": Control.RTS_ON,
        }
        """The settings of the port."""
        self._stops = stops
        self._last = 0.0
        """The time at which the writer wrote last."""
        self._setter: int | None = None
        """The client that has set the baud rate while there was no writer."""
        self._line = HalfLine(stops.ends)
        self.settling = Settling()
        self._before: int | None = None
        """The last writer."""
        self._answered = True
        """The drives have sent something since the last bytes were written."""
        self._away = ""
        """The reason why the port is lost; empty: it is open."""
        self.owed = OwedStop(stops.own)
        self._actions: list[Action] = []

    @property
    def line_begun(self) -> bool:
        """Whether the drives hold the beginning of a client's line. From any thread."""
        return bool(self._line.text)

    @property
    def deadline(self) -> float | None:
        """The time of the next `advance`: 0.0 while clients wait for a turn, else when the writer has been silent."""
        if any(client.waiting and not client.setting for client in self.clients.values()):
            return self.settling.until
        return None if self.writer is None else self._last + WRITER_TIMEOUT

    # Clients

    def connect(self, client: int, name: str) -> list[Action]:
        self.clients[client] = ClientStream(name, not self.framed, self._stops.size)
        self._say(client, "connected")
        return self._done()

    def leave(self, client: int) -> list[Action]:
        if client in self.clients:
            if self.writer in (None, client):
                for item in self.clients[client].waiting:
                    if isinstance(item, bytes):
                        self._write(client, item, self._last, gone=True)
            self._unsent(
                client, self.clients[client].parts.forgotten(), "the beginning of a message", "its client left"
            )
            self._say(client, "left")
            self._free(client)
            del self.clients[client]
        return self._done()

    def close(self, client: int, event: str, reason: str) -> list[Action]:
        self._close(client, event, reason)
        return self._done()

    def _close(self, client: int, event: str, reason: str) -> None:
        known = self.clients[client]
        if not known.refused:
            known.refused = True
            self._say(client, event, reason)
            self._actions.append(Close(client, known.taken() + known.farewell(f"{event}: {reason}")))
            self._free(client)

    def _free(self, client: int) -> None:
        if self.writer == client:
            self.writer = None
        if self._setter == client:
            self._setter = None

    def advance(self, now: float) -> list[Action]:
        """Give each client a turn, and let another one write once the writer has been silent for long enough."""
        for client in tuple(self.clients):
            self._work(client, now)
        self._release(now)
        return self._done()

    def _release(self, now: float) -> None:
        if self.writer is not None and now >= self._last + WRITER_TIMEOUT:
            self._say(self.writer, "silent", "another client may write")
            self.writer = None

    # A lost port

    def lose(self, reason: str, now: float, returns: bool = True) -> list[Action]:
        """Close all connections: the port is lost. Until `back`, a client is closed as soon as it sends anything.

        `returns`: the port has a stable name. What was written shortly before may have left in part.
        """
        self._away = reason
        if not self._answered and now < self._last + NOTICED:
            self._line.doubted(now)
        self.owed.lost(now)
        outcome = OWED if returns else NEVER
        for name in self.owed.names:
            self._actions.append(Say(name, NOT_REACHED, f"the stop may not have left before the loss; {outcome}"))
        for client in tuple(self.clients):
            self._close(client, "lost", f"{reason}; {NOT_REACHED}: {outcome}" if self.owed.names else reason)
        return self._done()

    def back(self) -> None:
        """Take clients again; the stop that is owed comes before anything else."""
        self._away = ""

    # From the drives

    def printed(self, data: bytes, now: float) -> list[Action]:
        """Send bytes of the drives to every client."""
        if not self._away:
            self.owed.received(now)
            self._answered = True
            self._line.replied(data)
        settles = bool(self.settling.until)
        if settles:
            self.settling.took(data, now)
        for number, client in self.clients.items():
            if settles and number == self.writer:
                continue
            if not client.refused and (sent := client.data(data)):
                self._actions.append(Send(number, sent))
            elif client.overflowed:
                self._close(number, "dropped", "it suspended the flow for too long")
        return self._done()

    # From a client

    def receive(self, client: int, data: bytes, now: float) -> list[Action]:
        """Take bytes that a client has sent."""
        self._release(now)
        known = self.clients[client]
        for item in known.receive(data):
            known.waiting.extend([item] if isinstance(item, ClientRequest) else self._without_stops(client, item, now))
        if self._away:
            stopped = known.name in self.owed.names
            self._close(client, "lost", f"{self._away}; {NOT_REACHED}: {OWED}" if stopped else self._away)
        elif len(known.waiting) > WAITING:
            self._close(client, "dropped", f"it did not wait for the replies to {WAITING} requests")
        self._work(client, now)
        return self._done()

    def _without_stops(self, client: int, data: bytes, now: float) -> list[Input]:
        """Take the stops out of bytes, and write them at once; return what is left for the client's turn."""
        known, others = self.clients[client], self.writer is not None and client != self.writer
        begun, known.begun = known.begun, b""
        if not self._stops.keyed(data):  # it may end a stop; a letter before a key that stops all names no drive
            begun, data = b"", begun + data
            if others or self._away:
                data, known.begun = self._stops.whole(data)
        before, stop, rest = self._stops.found(data)
        before = begun + before
        if not data:
            return []
        if not stop or (not others and not self._away and self._stops.binary(data)):
            return [data]
        self.owed.note(known.name, stop, now)
        if self._away:
            self._say(client, NOT_REACHED, f"the port is lost; {OWED}")
            return []
        self._unsent(client, known.parts.forgotten(), "the beginning of a message", "a stop came")
        self._stop(stop, others or client != self._before, now)
        self._say(client, "stop", _text(stop))
        if others:
            before, rest = before.strip(ENDS), rest.strip(ENDS)
        elif lost := len(data) - len(stop) - len(rest):
            self._say(
                client,
                "unsent",
                f"{counted(lost, 'byte that came with a stop was', 'bytes that came with a stop were')} dropped",
            )
            before = b""
        return [part for part in (before, rest) if part]

    def stop(self, stop: bytes, now: float, owed: bool = False) -> list[Action]:
        """Write a stop of this side, or one that was `owed`: the loss may have cut a line, which it makes harmless."""
        who = ", ".join(self.owed.names) if owed else "this terminal"
        if owed:
            self.owed.written(now)
        else:
            self.owed.note(who, b"", now)
        if self._away:
            self._actions.append(Say(who, NOT_REACHED, f"the port is lost; {OWED}"))
        else:
            self._stop(self._stops.mended(stop) if owed else stop, True, now)
            self._actions.append(Say(who, "stop", _text(stop) + ", owed since the loss of the port" * owed))
        return self._done()

    def _stop(self, stop: bytes, others: bool, now: float) -> None:
        """Stop, and drop the bytes that wait for their client's turn. `others`: not by who has begun the line.

        Within a line of another client it first makes that line harmless: a drive may take both for one command.
        """
        waited = {number: client.overtaken() for number, client in self.clients.items()}
        if others and self.writer is not None:
            waiting = dict(self._line.open)  # the bytes that a stop overtakes are not written
            self._line.written(waited[self.writer], now)
            self._line.open = waiting
        cut, mended = self._line.text if others else b"", self._stops.mended(stop)
        mends = bool(cut) and not self._stops.binary(cut[:-1])  # its last byte may be a check byte
        self._actions.append(Stop(mended if mends else stop, mended))
        if cut:
            self._drop_rest()
        if mends or self._stops.ends_line(stop):
            self._line.overflowed()
        for number, data in waited.items():
            if data:
                unsent = counted(len(data), "byte that came before a stop was", "bytes that came before a stop were")
                self._say(number, "unsent", f"{unsent} dropped")

    def _drop_rest(self) -> None:
        """Drop the rest of the line that the last writer has begun, should it still come."""
        if self._before in self.clients:
            self.clients[self._before].rest.dropping = True

    def _unsent(self, client: int, data: bytes, what: str, why: str) -> None:
        if data:
            self._say(client, "unsent", f"{what} ({_text(data)}) was dropped, as {why}")

    def _work(self, client: int, now: float) -> None:
        """Work off a few requests and writes of a client: the others are read after that."""
        known, left = self.clients[client], WRITES_A_TURN
        while known.waiting and left and not known.setting:
            item, left = known.waiting.popleft(), left - 1
            done = (
                self._request(client, item, now) if isinstance(item, ClientRequest) else self._write(client, item, now)
            )
            if not done:
                known.waiting.appendleft(item)
                break
        if not known.refused and (replies := known.taken()):
            self._actions.append(Send(client, replies))

    def _write(self, client: int, data: bytes, now: float, gone: bool = False) -> bool:
        """Write bytes; return False where they must wait for the drives. `gone`: the client hears no reply."""
        known = self.clients[client]
        if known.refused:
            return True
        if self.writer is None:
            self._begin(client, now)
        elif client != self.writer:
            name = self.clients[self.writer].name
            self._close(client, "refused", f"{name} writes, until it leaves or is silent for {WRITER_TIMEOUT:g} s")
            return True
        self._last = now
        if not (gone or self._settled(client, now)):
            return False
        left = known.rest.left(data)
        self._unsent(client, data[: len(data) - len(left)], "the rest of a line", "its beginning was made harmless")
        if left := known.parts.whole(left):
            if any(map(self._stops.moves, self._line.written(left, now))):
                self.owed.started()
            self._actions.append(ClientWrite(client, left))
            self._answered = False
        return True

    def _settled(self, client: int, now: float) -> bool:
        """Whether the drives have replied to what made a line harmless; the writer was not sent that, so it is said."""
        over = self.settling.over(now)
        if over and self.settling.heard:
            self._say(client, "unfinished", f"the drives' reply was not passed on: '{_text(self.settling.heard)}'")
            self.settling.heard = b""
        return over

    def _begin(self, client: int, now: float) -> None:
        """Make a client the writer. What another one has begun, and this one's first end of a line would execute, ends
        harmlessly.
        """
        if client != self._before:
            if self._line.begun:
                self._end_harmlessly(client, now)
            if (before := self.clients.get(self._before or 0)) is not None:
                self._unsent(self._before or 0, before.parts.forgotten(), "the beginning of a message", "others write")
        self.writer, self._before = client, client
        self._say(client, "writes")

    def _end_harmlessly(self, client: int, now: float) -> None:
        text = _text(self._line.text) or "a line that no drive has replied to"
        stops = "; it may hold commands that only a stop drops, so the drives were stopped" * self._line.waits
        self._say(client, "unfinished", f"'{text}' of the writer before is made harmless{stops}")
        harmless = self._stops.harmless(self._line.waits)
        self._actions.append(ClientWrite(client, harmless))
        self.settling.begin(now, len(harmless), self.values["baud"])
        if self._line.text:
            self._drop_rest()
        self._line.cleared()

    def over(self) -> list[Action]:
        """Make harmless what was begun: sharing ends, and others use the port then."""
        if self._line.begun and not self._away:
            self._actions.append(ClientWrite(self._before or 0, self._stops.harmless(self._line.waits)))
            self._line.cleared()
        return self._done()

    def unwritten(self, now: float) -> None:
        """Note that bytes of the last `ClientWrite` were not written."""
        self._line.doubted(now)

    def dropped(self, count: int, purged: bool = False, now: float = 0.0) -> list[Action]:
        """Note that the port has dropped so many bytes; `purged`: nothing that makes a line harmless follows."""
        if count:
            if purged:
                self._line.doubted(now)
            who = self.clients[self.writer].name if self.writer is not None else ""
            self._actions.append(
                Say(
                    who,
                    "unsent",
                    f"{counted(count, 'byte that had not left was', 'bytes that had not left were')} dropped",
                )
            )
        return self._done()

    # Settings

    def _request(self, client: int, request: ClientRequest, now: float) -> bool:
        """Answer a request; return False where it must wait for the drives."""
        known = self.clients[client]
        if known.refused or known.answers(request):
            return True
        if request.setting == Setting.PURGE:
            if client == self.writer and request.value != PURGE_RECEIVED:
                self._actions.append(Purge())
            known.reply(request.setting, request.value)
        elif request.setting == Setting.BAUD:
            return self._change(client, "baud", request, request.value > 0, now)
        elif request.setting == Setting.CONTROL:
            if what := group_of(request.value):
                changes = what not in (FLOW, FLOW_IN) and request.value not in _ASKS
                return self._change(client, what, request, changes, now)
        else:
            known.reply(request.setting, NEEDED[Setting(request.setting)])
        return True

    def _change(self, client: int, what: str, request: ClientRequest, changes: bool, now: float) -> bool:
        """Change a setting if this client may, or reply with what holds; False where that must wait for the drives.

        At another baud rate the drives would not read what makes a begun line harmless, so that goes first.
        """
        holds = self.values[what]
        if not changes or request.value == holds:
            self.clients[client].reply(request.setting, holds)
        elif client in (self.writer, self._setter) or (self.writer is None and self._setter is None):
            if what == "baud" and (self._line.text or (self._line.begun and client != self._before)):
                self._end_harmlessly(client, now)
            if not self._settled(client, now):
                return False
            self.clients[client].setting = True
            self._actions.append(Set(client, request.setting, request.value))
        else:
            self._say(client, "setting refused", f"another client has set {what} to {_shown(what, holds)}")
            self.clients[client].reply(request.setting, holds)
        if what == "baud" and self.writer is None and self._setter is None:
            self._setter = client
        return True

    def applied(self, client: int, setting: int, value: int, trouble: str = "") -> list[Action]:
        """Note a setting that was changed, or could not be (`trouble`), and reply with what holds."""
        what = "baud" if setting == Setting.BAUD else group_of(value)
        if not trouble:
            self.values[what] = value
        if (known := self.clients.get(client)) is not None:
            detail = trouble or f"{what} is {_shown(what, value)}"
            self._say(client, "setting refused" if trouble else "setting", detail)
            known.reply(setting, self.values[what])
            known.setting = False
            if not known.refused:
                self._actions.append(Send(client, known.taken()))
        return self._done()

    # Actions

    def _say(self, client: int, event: str, detail: str = "") -> None:
        self._actions.append(Say(self.clients[client].name, event, detail))

    def _done(self) -> list[Action]:
        actions, self._actions = self._actions, []
        return actions


def _shown(what: str, value: int) -> str:
    if what == "baud":
        return f"{value}"
    return "off" if value == GROUPS[what][-1] else "on"


def _text(stop: bytes) -> str:
    return visible(stop.decode("latin-1"))
