"""Conversions worked by hand from the manuals, from a typed quantity to the value that the simulated drive holds.

A turn has 200 full steps of MS microsteps (MCode reference 5.1.85), or 4000 encoder counts with EE=1 (5.1.36, 3.4.2);
in TMCL 2^140 microsteps a full step, and in units of a TMC429 a velocity v is 16 MHz * v / (2^154 * 2048 * 32)
microsteps/s (TMCL, axis parameters 140, 153, 154); a PMX counts pulses, or encoder counts with StepNLoop (7.17).
"""

from __future__ import annotations

from pathlib import Path

import pytest

from multidrop.shell.events import Printed
from tests.support.cases import for_each
from tests.support.cell_session import CellSession, bus, drive

pytestmark = pytest.mark.virtual


@for_each(
    ["personality", "table", "typed", "read", "expected"],
    [
        # 51200 steps of 5 mm: 12.5 mm are 2.5 turns; 50 mm/s 10 turns/s; 2 m/s2 400 turns/s2.
        ("LMDCM", 'units = "5 mm/turn"', "MR {12.5 mm}", "PR P", "128000"),
        ("LMDCM", 'units = "5 mm/turn"', "VM={50 mm/s}", "PR VM", "512000"),
        ("LMDCM", 'units = "5 mm/turn"', "A={2 m/s2}", "PR A", "20480000"),
        ("LMDCM", 'units = "5 mm/turn"', "VM={300 mrpm}", "PR VM", "256000"),
        ("LMDCM", 'units = "-360 deg/turn"', "MR {90 deg}", "PR P", "-12800"),
        ("LMDCM", 'units = "-360 deg/turn"', "VM={300 rpm}", "PR VM", "256000"),
        ("LMDCM", 'units = { scale = "5 mm/turn", zero = "120 mm" }', "MA {100 mm}", "PR P", "-204800"),
        # 10 microsteps a full step: 2000 a turn.
        ("LMDCM", 'units = "5 mm/turn"\nset = { MS = 10, EM = 1 }', "MR {12.5 mm}", "PR P", "5000"),
        # 4000 counts a turn.
        ("LMDCM", 'units = "5 mm/turn"\nset = { EE = 1 }', "MR {12.5 mm}", "PR P", "10000"),
        ("LMDCM", 'units = "5 mm/turn"\nset = { EE = 1 }', "VM={50 mm/s}", "PR VM", "40000"),
        # A module in microsteps/s; 16 microsteps and 400 full steps: 6400 a turn.
        ("TMCM-1241", 'units = "5 mm/turn"', "MVP REL, 0, {12.5 mm}", "GAP 1, 0", "128000"),
        ("TMCM-1241", 'units = "5 mm/turn"', "SAP 4, 0, {50 mm/s}", "GAP 4, 0", "512000"),
        (
            "TMCM-1241",
            'units = { scale = "5 mm/turn", full_steps = 400 }\nset = { 140 = 4 }',
            "MVP ABS, 0, {10 mm}",
            "GAP 1, 0",
            "12800",
        ),
        # A TMC429: 3200 microsteps a turn; 60 rpm are 3200/s = v * 16e6 / (2^3 * 65536), so v = 104.86.
        (
            "TMCM-1140",
            'units = "1 turn/turn"\nset = { 140 = 4, 154 = 3 }',
            "SAP 4, 0, {60 rpm}",
            "GAP 4, 0",
            "105",
        ),
        # a = 16e6^2 * n / 2^(153 + 154 + 29): 10 turns/s2 are 32000 microsteps/s2 = n * 16e6^2 / 2^(7 + 3 + 29).
        (
            "TMCM-1140",
            'units = "1 turn/turn"\nset = { 140 = 4, 153 = 7, 154 = 3 }',
            "SAP 5, 0, {10 turn/s2}",
            "GAP 5, 0",
            "69",
        ),
        ("PMX", 'units = "0.4 um/step"', "X{4 mm}", "PX", "10000"),
        ("PMX", 'units = "0.4 um/step"', "HSPDX={10 mm/s}", "HSPDX", "25000"),
    ],
)
async def test_a_quantity_is_the_number_that_the_manual_gives(
    personality: str, table: str, typed: str, read: str, expected: str, tmp_path: Path
) -> None:
    name = {"LMDCM": "a", "PMX": "00"}.get(personality, "1")
    own = drive(personality, name, table, party=personality == "LMDCM")
    async with CellSession(tmp_path, bus("line", own)) as shop:
        for line in ("ABS", "X0") if personality == "PMX" else ():
            await shop.session.run(line)
        await shop.session.run(typed)
        await shop.session.run("/wait stopped")
        shop.events.clear()
        await shop.session.run(read)
        assert [each.text for each in shop.events if isinstance(each, Printed)] == [expected]
