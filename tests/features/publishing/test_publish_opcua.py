"""What a client of OPC UA reads: the values of the registry, their times, whether they are current. It writes none."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator
from contextlib import suppress
from datetime import UTC, datetime
from typing import Any

import pytest
import pytest_asyncio
from asyncua import Client, ua

from multidrop.features.publishing.listening import Listening, parse_listening
from multidrop.features.publishing.opcua import LONGEST_MESSAGE, UaServer
from multidrop.features.publishing.registry import PublishedValue, Registry, ValueKey
from tests.support.until import until

pytestmark = pytest.mark.asyncio(loop_scope="module")  # one server, which takes a second to begin
TIME = datetime(2026, 11, 22, 14, 3, 7, 123000, UTC)


class Values(Registry):
    """A registry without a session."""

    def __init__(self) -> None:
        self.outlets, self.values, self.words = [], {}, {}

    def warn(self, text: str) -> None:
        raise AssertionError(text)

    def put(self, key: ValueKey, **fields: Any) -> None:
        self.values[key] = value = PublishedValue(0.0, TIME, fields)
        self.outlets[0].value(key, value)


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def registry() -> AsyncIterator[Values]:
    made = Values()
    UaServer.load()
    made.outlets.append(UaServer(made, Listening("opcua", "127.0.0.1", 0)))
    await made.outlets[0].listen()
    await made.outlets[0].begin()
    yield made
    assert await made.outlets[0].end() == ""


def url(registry: Values) -> str:
    return registry.outlets[0].text.replace("opcua", "opc.tcp")


async def read(client: Client, path: str) -> ua.DataValue:
    """A variable by the names from Objects on, `press/a/Position`."""
    names = [f"{client.multidrop}:{name}" for name in path.split("/")]  # type: ignore[attr-defined]
    found: ua.DataValue = await (await client.nodes.objects.get_child(names)).read_data_value(False)
    return found


async def connected(registry: Values) -> Client:
    client = Client(url(registry))
    await client.connect()
    client.multidrop = await client.get_namespace_index("urn:multidrop:values")  # type: ignore[attr-defined]
    return client


async def test_position_speed_state_and_error_of_each_axis_are_read_with_their_time(registry: Values) -> None:
    registry.words["press"] = "online"
    registry.line("press", "online")
    registry.put(ValueKey("press", "a", "position"), value=51200, axis="", quantity=5.0, unit="mm")
    registry.put(ValueKey("press", "a", "velocity"), value=-7, axis="")
    registry.put(ValueKey("press", "a", "error"), value=86, text="stalled", axis="")
    for axis, word in (("x", "moving"), ("y", "at rest")):
        registry.put(ValueKey("pmx", "", "state", axis), value=word, program="G1")
        registry.put(ValueKey("pmx", "", "error", axis), value=0, text="")
    registry.put(ValueKey("press", "a", "state"), value="no current")
    client = await connected(registry)
    try:
        expected = {
            "press/State": "online",
            "press/a/Position": 51200,
            "press/a/PositionInUnit": 5.0,
            "press/a/PositionUnit": "mm",
            "press/a/Speed": -7,
            "press/a/Error": 86,
            "press/a/ErrorText": "stalled",
            "press/a/State": "no current",
            "pmx/!/x/State": "moving",
            "pmx/!/x/Program": "G1",
            "pmx/!/y/State": "at rest",
            "pmx/!/y/Error": 0,
        }
        found = {path: await read(client, path) for path in expected}
        assert {path: each.Value.Value for path, each in found.items()} == expected
        assert all(each.StatusCode.is_good() for each in found.values())
        assert found["press/a/Position"].SourceTimestamp == TIME
        registry.put(ValueKey("press", "a", "position"), value=9, axis="")
        assert (await read(client, "press/a/Position")).Value.Value == 9
        registry.put(ValueKey("press", "a", "state"), value="silent")
        status = (await read(client, "press/a/Position")).StatusCode
        assert status.name == "UncertainNoCommunicationLastUsableValue"
        assert (await read(client, "press/a/State")).StatusCode.is_good()
        registry.put(ValueKey("press", "a", "state"), value="at rest")
        assert (await read(client, "press/a/Position")).StatusCode.is_good()
    finally:
        await client.disconnect()


async def test_a_client_is_told_of_changes(registry: Values) -> None:
    registry.put(ValueKey("press", "a", "position"), value=1)
    client, seen = await connected(registry), list[int]()

    class Handler:
        def datachange_notification(self, node: object, value: int, data: object) -> None:
            seen.append(value)

    try:
        subscription = await client.create_subscription(20, Handler())
        await subscription.subscribe_data_change(client.get_node(f"ns={client.multidrop};s=press/a/Position"))  # type: ignore[attr-defined]
        await until(lambda: seen == [1])
        registry.put(ValueKey("press", "a", "position"), value=2)
        await until(lambda: seen == [1, 2])
        await subscription.delete()
    finally:
        await client.disconnect()


@pytest.mark.slow
@pytest.mark.parametrize("user", ["", "admin"])
async def test_no_client_writes_calls_or_adds_anything(user: str, registry: Values) -> None:
    registry.put(ValueKey("press", "a", "position"), value=5)
    client = Client(url(registry))
    if user:
        client.set_user(user)
        with pytest.raises(ua.UaError):
            await client.connect()
        return
    await client.connect()
    nodes = [*registry.outlets[0]._server.iserver.aspace.keys()]  # type: ignore[attr-defined]
    values = [
        ua.WriteValue(each, ua.AttributeIds.Value, "", ua.DataValue(ua.Variant(7, ua.VariantType.Int64)))
        for each in nodes
    ]
    names = [
        ua.WriteValue(each, ua.AttributeIds.DisplayName, "", ua.DataValue(ua.Variant(ua.LocalizedText("x"))))
        for each in nodes
    ]
    for first in range(0, len(nodes), 500):
        for asked in (values, names):
            params = ua.WriteParameters(asked[first : first + 500])
            assert not any(each.is_good() for each in await client.uaclient.write(params))
    assert len(nodes) > 500
    with suppress(ConnectionError):
        await client.disconnect()
    for work in ("add_folder", "call_method", "delete", "set_writable"):
        client = await connected(registry)
        node = client.get_node(f"ns={client.multidrop};s=press/a/Position")  # type: ignore[attr-defined]
        arguments = {"add_folder": (2, "x"), "call_method": (ua.NodeId(ua.ObjectIds.Server_GetMonitoredItems), 1)}
        with pytest.raises((ua.UaError, ConnectionError)):
            await getattr(node if work != "call_method" else client.nodes.server, work)(*arguments.get(work, ()))
        with suppress(ua.UaError, ConnectionError):
            await client.disconnect()
    client = await connected(registry)
    assert (await read(client, "press/a/Position")).Value.Value == 5
    await client.disconnect()


async def test_a_client_that_announces_a_huge_message_is_cut_off(registry: Values) -> None:
    place = parse_listening(registry.outlets[0].text)
    reader, writer = await asyncio.open_connection(place.host, place.port)
    writer.write(b"HELF" + (2**31).to_bytes(4, "little"))
    with suppress(ConnectionError):
        for _ in range(100):
            writer.write(b"x" * (LONGEST_MESSAGE // 8))
            await writer.drain()
        assert await reader.read() == b""
    writer.close()
    client = await connected(registry)
    await client.disconnect()


async def test_a_port_that_is_taken_meanwhile_is_said() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        server = UaServer(Values(), Listening("opcua", "127.0.0.1", taken.getsockname()[1]))
        with pytest.raises(Exception, match="cannot listen there: Address already in use"):
            await server.listen()
        assert await server.end() == ""
