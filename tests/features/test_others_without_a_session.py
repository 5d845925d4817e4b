"""Features by others where no session is open, in cell files, tables, commands; and one of the wheel that breaks."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from multidrop.base import registry
from multidrop.simulator import cells
from tests.support.front_door import Command
from tests.support.own_features import forget_loaded, own, wheel_unread
from tests.support.paths import THERE

GATE = """
from multidrop.base.feature import Feature
from multidrop.simulator.cell.endpoint_kinds import EndpointKind

async def serve(floor, bus, endpoint, stack):
    return [endpoint.text]

FEATURE = Feature("gate", "a gate", adds=(EndpointKind("gate", serve),))
"""
SHOP = """
from multidrop.base.feature import Feature
from multidrop.shell.sections import Section

def read(table, where):
    if "hall" in table:
        raise {failure}
    return table

FEATURE = Feature("shop", "a shop", adds=(Section("shop", ("hall",), "[shop]", read, dict),))
"""


@pytest.fixture(autouse=True)
def none_loaded(monkeypatch: pytest.MonkeyPatch) -> None:
    forget_loaded(monkeypatch)


def test_a_cell_file_that_is_read_without_a_session_may_have_endpoints_by_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cell = '[[bus]]\nname = "b"\nserve = ["gate://127.0.0.1:0"]\n[[bus.drive]]\npersonality = "LMDCM"\n'
    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(tmp_path / "conf"))
    monkeypatch.setenv("MULTIDROP_STATE_DIR", str(tmp_path / "state"))
    own(tmp_path, "gate", GATE)
    assert [each.scheme for each in cells.read(cell).buses[0].serve] == ["gate"]


@pytest.mark.parametrize(
    ("failure", "said"),
    [
        ("ValueError('no such hall')", "shop: the feature shop failed at shop.py:7: ValueError: no such hall"),
        ("SystemExit(3)", "shop: the feature shop failed at shop.py:7: SystemExit: 3"),
        ("__import__('multidrop').Diagnostic('no such hall', where)", "shop: no such hall"),
        ("__import__('multidrop').Diagnostic('shop.hall is none', where)", "shop.hall is none"),
    ],
)
def test_a_table_that_a_feature_cannot_read_is_one_line_with_its_place(
    failure: str, said: str, tmp_path: Path, multidrop: Command
) -> None:
    own(tmp_path, "shop", SHOP.replace("{failure}", failure))
    (tmp_path / "conf" / "multidrop.toml").write_text('[log]\nalways = true\n[shop]\nhall = "7"\n')
    checked = multidrop("config", "check")
    assert checked.returncode == 2
    [line] = checked.stderr.splitlines()
    assert line.startswith(f"{tmp_path}/conf/multidrop.toml:") and said in line


def test_a_command_by_others_that_fails_is_one_line_and_exit_code_2(tmp_path: Path, multidrop: Command) -> None:
    text = """
from multidrop.base.feature import Feature
from multidrop.shell.operations.operation import Operation

FEATURE = Feature("gate", "a gate", adds=(Operation(lambda: 1 / 0, command="gate", meaning="open it"),))
"""
    own(tmp_path, "gate", text)
    done = multidrop("gate")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "the feature gate failed at gate.py:5: ZeroDivisionError: division by zero\n"


ADDED_BY = {"EndpointKind": "usb", "PlotTargets": "plot_files", "Pictures": "notebook"}
"""The features that add what is there already."""


@pytest.mark.parametrize(
    ("adds", "why"),
    [
        ('Options("shell", Agreed)', "ArgumentError: argument --yes: conflicting option string: --yes"),
        ('Options("shell", Twin)', "shell --twin is taken"),
        ('Options("shell", Urls)', "shell: the name urls is taken"),
        ('Section("keys", (), "[keys]", read, dict)', "[keys] is taken"),
        ('Section("mqtt", (), "[mqtt]", read, dict)', "[mqtt] is taken"),
        ('Operation(read, verb="/gate")', "/gate has no help"),
        ('Operation(verb="/gate", help="Open.")', "/gate has no function"),
        ('Operation(read, verb="gate", help="Open.")', "gate is no name of a verb or a command"),
        ('Operation(read)', "an Operation has neither a verb nor a command"),
        ('Operation(read, command="gate")', "gate has no meaning"),
        ('Operation(command="gate", meaning="open it")', "gate has no function"),
        ('Operation("read", command="gate", meaning="open it")', "gate has no function"),
        ('Operation(read, command="gate", meaning="open it", examples=1)', "TypeError: can only join an iterable"),
        ('Operation(read, verb="/stop now", help="Stop.")', "/stop is taken"),
        ('Operation(read, verb="/if", help="Ask.")', "/if is taken"),
        ('Operation(read, verb="/gate off", help="Close.", extends=True)', "multidrop has no verb /gate to extend"),
        ('Operation(bare, verb="/gate", help="Open.")', "wide of bare has no annotation"),
        ('Operation(unknown, verb="/gate", help="Open.")',
         "the type of wide of unknown cannot be read: name 'Width' is not defined"),
        ('Operation(many, command="gate", meaning="open it")', "many has **wide, which no line can give"),
        ('Options("send", Twin)', "send takes no options of features; shell and tui do"),
        ('Options("shell", read)', "TypeError: must be called with a dataclass type or instance"),
        ('Operation(read, verb="/gate", help="Open."), Operation(read, verb="/gate", help="Open.")', "/gate is taken"),
        ('Lent("screen:", "a screen", read)', "relay screen: is taken"),
        ('EndpointKind("usbip", read)', "serve usbip: is taken"),
        ('Operation(to, verb="/plot", help="Plot.", extends=True)', "/plot --to is taken"),
        ('PlotTargets("", "", "", read, read)', "the place of plots outside the screen is taken"),
        ('Pictures({"Session": read}, read)', "the live picture is taken"),
        ("Options", "TypeError: adds has the class Options, not an instance of it"),
    ],
)  # fmt: skip
def test_what_is_there_already_is_refused_and_said(adds: str, why: str, tmp_path: Path, multidrop: Command) -> None:
    feature = ADDED_BY.get(adds.partition("(")[0], "")
    if feature and feature not in THERE:
        pytest.skip(f"the feature {feature} is not in this copy of the tree")
    imports = """
