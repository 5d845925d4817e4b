"""An MQTT broker: its URL, and a connection to it by paho, which is imported with the first one.

Theory of operation. Each connection is a client of its own: paho's own reconnection gives no reason for a failure. paho
has a thread; its events are handed to the event loop. Every message is sent at QoS 1. Those that the broker has not
acknowledged are known, so that the next connection sends them again. A client that publishes never subscribes. paho
bounds nothing that a broker sends; the socket does (`_Guarded`), before paho makes room for a packet.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
import ssl
import struct
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import unquote, urlsplit

from multidrop.base.errors import Diagnostic
from multidrop.base.files import why
from multidrop.base.on_demand import importing
from multidrop.base.text import visible
from multidrop.features.publishing.login import MqttSettings
from multidrop.shell.threads import in_thread
from multidrop.transports import Unreachable

if TYPE_CHECKING:
    from paho.mqtt.client import Client, MQTTMessageInfo


PORTS = {"mqtt": 1883, "mqtts": 8883}
"""The usual port of each scheme; `mqtts` is encrypted."""
LONGEST_PREFIX = 1000
"""The most bytes of a prefix."""
FORM = "valid: mqtt://[USER@]BROKER[:PORT]/PREFIX or mqtts://..."


@dataclass(frozen=True)
class Target:
    """A broker, and the topic above all that is published."""

    host: str
    port: int
    prefix: str
    encrypted: bool = False
    user: str = ""

    @property
    def text(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{'mqtts' if self.encrypted else 'mqtt'}://{host}:{self.port}/{self.prefix}"


def parse_target(text: str, where: str = "--to") -> Target:
    """Parse the URL of a broker, an argument `where`. Raises Diagnostic, which never holds a password."""
    scheme, mark, rest = text.partition("://")
    place, _, prefix = rest.partition("/")
    user, _, address = place.rpartition("@")
    if ":" in user or (":" in place and "@" in prefix):  # a password may hold a /
        hint = "write it in multidrop.toml: [mqtt] with password or password_file"
        raise Diagnostic("a password in a URL can be seen by everybody on this machine", where, hint)
    if not mark or scheme not in PORTS:
        raise Diagnostic("the URL of a broker begins with mqtt:// or mqtts://", where, FORM)
    host, port = _address(scheme, address, where)
    return Target(host, port, _prefix(prefix, where), scheme == "mqtts", unquote(user))


def _address(scheme: str, address: str, where: str) -> tuple[str, int]:
    try:
        parts = urlsplit(f"//{address}")
        host, port = parts.hostname, parts.port
    except ValueError:
        raise Diagnostic(f"no address {address!r} of a broker", where, FORM) from None
    whole = parts.netloc == address and port != 0
    if not (whole and host) or visible(host) != host or " " in host:
        raise Diagnostic(f"no address {address!r} of a broker", where, FORM)
    return host, port or PORTS[scheme]


def _prefix(text: str, where: str) -> str:
    """Check a prefix, which may have several levels."""
    prefix = text.removesuffix("/")
    if not prefix:
        raise Diagnostic("no PREFIX of the topics", where, FORM)
    wrong = next((character for character in prefix if character in "+#?" or visible(character) != character), "")
    if wrong:
        raise Diagnostic(f"a PREFIX has no {visible(wrong)!s}", where, FORM)
    if prefix.startswith("$") or "" in prefix.split("/"):
        hint = "a PREFIX begins without $, and no level of it is empty"
        raise Diagnostic(f"no PREFIX {prefix!r}", where, hint)
    if len(prefix.encode()) > LONGEST_PREFIX:
        raise Diagnostic(f"a PREFIX has at most {LONGEST_PREFIX} bytes", where)
    return prefix


INSTALL = "pip install 'multidrop[mqtt]'"
KEEPALIVE = 15
"""Seconds; after one and a half of them in silence the broker publishes the will."""
WINDOW = 100
"""Messages that may wait for their acknowledgement."""
TIMEOUT = 15.0
"""The longest time to connect, and to be accepted, s."""
LONGEST_LOGIN = 65535
"""Bytes of a user or a password."""
LEAVE = 1.0
"""The longest time to disconnect, s."""
LARGEST_PACKET = 4 << 20
"""Bytes of a packet from a broker, at most."""
KINDS = {0x20: "CONNACK", 0x30: "PUBLISH at QoS 0", 0x40: "PUBACK", 0x90: "SUBACK", 0xD0: "PINGRESP"}
"""The packets that a broker has a reason to send: none of them waits for a reply of ours, or is kept by paho."""


def load(who: str = "publish") -> Any:
    """Import paho for a command. Raises Diagnostic where it is missing."""
    try:
        with importing():
            from paho.mqtt import client
    except ImportError:
        raise Diagnostic(f"{who} needs paho-mqtt, which is not installed", hint=INSTALL) from None
    return client


def fresh_name() -> str:
    return f"multidrop-{os.urandom(6).hex()}"


class BrokerMessage(NamedTuple):
    """A message for the broker. `bus`: the line that it is about; empty: none."""

    topic: str
    text: str
    retain: bool = False
    bus: str = ""


Take = Callable[[str, bytes, bool], None]
"""Takes a topic, a payload, and whether the message was retained."""


class BrokerConnection:
    """One connection to a broker. `connect` makes it; it ends once, by `close` or by a loss."""

    def __init__(
        self, target: Target, settings: MqttSettings, will: BrokerMessage | None, name: str, take: Take | None = None
    ) -> None:
        """Make a connection that is not connected yet.

        `name`: the client's name. A broker ends an earlier connection of that name first, so its will comes in time.
        `take`: takes, in paho's thread, what is published under the prefix; without it nothing is subscribed to.
        """
        self._target, self._settings, self._will, self._name, self._take = target, settings, will, name, take
        self._where = f"{target.host}:{target.port}"
        self._loop = asyncio.get_running_loop()
        self._accepted: asyncio.Future[None] = self._loop.create_future()
        self._client: Client | None = None
        self._sent: deque[tuple[BrokerMessage, MQTTMessageInfo]] = deque()
        self._full = False
        self.lost = asyncio.Event()
        """Set at the end of the connection."""
        self.refused = ""
        """The packet for which the connection was ended, in a line."""
        self.on_room: Callable[[], None] = lambda: None
        """Called in the event loop once there is room after `publish` has refused a message."""

    async def connect(self) -> None:
        """Connect and log in. Raises Unreachable, and Diagnostic for what the configuration has wrong."""
        connected = False
        try:
            await in_thread(self._begin, TIMEOUT, "broker")
            await asyncio.wait_for(asyncio.shield(self._accepted), TIMEOUT)
            connected = True
        except (OSError, UnicodeError) as error:
            raise Unreachable(_reason(self._where, error)) from None
        finally:
            if not connected:
                await self.close()

    def _begin(self) -> None:
        """Open the socket, and begin the thread. Blocks."""
        paho = load()
        ended = partial(self._call, self._ended)

        class Careful(paho.Client):  # type: ignore[misc, name-defined]
            """A client whose thread ends as with any loss where a broker sends what is not MQTT."""

            def loop_forever(self, *arguments: Any, **named: Any) -> Any:
                try:
                    return super().loop_forever(*arguments, **named)
                except (ValueError, LookupError, TypeError, AttributeError, struct.error, paho.MQTTException):
                    return paho.MQTTErrorCode.MQTT_ERR_PROTOCOL
                finally:
                    ended()

        client = Careful(paho.CallbackAPIVersion.VERSION2, client_id=self._name, reconnect_on_failure=False)
        user, secret = self._target.user or self._settings.username, self._settings.secret()
        if secret and not user:
            raise Diagnostic("mqtt.password needs mqtt.username", hint="or --to mqtt://USER@BROKER/PREFIX")
        if max(len(user.encode()), len(secret.encode())) > LONGEST_LOGIN:
            raise Diagnostic(f"the login is too long; MQTT has room for {LONGEST_LOGIN} bytes")
        if user:
            client.username_pw_set(user, secret or None)
        client.tls_set_context(_context(self._settings) if self._target.encrypted else _Plain())
        if self._will is not None:
            client.will_set(self._will.topic, self._will.text, 1, retain=True)
        if self._take is not None:
            client.on_message = lambda _client, _data, message: self._taken(message)
            client.on_subscribe = lambda _client, _data, _number, reasons, _: self._subscribed(reasons)
        client.on_socket_open = lambda _client, _data, opened: opened.guard(self._refuse)
        client.max_inflight_messages_set(WINDOW)
        client.on_connect = lambda client, _data, _flags, reason, _properties: self._connected(client, reason)
        client.on_disconnect = lambda *_: self._call(self._ended)
        client.on_publish = lambda *_: self._acknowledged()
        client.connect(self._target.host, self._target.port, KEEPALIVE)
        if self.lost.is_set():  # its caller has gone
            client.disconnect()
            return
        client.loop_start()
        self._client = client

    def _call(self, function: Callable[..., None], *arguments: Any) -> None:
        """Call in the event loop, from paho's thread."""
        with contextlib.suppress(RuntimeError):  # the loop was closed meanwhile
            self._loop.call_soon_threadsafe(function, *arguments)

    def _connected(self, client: Client, reason: Any) -> None:
        """Read on, in paho's thread."""
        if reason.is_failure:
            hint = "see username and password under [mqtt]"
            self._call(self._settle, f"the broker at {self._where} refuses the login: {reason}; {hint}")
        elif self._take is not None:
            client.subscribe(f"{self._target.prefix}/#")
        else:
            self._call(self._settle, "")

    def _subscribed(self, reasons: Sequence[Any]) -> None:
        refused = f"the broker at {self._where} does not let us read; its access list has to allow it"
        self._call(self._settle, refused if any(reason.is_failure for reason in reasons) else "")

    def _settle(self, refusal: str) -> None:
        """End the wait of `connect`; `refusal`: why it fails, empty where it does not."""
        if self._accepted.done():
            return
        if refusal:
            self._accepted.set_exception(Unreachable(refusal))
        else:
            self._accepted.set_result(None)

    def _taken(self, message: Any) -> None:
        """Hand on a message, in paho's thread."""
        assert self._take is not None
        with contextlib.suppress(UnicodeDecodeError):  # such a topic is none of ours
            self._take(message.topic, message.payload, message.retain)

    def _refuse(self, what: str) -> None:
        """Note why the connection ends now, in paho's thread."""
        self.refused = f"the broker at {self._where} sent {what}"

    def _ended(self) -> None:
        self.lost.set()
        wants = "it may want cert and key under [mqtt]"
        hint = wants if self._target.encrypted else "mqtts:// is the encrypted form of mqtt://"
        self._settle(self.refused or f"{self._where} hung up before the login; {hint}")

    def _acknowledged(self) -> None:
        """Note an acknowledgement, in paho's thread; wake the loop only where it waits for room."""
        if self._full:
            self._full = False
            self._call(lambda: self.on_room())  # which another function may be by then

    def publish(self, message: BrokerMessage) -> bool:
        """Send a message; False while the connection is full or lost. Never blocks."""
        self._full = True  # before the count, which an acknowledgement may change meanwhile
        if self._client is None or self.lost.is_set() or len(self._unacknowledged()) >= WINDOW:
            return False
        info = self._client.publish(message.topic, message.text, 1, message.retain)
        if info.rc:
            return False
        self._sent.append((message, info))
        self._full = False
        return True

    def _unacknowledged(self) -> deque[tuple[BrokerMessage, MQTTMessageInfo]]:
        """The messages in flight; a broker acknowledges in the order of sending."""
        while self._sent and self._sent[0][1].is_published():
            self._sent.popleft()
        return self._sent

    def in_flight(self) -> list[BrokerMessage]:
        return [message for message, _ in self._unacknowledged()]

    async def close(self) -> None:
        """Disconnect, so that the broker does not publish the will. May be called again."""
        client, self._client = self._client, None
        self.lost.set()
        self._accepted.cancel()
        if client is not None:
            with contextlib.suppress(TimeoutError):
                await in_thread(lambda: _leave(client), LEAVE, "broker")


