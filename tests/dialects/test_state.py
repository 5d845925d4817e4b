"""The host's knowledge of a drive changes by its named transitions only."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import fields

import pytest

from multidrop.families.lexium.host.mcode.state import MCodeState
from multidrop.families.lexium.host.modbus.codec import ModbusState
from multidrop.families.pmx.host.codec import PmxState
from tests.support.paths import sources

ROOMS = ("dialects", "families", "drives", "shell", "tui", "macros", "multidrop")
STATE_FILES = {"dialects/state.py", "families/lexium/host/mcode/state.py"} | {
    f"families/{place}/codec.py" for place in ("lexium/host/modbus", "pmx/host", "tmcl/host")
}
FIELDS = {each.name for cls in (MCodeState, ModbusState, PmxState) for each in fields(cls)} - {"label"}  # a person's
COMMON = {"name", "address", "restore", "running", "error", "notes", "remarks", "version", "codec"}
"""Fields whose names other classes have too: only an assignment to something called a state counts."""
MUTATORS = {"append", "clear", "extend", "insert", "pop", "remove"}


def is_state(owner: ast.expr) -> bool:
    """Whether an expression is called a drive's state."""
    name = owner.id if isinstance(owner, ast.Name) else owner.attr if isinstance(owner, ast.Attribute) else ""
    return name.strip("_") in ("state", "known")


def breaches(source: str) -> Iterator[str]:
    """The assignments to fields of a drive's state, and the calls that change its lists."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store | ast.Del) and node.attr in FIELDS:
            own = isinstance(node.value, ast.Name) and node.value.id == "self"
            if is_state(node.value) or (node.attr not in COMMON and not own):
                yield f"{node.lineno}: {ast.unparse(node)}"
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in MUTATORS:
            changed = node.func.value
            if isinstance(changed, ast.Attribute) and changed.attr in FIELDS and is_state(changed.value):
                yield f"{node.lineno}: {ast.unparse(node.func)}"


@pytest.mark.slow
def test_no_other_file_assigns_to_a_field_of_a_drives_state() -> None:
    found = {
        f"{name}:{each}"
        for name, path in sources(*ROOMS)
        if name not in STATE_FILES and "/simulator/" not in name
        for each in breaches(path.read_text(encoding="utf-8"))
    }
    assert found == set()


@pytest.mark.parametrize(
    "line",
    [
        "state.error = True",
        "self._state.reply_pending = True",
        "drive.state.settings_unknown |= True",
        "a, drive.programming = 1, True",
        "notes, state.notes = state.notes, []",
        "state.notes.append('x')",
        "del state.codec",
    ],
)
def test_an_assignment_is_found_however_it_is_written(line: str) -> None:
    assert len(list(breaches(line))) == 1
