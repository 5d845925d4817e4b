"""The `[[bus.drive]]` table of an MCode drive in a cell file."""

from __future__ import annotations

from difflib import get_close_matches
from functools import partial

from multidrop.dialects.mcode.manual.grammar import is_name
from multidrop.dialects.mcode.manual.table import Mnemonic, lookup, words
from multidrop.simulator.cell.identities import read_identity, read_variables
from multidrop.simulator.cell.reader import common_keys
from multidrop.simulator.cell.settings import Check, read_settings
from multidrop.simulator.cell.spec import DriveSpec, Value
from multidrop.simulator.cell.table import Folder, Table, quoted, shown
from multidrop.simulator.cell.worlds import KEYS, read_world
from multidrop.simulator.lexium.state.models import MODELS

KEY_OF = {"DN": "name", "PY": "party"}
"""Mnemonics that have a key of their own in the table."""


def read_drive(table: Table, folder: Folder) -> DriveSpec:
    """Read the table of one drive. Raises Diagnostic."""
    common = common_keys(table, folder)
    personality = common["personality"]
    name = table.text("name", "!")
    if not _can_be_a_name(name):
        raise table.wrong("name", f"cannot be {quoted(name)}", "valid: one of a-z, A-Z, 0-9 or !")
    points = MODELS[personality].points
    variables = table.table("variables", "[bus.drive.variables]")
    identity = table.table("identity", "[bus.drive.identity]")
    world = table.table("world", "[bus.drive.world]")
    world.only(*KEYS)
    return DriveSpec(
        **common,
        name=name,
        party=table.boolean("party", False),
        variables=read_variables(variables, partial(_can_be_a_variable, personality), "as in Q1"),
        identity=read_identity(identity, ("part", "version", "serial"), _counters(personality)),
        set=read_settings(table.table("set", "set"), _checker(personality)),
        world=read_world(world, points.inputs, points.analog),
    )


def _can_be_a_name(name: str) -> bool:
    return len(name) == 1 and name.isascii() and (name.isalnum() or name == "!")


def _can_be_a_variable(personality: str, name: str) -> bool:
    return is_name(name) and lookup(name, personality) is None and len(name) <= MODELS[personality].longest_name


def _counters(personality: str) -> dict[str, int]:
    """The keys of its counters, each of one axis."""
    known = words(personality)
    return {"position": 1} | {name: 1 for name in ("C1", "C2") if name in known and personality in known[name].products}


def _checker(personality: str) -> Check:
    def check(table: Table, word: str, value: Value) -> None:
        _check_value(table, word, value, _settable(table, word, personality))

    return check


def _settable(table: Table, word: str, personality: str) -> Mnemonic:
    """Find the row of a mnemonic that can be set. Raises Diagnostic."""
    if (key := KEY_OF.get(word.upper())) is not None:
        raise table.wrong(word, "has a key of its own", f'use "{key}"')
    row = lookup(word, personality)
    if row is None:
        settable = [name for name, each in words(personality).items() if "W" in each.access and name.isalnum()]
        near = get_close_matches(word.upper(), settable, n=1)
        hint = f'did you mean "{near[0]}"?' if near else ""
        raise table.wrong(quoted(word), f"is not an MCode mnemonic of an {personality}", hint)
    if "W" not in row.access:
        raise table.wrong(word, f"cannot be set ({row.title})")
    return row


def _check_value(table: Table, word: str, value: Value, row: Mnemonic) -> None:
    encoder = table.values.get("EE") == 1 and not table.values.get("AS")
    if isinstance(value, (int, float)) and not row.accepts(value, encoder):
        low, high = row.bounds(encoder)
        wanted = f"one of {', '.join(map(str, row.values))}" if row.values else f"from {low} to {high}"
        raise table.wrong(word, f"must be {wanted}, not {shown(value)}")
