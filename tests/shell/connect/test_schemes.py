"""Kinds of URLs that features add: listed in their place, found by their word, explained where the feature is gone."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from multidrop.base import registry
from multidrop.base.errors import Diagnostic
from multidrop.base.feature import Feature
from multidrop.dialects.families import DEFAULT
from multidrop.shell.connect.opening import open_port
from multidrop.shell.connect.scheme import Connection, Scheme
from multidrop.shell.connect.schemes import CORE, local_ports, named, schemes, sentence, table
from multidrop.shell.connect.urls import parse
from multidrop.shell.operations.table import load_others
from multidrop.simulator import cells
from multidrop.simulator.cell.endpoint_kinds import EndpointKind
from multidrop.transports import NotOpen, Unreachable
from multidrop.transports.serial_ports import PortInfo
from tests.support.own_features import forget_loaded


class Can(Scheme):
    """A gateway to another bus, at a host."""

    name, prefix, example, meaning, port, after = "can", "can://", "can://HOST:29536", "a gateway", 29536, "tcp"

    async def open(self, connection: Connection, baud: int, within: float | None = None) -> Any:
        return NotOpen(self.shown(connection), Unreachable("gone"))

    def ports(self) -> list[PortInfo]:
        return [PortInfo("can://here")]


async def serve(floor: Any, bus: str, endpoint: Any, stack: Any) -> list[str]:
    return [f"can://{endpoint.host}:{endpoint.port}"]


def add(monkeypatch: pytest.MonkeyPatch, *adds: object) -> None:
    entry = registry.FeatureEntry("gateway", "elsewhere", "1", "elsewhere:FEATURE")
    forget_loaded(monkeypatch, (entry, Feature("gateway", "a gateway", adds)))


@pytest.fixture
def gone(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The feature usb was deleted."""
    there = registry.wheel
    monkeypatch.setattr(registry, "wheel", lambda name: None if name == "usb" else there(name))
    yield


def test_a_first_scheme_is_a_form_and_an_opening(monkeypatch: pytest.MonkeyPatch) -> None:
    add(monkeypatch, can := Can())
    assert named("can") is can and [*schemes()][:3] == ["serial", "tcp", "can"]
    assert "can://HOST:29536" in sentence() and any("a gateway" in each for each in table())
    found = parse("CAN://[fe80::1]?dialect=pmx&timeout=2")
    assert (found.scheme, found.host, found.port, found.hints.family) == (can, "fe80::1", 29536, "pmx")
    assert (found.short, found.port_name, can.shown(found)) == ("fe80::1", "fe80::1:29536", "can://[fe80::1]:29536")
    assert PortInfo("can://here") in local_ports()
    with pytest.raises(Diagnostic, match=r"can: needs //HOST:PORT; as in can://10.0.0.5:29536"):
        parse("can:here")


async def test_its_transport_is_opened_and_opened_again(monkeypatch: pytest.MonkeyPatch) -> None:
    add(monkeypatch, Can())
    opened = await open_port(parse("can://h"))
    assert (opened.name, opened.transport.name, opened.family) == ("h", "can://h:29536", "")
    assert opened.reopen is not None
    assert (await opened.reopen(opened.transport)).name == "can://h:29536"


@pytest.mark.parametrize("url", ["sim:", "sim:#press"])
async def test_a_cell_has_no_port(url: str) -> None:
    connection = parse(url)
    with pytest.raises(Unreachable, match=f"^{url}: a simulated cell has no port"):
        await connection.scheme.open(connection, 9600)


def test_a_scheme_that_is_there_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    class Tcp(Can):
        name = "tcp"

    add(monkeypatch, Tcp())
    monkeypatch.setattr(registry, "load_others", lambda: None)
    [warning] = load_others()
    assert warning == "the feature gateway (elsewhere) cannot be loaded: tcp: is taken"
    assert schemes()["tcp"] is CORE["tcp"]


@pytest.mark.usefixtures("gone")
@pytest.mark.parametrize("url", ["usb:2ED01", "usb:", "usbip://10.0.0.5/1-1"])
def test_the_url_of_a_feature_that_is_gone_says_what_to_install(url: str) -> None:
    scheme = url.partition(":")[0]
    with pytest.raises(Diagnostic) as refused:
        parse(url)
    assert str(refused.value) == f"{scheme}: the feature usb is not there; install multidrop again, whole"
    assert scheme not in schemes() and f"{scheme}:" not in sentence()


def test_an_endpoint_of_a_cell_is_added_and_is_for_drives_of_its_families(monkeypatch: pytest.MonkeyPatch) -> None:
    cell = '[[bus]]\nname = "b"\nserve = ["can://127.0.0.1:0"]\n[[bus.drive]]\npersonality = "LMDCM"\n'
    add(monkeypatch, EndpointKind("can", serve, (DEFAULT,), "has no CAN"))
    [bus] = cells.read(cell).buses
    assert [(each.scheme, each.host, each.port) for each in bus.serve] == [("can", "127.0.0.1", 0)]
    with pytest.raises(Diagnostic, match="has can://, and PMX has no CAN"):
        cells.read(cell.replace("LMDCM", "PMX"))
    with pytest.raises(Diagnostic, match="or can:// at the beginning"):
        cells.read(cell.replace("can:", "cab:"))


@pytest.mark.usefixtures("gone")
def test_an_endpoint_of_a_feature_that_is_gone_says_what_to_install() -> None:
    with pytest.raises(Diagnostic, match=r"usbip: the feature usb is not there; install multidrop again, whole"):
        cells.read('[[bus]]\nname = "b"\nserve = ["usbip://127.0.0.1:0"]\n[[bus.drive]]\npersonality = "PMX"\n')