def _reason(where: str, error: OSError | UnicodeError) -> str:
    if isinstance(error, TimeoutError):
        return f"the broker at {where} does not answer"
    if isinstance(error, ssl.SSLCertVerificationError):
        hint = "ca under [mqtt] names the authority that signed it"
        return f"the certificate of {where} is not trusted: {error.verify_message}; {hint}"
    if isinstance(error, ssl.SSLError):
        return f"no encrypted connection with {where} ({error.reason}); mqtt:// is the form without encryption"
    return f"no broker at {where} ({why(error)}); check that it runs, its name and its port"


def _leave(client: Client) -> None:
    client.disconnect()
    client.loop_stop()


class _Guarded:
    """A socket that ends its connection at a packet that is too long, or that a broker has no reason to send."""

    _head = b""
    _left = 0
    """The bytes of the packet that are still to come."""

    def guard(self, refuse: Callable[[str], None]) -> None:
        """Tell a packet that is refused to `refuse`, in the reading thread."""
        self._refuse = refuse

    def recv(self, buflen: int = 1024, flags: int = 0) -> bytes:
        """Read. Raises OSError."""
        data: bytes = super().recv(buflen, flags)  # type: ignore[misc]
        skipped = min(self._left, len(data))
        self._left -= skipped
        for byte in data[skipped:]:  # mostly one, as paho reads the head of a packet
            self._take(byte)
        return data

    def _take(self, byte: int) -> None:
        if self._left:
            self._left -= 1
            return
        if not self._head and byte & 0xF6 not in KINDS:  # less the marks of a retained message and a second one
            self._end(f"a packet of kind 0x{byte:02x}, which nothing here asked for")
        self._head += bytes([byte])
        if len(self._head) > 1 and byte < 0x80:
            self._left = sum((each & 0x7F) << 7 * n for n, each in enumerate(self._head[1:]))
            self._head = b""
            if self._left > LARGEST_PACKET:
                self._end(f"a packet of {self._left / 2**20:.0f} MB; the limit is {LARGEST_PACKET >> 20} MB")

    def _end(self, what: str) -> None:
        self._refuse(what)
        raise ConnectionAbortedError(what)


