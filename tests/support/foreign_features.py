"""Every kind of record of a feature, each function in it, and how the core comes to call it: for tests of failures.

`CALLS` must have every function of every kind (`tests/features/test_kinds.py`).
"""

from __future__ import annotations

import ast
from argparse import Namespace
from collections.abc import Awaitable, Callable, Iterator, Mapping
from contextlib import AsyncExitStack
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import pytest

from multidrop.api import notebooks
from multidrop.api.notebooks import Pictures
from multidrop.api.telemetry import read_rrd
from multidrop.base import registry
from multidrop.base.errors import Diagnostic
from multidrop.base.feature import Feature
from multidrop.base.foreign import guarded
from multidrop.dialects.families import Dialect
from multidrop.dialects.usb import UsbModule
from multidrop.shell import configuration, plot_targets, relaying
from multidrop.shell.at_session import AtSession
from multidrop.shell.configuration import Settings
from multidrop.shell.connect.scheme import Connection, NoLine, Scheme
from multidrop.shell.connect.schemes import local_ports
from multidrop.shell.connect.urls import parse
from multidrop.shell.hooks import Added, Options, Predicting, Switch
from multidrop.shell.operations.operation import Examples, Operation
from multidrop.shell.operations.table import COMMANDS, VERBS
from multidrop.shell.plot_targets import PlotTargets
from multidrop.shell.relaying import Lent
from multidrop.shell.sections import Section, sections
from multidrop.shell.session import begin
from multidrop.simulator import cells
from multidrop.simulator.cell.endpoint_kinds import EndpointKind, kind_of
from multidrop.simulator.declared import Demo, Simulated
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.endpoints import serve_bus
from multidrop.simulator.serving.running import RunningFloor
from multidrop.transports import Transport, Unreachable
from multidrop.tui.app import configuration_troubles
from tests.support.cell_session import bus, party
from tests.support.own_features import load
from tests.support.paths import ROOT

CORE = ("base", "dialects", "drives", "families", "macros", "multidrop", "shell", "simulator", "transports", "tui")
ASKS = {"added", "answering", "needed", "records"}
"""The functions of the registry with which a room asks for records of a class."""
DATA = {"claims", "passes"}
"""The methods that are read as a feature is loaded, where whatever they raise refuses it."""


class Slow(Scheme):
    """A scheme with a byte pipe that is never opened here."""

    name, prefix, example, meaning, port = "slow", "slow://", "slow://HOST:1", "a slow gateway", 1

    async def open(self, connection: Connection, baud: int, within: float | None = None) -> Transport:
        raise Unreachable(f"{connection.host}: never open")


async def _work(*_: Any) -> None:
    """Do nothing."""


def _do(where: object) -> None:
    """Do nothing."""


@dataclass(frozen=True, kw_only=True)
class Slowness:
    """What the options of a command are read into."""

    slow: bool = False


async def _served(*_: Any) -> list[str]:
    return []


PLAIN: Mapping[type, Any] = MappingProxyType(
    {
        AtSession: AtSession(lambda session: None),
        EndpointKind: EndpointKind("slow", _served),
        Demo: Demo("x"),
        Dialect: Dialect("slow", "x:SLOW"),
        Simulated: Simulated("slow", "x:SLOW", ("SLOW",)),
        Examples: Examples("send", ("send sim: slow",)),
        UsbModule: UsbModule("slow", "a slow one", "slow controller", 1, 2),
        Lent: Lent("slow:", "what is slow", lambda rest: None),
        NoLine: NoLine(("slow",), "it leads to no drives", "try another one"),
        Operation: Operation(
            _do,
            verb="/slow",
            at=lambda call: call,
            help="Be slow.",
            command="slow",
            through=lambda work: work(None),
            meaning="be slow",
        ),
        Options: Options("shell", Slowness),
        Pictures: Pictures({}, lambda readings: None),  # type: ignore[arg-type,return-value]
        PlotTargets: PlotTargets(
            "--to FILE.slow",
            "FILE.slow",
            "--to slow://h",
            lambda text: (text, _work),
            max,
        ),
        Scheme: Slow(),
        Predicting: Predicting("nothing slow runs", "/slow on begins it"),
        Switch: Switch("slow", "/slow", "be slow", "be slow, or not", lambda session: False),
        Section: Section("slow", ("key",), "[slow]", lambda table, where: table, lambda found: found),
    }
)
"""A record of each kind that does no harm."""
CHOSEN = Namespace(command="shell", slow=True)
TABLE = "[slow]\nkey = 1\n"


async def _serve(session: Any, record: EndpointKind) -> Any:
    floor = RunningFloor(Floor(cells.read(bus("third", party("c"), serve=["slow://127.0.0.1:0"]))))
    async with AsyncExitStack() as stack:
        stack.callback(floor.close)
        return await serve_bus(floor, floor.floor.cell.buses[0], stack)


def _around(session: Any, record: Options) -> None:
    with Added("shell", CHOSEN).around(None):
        """The screen runs."""


def _ports(session: Any, record: Scheme) -> list[str]:
    return [*map(str, local_ports()), *registry.warnings()]


def _of_scheme(name: str, *given: Any) -> Callable[[Any, Scheme], Any]:
    return lambda session, record: getattr(record, name)(*given)


