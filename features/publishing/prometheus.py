"""An HTTP server on which Prometheus reads the values of a registry, in its text format, and nothing can be written."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from multidrop.base.errors import Diagnostic
from multidrop.base.on_demand import importing
from multidrop.features.publishing.feed import escape
from multidrop.features.publishing.listening import Listening
from multidrop.features.publishing.registry import ONLINE, STATES, Outlet, Registry

if TYPE_CHECKING:
    from prometheus_client.core import GaugeMetricFamily

INSTALL = "pip install 'multidrop[prometheus]'"
CLIENTS = 16
"""Connections at a time; one more is closed at once."""
REQUEST_TIMEOUT = 5.0
"""Seconds for one request and its answer."""
LONGEST_HTTP_REQUEST = 16384
"""Bytes of the head of a request."""
FRESH = 0.2
"""Seconds for which one text serves all who ask: many scrapers cost no more than one."""
AXIS = ("line", "drive", "axis")
GAUGES = {
    "position": "Position of an axis: steps, or counts with an encoder",
    "velocity": "Velocity of an axis, which is its speed with a sign: steps/s or counts/s",
    "error": "Error of a drive, or of an axis with a name; 0: none; -1: set, to read its number would clear it",
}


class MetricsServer(Outlet):
    """The server. Its answers are made in the event loop, of what the registry has."""

    def __init__(self, registry: Registry, place: Listening) -> None:
        from prometheus_client import CollectorRegistry

        self._registry, self._place, self.text = registry, place, place.text
        self._server: asyncio.Server | None = None
        self._clients = 0
        self._made = float("-inf"), b""
        """The last text, and when it was made."""
        self._collectors = CollectorRegistry(auto_describe=False)
        self._collectors.register(self)

    @staticmethod
    def load() -> None:
        """Import the library. Raises Diagnostic where it is missing."""
        try:
            with importing():
                import prometheus_client  # noqa: F401
        except ImportError:
            what = "publish --to prometheus:// needs prometheus_client, which is not installed"
            raise Diagnostic(what, hint=INSTALL) from None

    async def listen(self) -> None:
        self._place, listener = await self._place.taken(self._registry.warn)
        self.text = self._place.text
        self._server = await asyncio.start_server(self._serve, sock=listener, limit=LONGEST_HTTP_REQUEST)

    async def end(self) -> str:
        if self._server is not None:
            self._server.close()
        return ""

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._clients += 1
        try:
            async with asyncio.timeout(REQUEST_TIMEOUT):
                if self._clients <= CLIENTS:
                    head = await reader.readuntil(b"\r\n\r\n")
                    writer.write(self.answer(head.partition(b"\r\n")[0].decode("latin-1")))
                    await writer.drain()
                    writer.close()
                    await writer.wait_closed()
        except (OSError, EOFError, asyncio.LimitOverrunError):
            pass
        finally:
            self._clients -= 1
            writer.transport.abort()

    def answer(self, request: str) -> bytes:
        """Make the answer to the first line of a request."""
        method, _, rest = request.partition(" ")
        path = rest.partition(" ")[0].partition("?")[0]
        if method not in ("GET", "HEAD"):
            status, kind, body = "405 Method Not Allowed", "text/plain", b"these values can only be read\n"
        elif path != "/metrics":
            status, kind, body = "404 Not Found", "text/plain", b"the values are at /metrics\n"
        else:
            status, kind, body = "200 OK", "text/plain; version=0.0.4; charset=utf-8", self._metrics()
        head = f"HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {len(body)}\r\n"
        head += "Allow: GET, HEAD\r\nConnection: close\r\n\r\n"
        return head.encode() + (b"" if method == "HEAD" else body)

    def _metrics(self) -> bytes:
        from prometheus_client import generate_latest

        now = asyncio.get_running_loop().time()
        if now > self._made[0] + FRESH:
            self._made = now, generate_latest(self._collectors)
        return self._made[1]

    def collect(self) -> Iterator[GaugeMetricFamily]:
        """Yield the metrics. Numbers of a drive that does not reply are left out: they are of the past."""
        from prometheus_client.core import GaugeMetricFamily

        registry, values = self._registry, self._registry.values
        up = GaugeMetricFamily("multidrop_line_up", "1: the line is open; 0: it is lost", labels=["line"])
        for bus, word in registry.words.items():
            up.add_metric([escape(bus)], float(word == ONLINE))
        metrics: dict[str, Any] = {
            gauge: GaugeMetricFamily(f"multidrop_{gauge}", GAUGES[gauge], labels=AXIS) for gauge in GAUGES
        }
        about = "1 for the state of a drive, or of an axis with a name; 0 for the others"
        states = GaugeMetricFamily("multidrop_state", about, labels=[*AXIS, "state"])
        about = "Position or velocity in the unit of its axis"
        quantities = GaugeMetricFamily("multidrop_quantity", about, labels=[*AXIS, "of", "unit"])
        about = "When the drive was asked for position and velocity, in seconds since 1970"
        times = GaugeMetricFamily("multidrop_sample_timestamp_seconds", about, labels=AXIS)
        for key, (_, time, fields) in values.items():
            labels = [escape(key.bus), escape(key.address), key.axis]
            if key.what == "state":
                for word in STATES:
                    states.add_metric([*labels, word], float(word == fields["value"]))
                continue
            if not registry.current(key):
                continue
            metrics[key.what].add_metric(labels, float(fields["value"]))
            if "quantity" in fields:
                quantities.add_metric([*labels, key.what, str(fields["unit"])], float(fields["quantity"]))
            if key.what == "position":
                times.add_metric(labels, time.timestamp())
        yield from (up, *metrics.values(), states, quantities, times)
