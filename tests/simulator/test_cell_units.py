"""Positions of a cell's world with units: by the drive's scale without its zero, from the world's origin."""

from dataclasses import replace

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.dialects.units import Scale, scale
from multidrop.simulator import cells
from multidrop.simulator.cell.spec import DriveSpec, WorldSpec
from multidrop.simulator.cell.writer import BusText, DriveText, write
from tests.support.cases import for_each

HEAD = '[[bus]]\nname = "b"\n[[bus.drive]]\npersonality = "{}"\n'


def drive(lines: str, personality: str = "LMDCM") -> DriveSpec:
    return cells.read(HEAD.format(personality) + lines, "cell.toml").buses[0].drives[0]


@for_each(
    ["personality", "lines", "expected"],
    [
        # A turn has 51200 motor steps, whatever MS is (MCode reference 5.1.86); 301 mm are 60.2 turns of 5 mm.
        ("LMDCM", 'units = "5 mm/turn"\nworld = { stall_at = "301 mm" }', WorldSpec(stall_at=60.2 * 51200)),
        (
            "LMDCM",
            'units = "5 mm/turn"\nset = { MS = 10 }\nworld = { stall_at = "301 mm" }',
            WorldSpec(stall_at=60.2 * 51200),
        ),
        (
            "LMDCM",
            'units = "5 mm/turn"\nset = { EE = 1 }\nworld = { stall_at = "301 mm" }',
            WorldSpec(stall_at=60.2 * 51200),
        ),
        (
            "LMDCM",
            'units = { scale = "5 mm/turn", zero = "120 mm", travel = "0..300 mm" }\nworld = { limit_plus = "0.3 m" }',
            WorldSpec(limit_plus=60 * 51200),
        ),
        # Steps of the drive itself: 2000 a turn with MS=10, 4000 encoder counts with EE=1 (3.4.2).
        (
            "LMDCM",
            'units = "1 um/step"\nset = { MS = 10 }\nworld = { limit_minus = "-2 mm" }',
            WorldSpec(limit_minus=-51200),
        ),
        ("LMDCM", 'units = "1 um/step"\nset = { EE = 1 }\nworld = { stall_at = "4 mm" }', WorldSpec(stall_at=51200)),
        ("LMDCM", 'units = "-360 deg/turn"\nworld = { home = "90 deg" }', WorldSpec(home=-12800)),
        ("LMDCM", 'units = "-360 deg/turn"\nworld = { home = ["-90 deg", "0 deg"] }', WorldSpec(home=(0, 12800))),
        ("LMDCM", 'units = "5 mm/turn"\nworld = { home = [-2000, "1 mm"] }', WorldSpec(home=(-2000, 10240))),
        ("LMDCM", 'units = "5 mm/turn"\nworld = { stall_at = "2 mturn" }', WorldSpec(stall_at=102400)),
        # A pulse is a motor step; with StepNLoop a count is SLR pulses (PMX manual 7.17).
        ("PMX", 'units = "0.4 um/step"\nworld = { limit_plus = "4 mm" }', WorldSpec(limit_plus=10_000)),
        (
            "PMX",
            'units = { x = "1 um/step" }\nset = { SLX = 1, SLRX = 2.5 }\nworld = { x = { index = "4 mm" } }',
            WorldSpec(index=10_000),
        ),
        # 200 full steps of 256 motor steps, whatever parameter 140 is; a motor of 0.9 degrees has 400.
        ("TMCM", 'units = "5 mm/turn"\nset = { 140 = 4 }\nworld = { stall_at = "10 mm" }', WorldSpec(stall_at=102400)),
        ("TMCM", 'units = "1 um/step"\nset = { 140 = 4 }\nworld = { stall_at = "3.2 mm" }', WorldSpec(stall_at=51200)),
        (
            "TMCM",
            'units = { scale = "5 mm/turn", full_steps = 400 }\nworld = { stall_at = "10 mm" }',
            WorldSpec(stall_at=204800),
        ),
    ],
)
def test_positions_with_a_unit_are_motor_steps_by_the_scale(personality: str, lines: str, expected: WorldSpec) -> None:
    found = drive(lines, personality).world
    assert replace(found, stall_at=found.stall_at and round(found.stall_at, 6)) == expected


def test_each_axis_has_its_own_scale() -> None:
    worlds = '[bus.drive.world.x]\nhome = "5 mm"\n[bus.drive.world.y]\nhome = "9 deg"'
    spec = drive(f'units = {{ x = "1 um/step", y = "0.1 deg/step" }}\n{worlds}', "PMX")
    assert (spec.world.home, spec.further[0].home) == (5000, 90)
    modules = drive(
        'units = { 0 = "1 um/step", 1 = "2 um/step" }\nworld = { home = 7, 1 = { home = "5 mm" } }', "TMCM-6110"
    )
    assert (modules.world.home, modules.further[0].home) == (7, 5000 / 2)


