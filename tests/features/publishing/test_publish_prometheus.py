"""What a scraper reads: the values of the registry, in a text that Prometheus' own parser takes."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from datetime import UTC, datetime
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from prometheus_client.parser import text_string_to_metric_families

from multidrop.base.errors import Diagnostic
from multidrop.features.publishing import prometheus
from multidrop.features.publishing.listening import Listening, parse_listening
from multidrop.features.publishing.prometheus import CLIENTS, MetricsServer
from multidrop.features.publishing.registry import PublishedValue, Registry, ValueKey
from multidrop.transports import Unreachable
from tests.support.cell_session import ETHERNET, CellSession, bus, party, pmx

HERE = Listening("prometheus", "127.0.0.1", 0)
GET = "GET /metrics HTTP/1.1"
Labels = tuple[tuple[str, str], ...]


def read(answer: bytes) -> dict[tuple[str, str], float]:
    """The samples of an answer by metric and labels: `press a`, `pmx 00 x`, `press a moving`."""
    head, _, body = answer.partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 200 OK\r\n") and f"Content-Length: {len(body)}\r\n".encode() in head
    found = {}
    for family in text_string_to_metric_families(body.decode()):
        assert family.type == "gauge" and family.documentation
        for sample in family.samples:
            key = (
                sample.name.removeprefix("multidrop_"),
                " ".join(filter(None, map(sample.labels.get, ("line", "drive", "axis", "of", "unit", "state")))),
            )
            assert key not in found
            found[key] = sample.value
    return found


@asynccontextmanager
async def served(shop: CellSession) -> AsyncIterator[MetricsServer]:
    registry = Registry(shop.session, 0.5)
    registry.begin()
    yield MetricsServer(registry, HERE)
    registry.end()


@pytest.mark.virtual
async def test_a_scrape_has_position_velocity_state_and_error_of_every_axis(tmp_path: Path) -> None:
    cell = [bus("press", party("a"), party("b")), bus("eth", ETHERNET, baud=0), bus("pmx", pmx("00"))]
    async with CellSession(tmp_path, *cell) as shop, served(shop) as endpoint:
        await asyncio.sleep(6)
        await shop.session.run("@press:a MA 51200")
        await asyncio.sleep(3)
        found = read(endpoint.answer(GET))
        assert found["position", "press a"] == 51200 and found["velocity", "press a"] == 0
        assert [found["line_up", each] for each in ("press", "eth", "pmx")] == [1, 1, 1]
        for axis in ("press a", "press b", "eth !", "pmx 00 x", "pmx 00 y"):
            assert found["error", axis] == 0 and ("position", axis) in found
            assert [found["state", f"{axis} {word}"] for word in ("at rest", "moving", "silent")] == [1, 0, 0]
            assert found["sample_timestamp_seconds", axis] == pytest.approx(datetime.now().timestamp(), abs=60)


@pytest.mark.virtual
async def test_the_numbers_of_a_drive_without_power_are_left_out_and_a_lost_line_is_down(tmp_path: Path) -> None:
    async with (
        CellSession(tmp_path, bus("press", party("a"), party("b")), reconnect=True) as shop,
        served(shop) as endpoint,
    ):
        await asyncio.sleep(3)
        shop.world("power b off")
        await asyncio.sleep(5)
        found = read(endpoint.answer(GET))
        assert found["state", "press b silent"] == 1 and ("position", "press b") not in found
        assert ("position", "press a") in found
        shop.world("unplug press")
        await asyncio.sleep(3)
        found = read(endpoint.answer(GET))
        assert found["line_up", "press"] == 0 and found["state", "press a lost"] == 1
        assert not any(name in ("position", "velocity", "error") for name, _ in found)


@pytest.mark.virtual
@given(names=st.lists(st.text(st.characters(codec=None), max_size=6), min_size=2, max_size=2))
async def test_any_name_is_a_label_that_the_parser_takes(names: list[str]) -> None:
    class Named:
        words = {names[0]: "online"}
        values = {ValueKey(names[0], names[1], "position"): PublishedValue(0.0, datetime.now(UTC), {"value": 7})}

        def current(self, key: ValueKey) -> bool:
            return True

    endpoint = MetricsServer(Named(), HERE)  # type: ignore[arg-type]
    assert [value for (name, _), value in read(endpoint.answer(GET)).items() if name == "position"] == [7]


@pytest.mark.virtual
async def test_nothing_can_be_written_and_other_paths_are_not_there(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"))) as shop, served(shop) as endpoint:
        for method in ("POST", "PUT", "DELETE", "PATCH", "get", ""):
            assert endpoint.answer(f"{method} /metrics HTTP/1.1").startswith(b"HTTP/1.1 405 ")
        for path in ("/", "/metrics/", "/../etc/passwd", ""):
            assert endpoint.answer(f"GET {path} HTTP/1.1").startswith(b"HTTP/1.1 404 ")
        assert endpoint.answer("HEAD /metrics HTTP/1.1").endswith(b"\r\n\r\n")
        assert endpoint.answer("GET /metrics?x=1 HTTP/1.1").startswith(b"HTTP/1.1 200 ")


async def test_a_client_that_says_nothing_or_too_much_is_hung_up_on_and_others_are_served(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(prometheus, "REQUEST_TIMEOUT", 0.3)
    async with CellSession(tmp_path, bus("press", party("a"))) as shop, served(shop) as endpoint:
        await endpoint.listen()
        place = parse_listening(endpoint.text)
        idle = [await asyncio.open_connection(place.host, place.port) for _ in range(CLIENTS)]
        reader, refused = await asyncio.open_connection(place.host, place.port)
        with pytest.raises((ConnectionError, EOFError)):
            await reader.readexactly(1)  # no room
        for reader, writer in idle:
            writer.write(b"x" * 100_000)
            with pytest.raises((ConnectionError, EOFError)):
                await reader.readexactly(1)
        reader, writer = await asyncio.open_connection(place.host, place.port)
        writer.write(b"GET /metrics HTTP/1.0\r\nHost: x\r\n\r\n")
        assert ("line_up", "press") in read(await reader.read())
        for each in [*(each for _, each in idle), refused, writer]:
            each.close()
        await endpoint.end()


# The place


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("prometheus://:9464", ("127.0.0.1", 9464)),
        ("prometheus://0.0.0.0:1", ("0.0.0.0", 1)),
        ("opcua://[::1]:4840", ("::1", 4840)),
        ("opcua://hall-pc:0", ("hall-pc", 0)),
    ],
)
def test_a_place_is_loopback_unless_told(text: str, place: tuple[str, int]) -> None:
    assert parse_listening(text)[1:] == place


@pytest.mark.parametrize("address", ["", ":", "host", ":x", ":70000", ":1/metrics", "a@h:1", "[::1:1", "a b:1", ":1?x"])
def test_a_wrong_place_is_said(address: str) -> None:
    with pytest.raises(Diagnostic, match=r"--to: no address .* of a server; valid: prometheus://\[HOST\]:PORT"):
        parse_listening(f"prometheus://{address}")


async def test_a_port_in_use_and_an_unknown_host_are_unreachable() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        place = HERE._replace(port=taken.getsockname()[1])
        with pytest.raises(Unreachable, match=rf"--to {place.text}: cannot listen there: Address already in use"):
            await place.taken(print)
    with pytest.raises(Unreachable, match="unknown host name"):
        await Listening("opcua", "no-such-host.invalid", 1).taken(print)