CONNECTION = parse("tcp://127.0.0.1:1")
Call = Callable[[Any, Any], Any]
CALLS: Mapping[tuple[type, str], Call] = {
    (AtSession, "begin"): lambda session, record: begin(session),
    (EndpointKind, "open"): _serve,
    (EndpointKind, "remark"): lambda session, record: kind_of("slow").remark("slow://h:1"),  # type: ignore[union-attr,misc]
    (Lent, "lend"): lambda session, record: relaying.lender("slow:1").lend("1"),  # type: ignore[union-attr]
    (Operation, "do"): lambda session, record: session.run("/slow"),
    (Operation, "at"): lambda session, record: session.run("/slow"),
    (Operation, "through"): lambda session, record: COMMANDS["slow"].command_work(Namespace()),
    (Operation, "recorded"): lambda session, record: session.run("/slow"),
    (Operation, "rows"): lambda session, record: VERBS["/slow"].described(),
    (Operation, "fits"): lambda session, record: VERBS["/slow"].offered(session),
    (Options, "prepare"): lambda session, record: Added("shell", CHOSEN).prepare(session),
    (Options, "opened"): lambda session, record: Added("shell", CHOSEN).opened(session),
    (Options, "instead"): lambda session, record: Added("shell", CHOSEN).instead(False),
    (Options, "around"): _around,
    (Pictures, "html"): lambda session, record: notebooks.picture("Session", session),
    (Pictures, "live"): lambda session, record: notebooks.live(None),
    (Switch, "is_on"): lambda session, record: record.typed(session),
    (PlotTargets, "save"): lambda session, record: plot_targets.needed().save("x.slow"),
    (PlotTargets, "read"): lambda session, record: read_rrd("x.slow"),
    (Scheme, "parse"): lambda session, record: parse("slow://h:1"),
    (Scheme, "host_and_port"): lambda session, record: parse("slow://h:1"),
    (Scheme, "open"): lambda session, record: session.open("slow://h:1"),
    (Scheme, "ports"): _ports,
    (Scheme, "in_folder"): _of_scheme("in_folder", CONNECTION, "."),
    (Scheme, "short"): _of_scheme("short", CONNECTION),
    (Scheme, "port_name"): _of_scheme("port_name", CONNECTION),
    (Scheme, "shown"): _of_scheme("shown", CONNECTION),
    (Scheme, "lasting"): _of_scheme("lasting", CONNECTION, ""),
    (Scheme, "found"): _of_scheme("found", CONNECTION, ""),
    (Scheme, "again"): _of_scheme("again", CONNECTION, None, 0.0),
    (Scheme, "searched"): _of_scheme("searched", ""),
    (Section, "read"): lambda session, record: configuration.parse(TABLE, "f.toml"),
    (Section, "shown"): lambda session, record: sections()["slow"].shown({}),
    (Section, "unreadable"): lambda session, record: configuration_troubles(
        Settings(sections={"slow": {}}), TABLE, "f.toml"
    ),
}
"""How the core comes to call each function, of a record by others that was added, in the loop of a session."""
ASYNC = {
    (EndpointKind, "open"),
    (Options, "opened"),
    (Scheme, "open"),
}
"""Those that are awaited."""
NAMES = [f"{kind.__name__}.{name}" for kind, name in CALLS]


def broken(kind: type, name: str, function: Callable[..., Any]) -> Any:
    """A record of a kind, one of whose functions is this one."""

    async def awaited(*given: Any, **named: Any) -> Any:
        found = function(*given, **named)
        return await found if isinstance(found, Awaitable) else found

    def one(given: object = None) -> Any:
        return function(given)

    called = awaited if (kind, name) in ASYNC else one if kind is Operation else function  # which has no **named
    if kind is Scheme:
        return type("Broken", (Slow,), {name: lambda self, *given, **named: called(*given, **named)})()
    if (kind, name) == (Pictures, "html"):
        return PLAIN[kind]._replace(html={"Session": called})
    return PLAIN[kind]._replace(**{name: called})


def add(monkeypatch: pytest.MonkeyPatch, *adds: object) -> Feature:
    """Let these records be all that any feature adds: those of `x`, which is by others."""
    feature = guarded(Feature("x", "tries to be in the way", adds=adds))
    monkeypatch.setattr(registry, "IN_WHEEL", {})
    load(monkeypatch, feature)
    return feature


async def outcome(session: Any, kind: type, name: str, feature: Feature) -> str:
    """What a person reads of a call: what is raised for them, or what comes back."""
    try:
        found = CALLS[kind, name](session, feature.adds[0])
        return str(await found if isinstance(found, Awaitable) else found)
    except (Diagnostic, Unreachable) as failure:
        return str(failure)


# What there is


def kinds_asked_for() -> set[str]:
    """The classes of records for which any room of the core asks the registry."""
    found = set()
    for room in CORE:
        for path in (ROOT / room).rglob("*.py"):
            if (
                path.is_relative_to(ROOT / "base" / "registry.py")
                or path.parts[len(ROOT.parts) :].count("multidrop") > 1
            ):
                continue
            found |= {*_asked(path)}
    return found


def _asked(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        asks = isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in ASKS
        if asks and ast.unparse(node.func.value) == "registry":
            yield ast.unparse(node.args[node.func.attr == "records"])


def functions_of(kind: type) -> set[str]:
    """The functions in a record of a class: fields that are callable or hold such, or the methods of an object."""
    if hasattr(kind, "_fields"):
        return {name for name, about in kind.__annotations__.items() if "Callable" in str(about)}
    return {name for name, found in vars(kind).items() if callable(found) and not name.startswith("_")} - DATA


def delete_features(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no feature of the wheel be there."""
    there = registry.wheel
    monkeypatch.setattr(registry, "wheel", lambda name: there(name) if name in registry.FAMILIES else None)
