"""An OPC UA server with the values of a registry, in a namespace of our own, which clients can only read.

Theory of operation. `value` notes that a key has changed, and a task makes its nodes and writes them: a flood of values
costs one write for each key. Line, drive and axis are objects; below them are variables. The library would let clients
call methods, and one that logs in as `admin` change everything: neither is allowed here.
"""

from __future__ import annotations

import asyncio
import logging
from contextlib import suppress
from datetime import UTC, datetime
from typing import Any

import multidrop
from multidrop.base.errors import Diagnostic
from multidrop.base.on_demand import importing
from multidrop.features.publishing.feed import escape
from multidrop.features.publishing.listening import Listening
from multidrop.features.publishing.registry import Outlet, PublishedValue, Registry, ValueKey
from multidrop.transports import Unreachable
from multidrop.transports.sockets import explain

INSTALL = "pip install 'multidrop[opcua]'"
NAMESPACE = "urn:multidrop"
CLIENTS = 16
"""Connections at a time."""
LONGEST_MESSAGE = 1 << 20
"""Bytes of a message from a client."""
VARIABLES = {
    "position": (
        ("Position", "value", "Int64"),
        ("PositionInUnit", "quantity", "Double"),
        ("PositionUnit", "unit", "String"),
    ),
    "velocity": (("Speed", "value", "Int64"), ("SpeedInUnit", "quantity", "Double"), ("SpeedUnit", "unit", "String")),
    "state": (("State", "value", "String"), ("Program", "program", "String")),
    "error": (("Error", "value", "Int64"), ("ErrorText", "text", "String")),
}
"""The variables of each value: name, field, and type."""
SERVICES = """CreateSession ActivateSession CloseSession CloseSecureChannel GetEndpoints FindServers Read Write Browse
TranslateBrowsePathsToNodeIds CreateSubscription ModifySubscription DeleteSubscriptions CreateMonitoredItems
ModifyMonitoredItems DeleteMonitoredItems SetMonitoringMode SetPublishingMode Publish Republish"""
"""The services for clients; a write is answered by each node, and none of them can be written."""


def _now() -> datetime:
    return datetime.now(UTC)