@for_each(
    ["lines", "expected"],
    [
        (
            'world = { stall_at = "301 mm" }',
            'cell.toml:5: [[bus]] "b": [[bus.drive]] 1: [bus.drive.world]: stall_at: the drive has no scale; '
            'add units = "5 mm/turn" to its table',
        ),
        (
            'units = "5 mm/turn"\n[bus.drive.world]\nload = 0.3\nstall_at = "301 kg"',
            'cell.toml:8: [[bus]] "b": [[bus.drive]] 1: [bus.drive.world]: stall_at: no unit kg; '
            "valid: m, cm, mm, um, in, deg, rad, turn, mturn, each also with /s, /min or /s2, and rpm, mrpm",
        ),
        (
            'units = "5 mm/turn"\nworld = { home = ["1 mm", "90 deg"] }',
            'cell.toml:6: [[bus]] "b": [[bus.drive]] 1: [bus.drive.world]: home: '
            "90 deg: the scale of the axis is 5 mm/turn; valid: mm and units of its kind",
        ),
        (
            'units = "5 mm/turn"\nworld = { home = ["5 mm", "-5 mm"] }',
            'cell.toml:6: [[bus]] "b": [[bus.drive]] 1: [bus.drive.world]: home must go up, not from 51200 to -51200',
        ),
        (
            'units = "0 mm/turn"',
            "cell.toml:5: [[bus]] \"b\": [[bus.drive]] 1: units: '0 mm/turn': the scale is zero; "
            "valid: any other number; its sign gives the direction",
        ),
        (
            'units = "2,5 mm/turn"',
            'cell.toml:5: [[bus]] "b": [[bus.drive]] 1: units: 2,5 mm/turn: a number has no comma; '
            "write 2.5, as in 2.5 mm/turn",
        ),
        (
            'units = { x = "5 mm/turn" }',
            'cell.toml:5: [[bus]] "b": [[bus.drive]] 1: units: no axis "x"; as in units = "5 mm/turn"',
        ),
    ],
)
def test_a_wrong_scale_or_position_is_one_line_with_file_and_line(lines: str, expected: str) -> None:
    with pytest.raises(Diagnostic) as raised:
        drive(lines)
    assert str(raised.value) == expected


def test_nothing_tells_the_pulses_of_a_turn_of_a_pmx() -> None:
    with pytest.raises(Diagnostic) as raised:
        drive('units = "5 mm/turn"\nworld = { home = "5 mm" }', "PMX")
    assert "a PMX does not tell the pulses of a turn" in str(raised.value)


def test_the_line_is_that_of_the_drive_that_is_wrong() -> None:
    text = HEAD.format("LMDCM") + 'party = true\nunits = "5 mm/turn"\n[bus.drive.world]\nhome = "1 mm"\n'
    text += '[[bus.drive]]\npersonality = "LMDCM"\nname = "a"\nparty = true\n[bus.drive.world]\nhome = "1 mm"\n'
    with pytest.raises(Diagnostic, match=r'^cell.toml:14: \[\[bus\]\] "b": \[\[bus.drive\]\] 2: '):
        cells.read(text, "cell.toml")


def test_own_units_are_words_that_the_cell_declares() -> None:
    lines = HEAD.format("LMDCM") + 'units = "0.5 pallet/turn"\nworld = { stall_at = "2 pallet" }'
    (spec,) = cells.read(f'own_units = ["pallet"]\n{lines}').buses[0].drives
    assert spec.world.stall_at == 4 * 51200
    with pytest.raises(Diagnostic, match="no unit pallet"):
        cells.read(lines)
    with pytest.raises(Diagnostic, match=r"^cell.toml:1: own_units: 'mm' is no name of an own unit"):
        cells.read('own_units = ["mm"]', "cell.toml")


@for_each(
    ["personality", "scales"],
    [
        ("LMDCM", {"": scale("5 mm/turn")}),
        ("LMDCM", {"": scale("-0.5 pallet/turn", ["pallet"])}),
        (
            "PMX",
            {
                "x": scale("0.4 um/step"),
                "y": scale({"scale": "-1 deg/step", "zero": "12 deg", "travel": "-90..90 deg"}),
            },
        ),
        ("TMCM", {"": scale({"scale": "2.5 mm/turn", "full_steps": 400})}),
    ],
)
def test_a_written_scale_is_read_again(personality: str, scales: dict[str, Scale]) -> None:
    name = {"PMX": "00", "TMCM": "1"}.get(personality, "a")
    text = write([BusText("b", [DriveText(personality, name, units=scales)])])
    assert dict(cells.read(text).buses[0].drives[0].units) == scales
