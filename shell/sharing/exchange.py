"""The rules for the writer of a shared port, without clock and sockets. Bytes and times in, actions out.

The first client to write is the writer, until it leaves or is silent for ten seconds. Bytes of another one are refused,
and its connection is closed. A stop passes from any client, before what waits: those bytes are dropped. Every client is
sent what the drives send.
"""

from __future__ import annotations

from dialects.visible import visible
from shell.sharing.actions import Action, Close, Purge, Say, Send, Set, Stop, Write
from shell.sharing.client import Client, Request
from shell.sharing.half_line import ENDS, HalfLine
from shell.sharing.stop_bytes import StopBytes
from transports.com_port import FLOW, FLOW_IN, GROUPS, NEEDED, PURGE_RECEIVED, Control, Setting, group_of

SILENT = 10.0
"""Seconds of silence after which another client may write."""
_ASKS = (Control.ASK_FLOW, Control.ASK_BREAK, Control.ASK_DTR, Control.ASK_RTS, Control.ASK_FLOW_IN)


class Exchange:
    """The clients of a port, by number."""

    def __init__(self, stops: StopBytes, baud: int) -> None:
        self.clients: dict[int, Client] = {}
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
        self._line = HalfLine(stops.framed)
        self._before: int | None = None
        """The last writer."""
        self._away = ""
        """The reason why the port is lost; empty: it is open."""
        self._actions: list[Action] = []

    @property
    def deadline(self) -> float | None:
        """The time at which the writer has been silent for long enough."""
        return None if self.writer is None else self._last + SILENT

    # Clients

    def connect(self, client: int, name: str) -> list[Action]:
        """Take a client."""
        self.clients[client] = Client(name, not self.framed)
        self._say(client, "connected")
        return self._done()

    def leave(self, client: int) -> list[Action]:
        """Forget a client whose connection has ended."""
        if client in self.clients:
            self._say(client, "left")
            self._free(client)
            del self.clients[client]
        return self._done()

    def close(self, client: int, event: str, reason: str) -> list[Action]:
        """Close a client's connection, with the reason."""
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
        """Let another client write once the writer has been silent for long enough."""
        self._release(now)
        return self._done()

    def _release(self, now: float) -> None:
        if self.writer is not None and now >= self._last + SILENT:
            self._say(self.writer, "silent", "another client may write")
            self.writer = None

    def lose(self, reason: str) -> list[Action]:
        """Close all connections: the port is lost. Until `back`, a client is closed as soon as it sends anything."""
        self._away = reason
        for client in tuple(self.clients):
            self._close(client, "lost", reason)
        return self._done()

    def back(self) -> None:
        """Take clients again."""
        self._away = ""

    # From the drives

    def printed(self, data: bytes) -> list[Action]:
        """Send bytes of the drives to every client."""
        for number, client in self.clients.items():
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
        for each in known.receive(data):
            if self._away:
                continue
            if isinstance(each, Request):
                self._request(client, each)
            else:
                self._bytes(client, each, now)
        if self._away:
            self._close(client, "lost", self._away)
        if not known.refused and (replies := known.taken()):
            self._actions.append(Send(client, replies))
        return self._done()

    def _bytes(self, client: int, data: bytes, now: float) -> None:
        before, stop, rest = self._stops.found(data)
        others = self.writer is not None and client != self.writer
        if stop and not others and self._stops.binary(data):
            before, stop, rest = data, b"", b""
        if stop:
            self._actions.append(self._stop(stop, others))
            self._say(client, "stop", _text(stop))
            if others:
                before, rest = before.strip(ENDS), rest.strip(ENDS)
            elif lost := len(data) - len(stop) - len(rest):
                self._say(client, "unsent", f"{lost} bytes that came with a stop were dropped")
                before = b""
        for each in filter(None, (before, rest)):
            self._write(client, each, now)

    def stop(self, stop: bytes) -> list[Action]:
        """Write a stop of this side."""
        return [self._stop(stop, True), Say("this terminal", "stop", _text(stop))]

    def _stop(self, stop: bytes, others: bool) -> Stop:
        """Make the action of a stop. Within a line of another client it first makes that line harmless.

        A PMX would take both for one command.
        """
        cut, mended = self._line.stopped(others), self._stops.mended(stop)
        return Stop(mended if cut and not self._stops.binary(cut) else stop, mended)

    def _write(self, client: int, data: bytes, now: float) -> None:
        known = self.clients[client]
        if known.refused:
            return
        if self.writer is None:
            self._begin(client)
        elif client != self.writer:
            name = self.clients[self.writer].name
            self._close(client, "refused", f"{name} writes, until it leaves or is silent for {SILENT:g} s")
            return
        self._last = now
        if data := self._line.rest(data):
            self._line.written(data)
            self._actions.append(Write(client, data))

    def _begin(self, client: int) -> None:
        """Make a client the writer. What another one has begun, and this one's first end of a line would execute, ends
        harmlessly.
        """
        if client != self._before:
            if self._stops.moves(self._line.text):
                self._say(client, "unfinished", f"'{_text(self._line.text)}' of the writer before is made harmless")
                self._actions.append(Write(client, self._stops.invalidate))
            self._line.ended()
        self._line.begin_writer()
        self.writer, self._before = client, client
        self._say(client, "writes")

    def dropped(self, count: int) -> list[Action]:
        """Note the number of bytes of the writer that a stop or a purge has dropped."""
        if count:
            self._line.dropped()
            who = self.clients[self.writer].name if self.writer is not None else ""
            self._actions.append(Say(who, "unsent", f"{count} bytes that had not left were dropped"))
        return self._done()

    # Settings

    def _request(self, client: int, request: Request) -> None:
        known = self.clients[client]
        if known.refused:
            return
        if request.setting == Setting.PURGE:
            if client == self.writer and request.value != PURGE_RECEIVED:
                self._actions.append(Purge())
            known.reply(request.setting, request.value)
        elif request.setting == Setting.BAUD:
            self._change(client, "baud", request, request.value > 0)
        elif request.setting == Setting.CONTROL:
            if what := group_of(request.value):
                changes = what not in (FLOW, FLOW_IN) and request.value not in _ASKS
                self._change(client, what, request, changes)
        else:
            known.reply(request.setting, NEEDED[Setting(request.setting)])

    def _change(self, client: int, what: str, request: Request, changes: bool) -> None:
        """Change a setting if this client may, or reply with what holds."""
        holds = self.values[what]
        if not changes or request.value == holds:
            self.clients[client].reply(request.setting, holds)
        elif self._may_set(client):
            self._actions.append(Set(client, request.setting, request.value))
        else:
            self._say(client, "setting refused", f"another client has set {what} to {_shown(what, holds)}")
            self.clients[client].reply(request.setting, holds)
        if what == "baud" and self.writer is None and self._setter is None:
            self._setter = client

    def _may_set(self, client: int) -> bool:
        return client in (self.writer, self._setter) or (self.writer is None and self._setter is None)

    def applied(self, client: int, setting: int, value: int, trouble: str = "") -> list[Action]:
        """Note a setting that was changed, or could not be (`trouble`), and reply with what holds."""
        what = "baud" if setting == Setting.BAUD else group_of(value)
        if not trouble:
            self.values[what] = value
        if (known := self.clients.get(client)) is not None:
            detail = trouble or f"{what} is {_shown(what, value)}"
            self._say(client, "setting refused" if trouble else "setting", detail)
            known.reply(setting, self.values[what])
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