from dataclasses import dataclass
from multidrop.api.notebooks import Pictures
from multidrop.base.feature import Feature
from multidrop.shell.hooks import Options
from multidrop.shell.operations.operation import Operation
from multidrop.shell.plot_targets import PlotTargets
from multidrop.shell.relaying import Lent
from multidrop.shell.sections import Section
from multidrop.simulator.cell.endpoint_kinds import EndpointKind

def read(given=None):
    pass

def bare(call, wide):
    pass

def unknown(call, wide: "Width"):
    pass

def many(**wide):
    pass

def to(call, *, to: str = ""):
    pass

@dataclass(frozen=True, kw_only=True)
class Agreed:
    yes: bool = False

@dataclass(frozen=True, kw_only=True)
class Urls:
    urls: bool = False

@dataclass(frozen=True, kw_only=True)
class Twin:
    twin: bool = False

"""
    path = own(tmp_path, "gate", f'{imports}FEATURE = Feature("gate", "a gate", adds=({adds},))\n')
    done = multidrop("help", "MR")
    assert done.stderr == f"warning: the feature gate ({path}) cannot be loaded: {why}\n" and done.returncode == 0


ENDS = "async def gate(call):\n    raise KeyboardInterrupt"
VERB = """
from multidrop.base.feature import Feature
from multidrop.shell.operations.operation import Operation

print("imported")

def gate(call):
    call.session.output("open")

FEATURE = Feature("gate", "a gate", adds=(
    Operation(gate, verb="/gate", help="Open it."),
    Operation(lambda: 0, command="log gate", meaning="log it"),
))
"""


def test_a_verb_that_is_not_async_is_done(tmp_path: Path, multidrop: Command) -> None:
    own(tmp_path, "gate", VERB)
    done = multidrop("send", "sim:#press", "/gate")
    assert (done.returncode, done.stdout, done.stderr) == (0, "open\n", "imported\n")


def test_a_verb_that_interrupts_itself_is_one_line(tmp_path: Path, multidrop: Command) -> None:
    text = VERB.replace('print("imported")', "").replace('def gate(call):\n    call.session.output("open")', ENDS)
    own(tmp_path, "gate", text)
    done = multidrop("send", "sim:#press", "/gate")
    assert (done.returncode, done.stderr) == (2, "the feature gate failed at gate.py:8: KeyboardInterrupt\n")


def test_what_a_feature_prints_as_it_is_imported_is_no_reply(tmp_path: Path, multidrop: Command) -> None:
    own(tmp_path, "gate", VERB)
    done = multidrop("send", "sim:#press", "@a PR P")
    assert (done.returncode, done.stdout, done.stderr) == (0, "0\n", "imported\n")


def test_a_part_of_a_group_without_an_example_is_in_its_help(tmp_path: Path, multidrop: Command) -> None:
    own(tmp_path, "gate", VERB)
    done = multidrop("log", "--help")
    assert done.returncode == 0 and "multidrop log show" in done.stdout


def test_a_feature_of_the_wheel_that_cannot_be_imported_keeps_nothing_else_from_working(
    multidrop: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = registry.importlib.import_module

    def broken(name: str, *given: Any) -> Any:
        if name == "multidrop.features.sharing":
            raise SyntaxError("invalid syntax")
        return real(name, *given)

    monkeypatch.setattr(registry.importlib, "import_module", broken)
    wheel_unread(monkeypatch)
    used = multidrop("share", "sim:", "--rfc2217", "0")
    why = "the feature sharing cannot be loaded: SyntaxError: invalid syntax; install multidrop again, whole"
    assert (used.returncode, used.stdout, used.stderr) == (2, "", f"share: {why}\n")
    registry.warnings()
    wheel_unread(monkeypatch)
    warning = "the feature sharing (multidrop) cannot be loaded: SyntaxError: invalid syntax"
    sent = multidrop("send", "sim:#press", "@a PR P")
    assert (sent.returncode, sent.stdout) == (0, "0\n") and sent.stderr.count(warning) == 1
    listed = [json.loads(line) for line in multidrop("features", "--json").stdout.splitlines()]
    assert [each["state"] for each in listed if each["name"] == "sharing"] == [
        "cannot be loaded: SyntaxError: invalid syntax"
    ]
