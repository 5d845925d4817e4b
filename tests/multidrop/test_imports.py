"""What a command imports: nothing that it does not need, as the wait before its first output is time of every user."""

import importlib
import subprocess
import sys

import pytest

from multidrop.dialects.families import dialects
from multidrop.simulator.declared import simulated
from tests.support.paths import ROOT
from tests.support.processes import environment, names_of_packages
from tests.support.until import PATIENCE

SCREENS = {"textual", "rich", "prompt_toolkit"}
PLOTS = {"rerun", "numpy", "pyarrow"}
EDITORS = {"pygls", "lsprotocol", "attrs", "cattrs"}
HEAVY = SCREENS | PLOTS | EDITORS | {"pymodbus", "tomlkit", "importlib.metadata"}
LOOP = {"asyncio", "socket", "ssl", "logging", "subprocess", "concurrent.futures"}
HOSTS = {place.record.partition(":")[0] for place in dialects().values()} | {
    "multidrop.drives.bus",
    "multidrop.shell.session",
}
SIMULATORS = {place.record.partition(":")[0] for place in simulated().values()} | {"multidrop.simulator.floor"}
NO_LINE = HEAVY | LOOP | HOSTS | SIMULATORS | {"serial"}
MCODE = {"multidrop.families.lexium.host.mcode.family"}
OTHERS = HOSTS - MCODE - {"multidrop.drives.bus", "multidrop.shell.session"}
VERBS = {
    "multidrop.shell.plots",
    "multidrop.shell.programs.transfers",
    "secrets",
    "hashlib",
    "difflib",
    "tempfile",
}

TABLE = {
    ("--version",): NO_LINE | {"json", "pathlib"},
    ("--help",): NO_LINE,  # it lists the commands by others, as that of a command its options by others
    ("send", "--help"): NO_LINE,
    ("program", "check", "a.mxt"): NO_LINE
    | {
        "json",
        "pathlib",
        "tomllib",
        "platformdirs",
        "multidrop.families.pmx.host",
        "multidrop.families.tmcl.host",
        "multidrop.families.lexium.host.modbus",
    }
    | {
        "multidrop.families.lexium.host.mcode",
        "multidrop.families.pmx.simulator",
        "multidrop.families.tmcl.simulator",
        "multidrop.families.lexium.simulator.ports",
        "multidrop.simulator.wire",
    },
    ("program", "check", "a.prg"): NO_LINE
    | {"multidrop.families.lexium.simulator", "multidrop.families.lexium.host.mcode", "multidrop.families.pmx.host"},
    ("program", "test", "a.mxt"): NO_LINE
    | {
        "platformdirs",
        "multidrop.families.pmx.host",
        "multidrop.families.lexium.host.mcode",
        "multidrop.families.pmx.simulator",
    },
    ("lsp", "--help"): NO_LINE,
    ("program", "sweep", "a.mxt"): HEAVY
    | {"socket", "ssl", "asyncio", "serial", "multidrop.families.pmx.host", "multidrop.families.pmx.simulator"}
    | {"concurrent.futures", "distributed", "dask"}
    | HOSTS,
    # libusb1 imports subprocess and json
    ("ports",): NO_LINE - {"serial", "subprocess"} | {"platformdirs", "multidrop.families.lexium.host.mcode"},
    ("completion", "bash"): NO_LINE | {"platformdirs", "multidrop.families.lexium.host.mcode"},
    ("macro", "list"): HEAVY | LOOP | HOSTS | SIMULATORS | {"serial"},
    ("send", "tcp://127.0.0.1:1", "PR P"): HEAVY | OTHERS | SIMULATORS | VERBS | {"serial"},
    ("send", "/dev/does-not-exist", "PR P"): HEAVY | OTHERS | SIMULATORS | VERBS | {"serial.tools.list_ports"},
    ("send", "sim:a.toml", "PR P"): HEAVY
    | OTHERS
    | {"serial", "multidrop.families.pmx.simulator", "multidrop.families.tmcl.simulator"},
    ("relay", "/dev/does-not-exist"): HEAVY | LOOP | HOSTS | SIMULATORS | VERBS | {"json", "platformdirs"},
    ("publish", "sim:", "--to", "http://broker"): HEAVY | SIMULATORS | VERBS | {"serial", "paho"},
    ("share", "/dev/does-not-exist", "--rfc2217", "0"): HEAVY | OTHERS | SIMULATORS | {"multidrop.shell.session"},
    ("sim", "gone.toml"): HEAVY
    | HOSTS
    | {"serial", "multidrop.families.pmx.simulator.family", "multidrop.families.lexium.simulator.family"},
}
"""For each command the modules that it must not import."""
CHILD = """
import sys
arguments = sys.argv[1:]
from multidrop.__main__ import main
main(arguments)
print("\\nIMPORTED", *sys.modules)
"""
CELL = '[[bus]]\nname = "w"\nbaud = 0\n[[bus.drive]]\npersonality = "LMDCM"\n'


@pytest.mark.process
@pytest.mark.parametrize("command", TABLE, ids=" ".join)
def test_a_command_imports_nothing_that_it_does_not_need(command, tmp_path):
    (tmp_path / "a.mxt").write_text("PG 1\nLB G1\n MR 51200\n H\nE\nPG\n")
    (tmp_path / "a.prg").write_text("V1=5\nEND\n")
    (tmp_path / "a.toml").write_text(CELL)
    names_of_packages(tmp_path)
    done = subprocess.run(
        [sys.executable, "-c", CHILD, *command],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        cwd=tmp_path,
        env=environment(tmp_path),
    )
    imported = set(done.stdout.rpartition("IMPORTED")[2].split())
    assert "multidrop.cli" in imported, done.stderr
    assert sorted(imported & TABLE[command]) == []


def test_the_table_names_modules():
    ours = {name for names in TABLE.values() for name in names if (ROOT / name.partition(".")[0]).is_dir()}
    assert "multidrop.drives.bus" in ours
    for name in sorted(ours):
        importlib.import_module(name)