class _PlainSocket(_Guarded, socket.socket):
    """A socket without encryption."""

    def do_handshake(self, block: bool = False) -> None:
        """Agree on nothing."""


class _Plain:
    """Makes sockets without encryption; paho takes a socket of another class from a context only."""

    check_hostname = True  # there is no certificate to check

    def wrap_socket(self, made: socket.socket, **_: object) -> _PlainSocket:
        return _PlainSocket(fileno=made.detach())


class _BrokerSocket(_Guarded, ssl.SSLSocket):
    """A socket that is closed where its handshake fails; paho leaves it open."""

    def do_handshake(self, block: bool = False) -> None:
        """Agree on a key. Raises OSError."""
        try:
            super().do_handshake(block)
        except OSError:
            self.close()
            raise


def _context(settings: MqttSettings) -> ssl.SSLContext:
    for problem in settings.unreadable():
        raise Diagnostic(problem)
    place = "mqtt.ca"
    try:
        context = ssl.create_default_context(cafile=settings.ca or None)
        context.sslsocket_class = _BrokerSocket
        place = "mqtt.cert"
        if settings.cert:  # an encrypted key is refused: no person is there to type its passphrase
            context.load_cert_chain(settings.cert, settings.key or None, password=lambda: "")
    except (OSError, ValueError) as error:
        raise Diagnostic(f"{place}: not a certificate that can be used ({why(error)})") from None
    return context
