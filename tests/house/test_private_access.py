"""Tests see what a person or a caller sees: few places of them reach into the private parts of another object."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator

from tests.support.paths import ROOT

PROTOCOL = frozenset({"_asdict", "_fields", "_make", "_replace"})
"""Public names of `NamedTuple` that begin with an underscore; `_repr_html_` and the like are Jupyter's."""
LIBRARY = frozenset({("os", "_exit")})
"""Documented functions of the library that begin with an underscore."""
LIMIT = 71
"""The most private accesses of all tests. The aim is 40: lower it with each that goes."""
KEPT: dict[str, tuple[int, str]] = {
    "drives/test_bus_changes.py": (
        2,
        "whether a drive hears a stop, and whether its program ran: no reading shows it by itself",
    ),
    "drives/test_drive.py": (1, "a line to several drives whose failures no simulated line has together"),
    "drives/test_link.py": (1, "a reply that other bytes destroyed, as the line reports it"),
    "drives/test_roster.py": (4, "the words for what was read after a loss, value by value"),
    "families/lexium/simulator/test_modbus_port.py": (1, "memory of a simulated drive under any bytes"),
    "families/tmcl/host/test_exchange.py": (2, "a module that lacks a command of its language"),
    "features/certify/test_certificate.py": (1, "a deviation planted in a simulated drive"),
    "features/lsp/test_lsp_process.py": (1, "pygls has no public name for the process of its client"),
    "features/plot_files/test_table.py": (1, "a disk that is full as the last rows are written"),
    "features/publishing/test_plant.py": (1, "a flood that no broker of a test is fast enough for"),
    "features/publishing/test_plant_page.py": (1, "the page in the loop of the test; the command has its own"),
    "features/publishing/test_publish_opcua.py": (1, "asyncua has no public name for the nodes of its server"),
    "features/sharing/test_sharing_port.py": (1, "bytes of a client that came before a stop key"),
    "features/sweeps/test_program_sweep_answers.py": (3, "the words for any boundary, and any cell of a table"),
    "features/sweeps/test_program_sweep_processes.py": (3, "a cluster that hangs in the middle of a wait"),
    "features/sweeps/test_sweep_cluster.py": (4, "a cluster of stand-ins: replies and ends that none has at will"),
    "features/test_options.py": (1, "the screen in the loop of the test; the command has its own"),
    "features/twin_fit/test_twin_fit.py": (1, "values that are kept in a cell, without a fit of minutes"),
    "features/usb/test_usbip_judges.py": (1, "the library has no public name for its port"),
    "multidrop/test_api_reconnect.py": (1, "a loss in the middle of what is noted before one"),
    "multidrop/test_scan.py": (1, "a rescue without the report at its end"),
    "shell/connect/test_reconnect.py": (1, "who listens to a simulated bus: that nothing is left behind"),
    "shell/prompt/test_prompt.py": (1, "prompt_toolkit has no public name for the colours that were chosen"),
    "shell/test_whole_stop.py": (1, "the time of each write at the system's edge of a transport"),
    "simulator/serving/test_floods.py": (5, "memory of the simulator: what waits in it, place by place"),
    "soak/test_cut_ins.py": (1, "a lock of a transport in which another thread cuts in"),
    "soak/test_drawn.py": (1, "a tree that was lived in before, without living in it"),
    "soak/test_long_run.py": (1, "figures of a long run that no run has"),
    "soak/test_mutants.py": (1, "lives of seeds, without living them"),
    "support/behind_api.py": (5, "what is behind the Python API, for all of its tests"),
    "support/fake_session.py": (3, "driver, compositor and bindings of a running app: Textual has no public names"),
    "support/lsp_bytes.py": (1, "the server on streams of the test"),
    "support/marks.py": (
        3,
        "style sheets are parsed once for all apps of a test process; whether a loop has anything ready",
    ),
    "support/own_features.py": (3, "the features that the process has loaded, for all tests"),
    "support/pty_screen.py": (1, "the moment from which keys count"),
    "support/tuned_ports.py": (1, "what a port of the machine leads to, for all tests"),
    "support/virtual.py": (1, "a loop that is held up in virtual time, for all tests"),
    "transports/test_relay.py": (1, "a clock that goes on while the machine is suspended"),
    "transports/test_serial_port.py": (1, "a port that goes as it is being opened"),
    "transports/test_sockets.py": (1, "the options of the socket of a connection"),
    "tui/test_boundary.py": (1, "a defect planted in a poll"),
    "tui/test_canvas.py": (1, "the pieces of a frame: Textual has no public name for them"),
    "tui/test_keys.py": (2, "one app for many examples goes on after each quit"),
    "tui/test_resized.py": (1, "rows painted outside a message: Textual has no public name for its context"),
}
"""For each file the number of its private accesses, and why they stay. It only falls: lower it with the test's code."""


def is_private(name: str) -> bool:
    return name.startswith("_") and not (
        name.startswith("__") or name in PROTOCOL or (name.startswith("_repr_") and name.endswith("_"))
    )


def private_accesses(tree: ast.AST) -> Iterator[str]:
    """Accesses `x._y` but those of an object to itself, imports of private names, and replaced private names."""
    for node in ast.walk(tree):
        match node:
            case ast.Attribute(value=ast.Name("self" | "cls")):
                pass
            case ast.Attribute(value, name) if is_private(name) and (ast.unparse(value), name) not in LIBRARY:
                yield name
            case ast.ImportFrom(module=str(module)) if module.startswith("multidrop"):
                yield from (each.name for each in node.names if is_private(each.name))
            case ast.Call(ast.Attribute(attr="setattr"), arguments):
                names = [each.value for each in arguments[:2] if isinstance(each, ast.Constant)]
                last = [str(each).rpartition(".")[2] for each in names]
                yield from (
                    each for each in last if is_private(each) and (ast.unparse(arguments[0]), each) not in LIBRARY
                )


def found() -> Counter[str]:
    """The number of private accesses in each file of tests."""
    counts: Counter[str] = Counter()
    for path in sorted((ROOT / "tests").rglob("*.py")):
        counts[path.relative_to(ROOT / "tests").as_posix()] = len(
            [*private_accesses(ast.parse(path.read_text("utf-8")))]
        )
    return +counts


def test_no_more_private_parts_are_reached_into_than_the_limit() -> None:
    assert found().total() <= LIMIT


def test_no_file_reaches_into_more_private_parts_than_are_listed() -> None:
    assert found() == {name: number for name, (number, _) in KEPT.items()}


def test_each_place_that_stays_has_its_reason() -> None:
    assert not [name for name, (_, why) in KEPT.items() if len(why) < 10]


def test_what_is_private_is_seen_in_each_form() -> None:
    text = (
        "from multidrop.a import _one, two\nx._three = self._four\npatch.setattr(x, '_five', 1)\n"
        "patch.setattr('a._six', 1)\nos._exit(1)\nx._replace(a=1)\nx._repr_html_()\nx.__dict__\n"
    )
    assert sorted(private_accesses(ast.parse(text))) == ["_five", "_one", "_six", "_three"]
