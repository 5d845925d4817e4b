"""A shared port under any bytes of any client at any time: the rules hold."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from multidrop.shell.sharing.exchange import SILENT, Close, Exchange, Send, Stop, Write
from multidrop.shell.sharing.stop_bytes import stop_bytes
from multidrop.transports import telnet
from multidrop.transports.telnet import OPTION, Setting, message

PIECES = st.one_of(
    st.binary(max_size=12),
    st.sampled_from(
        [
            b"MR 51200\r",
            b"PR P\r",
            b"MR 5",
            b"\x1b",
            b"\x03",
            b"a\x1bb\x1b\n",
            telnet.option(telnet.WILL, OPTION),
            message(Setting.BAUD, 19200),
            message(Setting.PURGE, 2),
            message(Setting.SUSPEND, b""),
            message(Setting.RESUME, b""),
        ]
    ),
)
STEPS = st.lists(st.tuples(st.integers(0, 2), PIECES, st.floats(0, 15)), max_size=30)


@given(STEPS, st.integers(0, 20))
def test_only_the_writer_writes_and_every_stop_passes(steps: list[tuple[int, bytes, float]], dropped: int) -> None:
    exchange, now = Exchange(stop_bytes(""), 9600), 0.0
    closed: set[int] = set()
    writer, last = -1, 0.0
    for client in range(3):
        exchange.connect(client, f"pc:{client}")
    for client, data, pause in steps:
        now += pause
        actions = exchange.receive(client, data, now)
        for each in actions:
            match each:
                case Write(by, written):
                    assert by == client and by not in closed
                    assert by == writer or writer < 0 or writer in closed or now >= last + SILENT
                    assert written.startswith(b"~") or _left_of(written, data)
                    writer, last = by, now
                case Close(by):
                    assert by == client
                    closed.add(by)
                case Send(by):
                    assert by == client and by not in closed
                case Stop():
                    exchange.dropped(dropped)
        if data in (b"\x1b", b"\x03", b"a\x1bb\x1b\n") and not _in_telnet(exchange, client):
            [stop] = [each for each in actions if isinstance(each, Stop)]
            assert stop.data in (data, stop.mended) and stop.mended.endswith(data)


def _left_of(written: bytes, data: bytes) -> bool:
    """Whether bytes are others without some of them: commands of telnet, or a stop."""
    rest = iter(data)
    return all(byte in rest for byte in written)


def _in_telnet(exchange: Exchange, client: int) -> bool:
    """A telnet command that has begun takes what follows."""
    return exchange.clients[client]._telnet is not None