class UaServer(Outlet):
    """The server."""

    def __init__(self, registry: Registry, place: Listening) -> None:
        self._registry, self._place, self.text = registry, place, place.text
        self._server: Any = None
        self._space = 0
        """The index of our namespace."""
        self._nodes: dict[tuple[str, ...], Any] = {}
        """Objects and variables by their path."""
        self._changed: dict[ValueKey, None] = {}
        self._wake = asyncio.Event()
        self._task: asyncio.Task[None] | None = None

    @staticmethod
    def load() -> None:
        """Import the library. Raises Diagnostic where it is missing."""
        try:
            with importing():
                from asyncua.server import binary_server_asyncio as connections
        except ImportError:
            what = "publish --to opcua:// needs asyncua, which is not installed"
            raise Diagnostic(what, hint=INSTALL) from None

        class Bounded(connections.OPCUAProtocol):  # type: ignore[misc]
            """A connection that ends where a client sends more than any message has: the library has no bound."""

            def data_received(self, data: bytes) -> None:
                if len(self._buffer) > LONGEST_MESSAGE:
                    self.transport.abort()
                else:
                    super().data_received(data)

        connections.OPCUAProtocol = Bounded
        logging.getLogger("asyncua").setLevel(logging.CRITICAL + 1)  # clients could fill the terminal

    async def listen(self) -> None:
        from asyncua import Server, ua
        from asyncua.crypto.permission_rules import PermissionRuleset

        allowed = {
            ua.NodeId(getattr(ua.ObjectIds, f"{service}Request_Encoding_DefaultBinary")) for service in SERVICES.split()
        }

        class ReadOnlyRules(PermissionRuleset):  # type: ignore[misc]
            """The services for clients, whoever they say they are."""

            def check_validity(self, user: object, action_type: object, body: object) -> bool:
                return action_type in allowed

        self._place, listener = await self._place.taken(self._registry.warn)
        self.text = self._place.text
        self._server = server = Server()
        await server.init()
        server.set_server_name("multidrop")
        await server.set_application_uri(NAMESPACE)
        await server.set_build_info(NAMESPACE, "multidrop", "multidrop", multidrop.__version__, "", _now())
        server.set_endpoint(f"opc.tcp://{self.text.partition('://')[2]}/multidrop")
        server.set_security_policy([ua.SecurityPolicyType.NoSecurity], ReadOnlyRules())
        server.set_identity_tokens([ua.AnonymousIdentityToken])
        server.allow_remote_admin(False)
        server.iserver.max_connections = CLIENTS
        server.limits.max_message_size, server.limits.max_chunk_count = LONGEST_MESSAGE, LONGEST_MESSAGE // 65535 + 1
        self._space = await server.register_namespace(f"{NAMESPACE}:values")
        listener.close()
        try:
            await server.start()
        except OSError as error:
            self._server = None
            raise Unreachable(f"--to {self.text}: cannot listen there: {explain(error)}; give another one") from None
        self._task = asyncio.get_running_loop().create_task(self._write_changes())

    def line(self, bus: str, word: str) -> None:
        self._note(ValueKey(bus, "", "line"))

    def value(self, key: ValueKey, value: PublishedValue) -> None:
        self._note(key)
        if key.what == "state":  # its numbers may be of the past now, or no longer
            for quantity in ("position", "velocity"):
                if (number := key._replace(what=quantity)) in self._registry.values:
                    self._note(number)

    async def end(self) -> str:
        if self._task is not None:
            self._task.cancel()
            with suppress(asyncio.CancelledError):
                await self._task
        if self._server is not None:
            await self._server.stop()
        return ""

    def _note(self, key: ValueKey) -> None:
        self._changed[key] = None
        self._wake.set()

    async def _write_changes(self) -> None:
        while True:
            await self._wake.wait()
            self._wake.clear()
            while self._changed:
                key = next(iter(self._changed))
                del self._changed[key]
                if key.what == "line":
                    word = self._registry.words[key.bus]
                    await self._write((escape(key.bus), "State"), "String", word, _now(), True)
                else:
                    value = self._registry.values[key]
                    path = (escape(key.bus), escape(key.address), *((escape(key.axis),) if key.axis else ()))
                    current = key.what in ("state", "error") or self._registry.current(key)
                    for name, field, kind in VARIABLES[key.what]:
                        if field in value.fields:
                            await self._write((*path, name), kind, value.fields[field], value.time, current)
                await asyncio.sleep(0)  # the library does not leave the loop to others

    async def _write(self, path: tuple[str, ...], kind: str, value: object, time: Any, current: bool) -> None:
        """Write a variable, which is made with its first value."""
        from asyncua import ua

        form = getattr(ua.VariantType, kind)
        if path not in self._nodes:
            parent = await self._object(path[:-1])
            self._nodes[path] = await parent.add_variable(self._id(path), self._name(path), value, form)
        codes = ua.StatusCodes
        status = codes.Good if current else codes.UncertainNoCommunicationLastUsableValue
        data = ua.DataValue(ua.Variant(value, form), ua.StatusCode(status), time, _now())
        await self._server.write_attribute_value(self._nodes[path].nodeid, data)

    async def _object(self, path: tuple[str, ...]) -> Any:
        if not path:
            return self._server.nodes.objects
        if path not in self._nodes:
            parent = await self._object(path[:-1])
            self._nodes[path] = await parent.add_object(self._id(path), self._name(path))
        return self._nodes[path]

    def _id(self, path: tuple[str, ...]) -> Any:
        from asyncua import ua

        return ua.NodeId("/".join(path), self._space)

    def _name(self, path: tuple[str, ...]) -> Any:
        from asyncua import ua

        return ua.QualifiedName(path[-1], self._space)
