"""What sets the MCode products apart besides their words, which the tables of the dialect have: one record for each.

Points: a Lexium has four inputs (IS) and three outputs (OS); a terminal of an MDrivePlus is either (S<n>), and begins
as an input. Both number them from 1; 5 is the analog input and 6 the encoder's index mark. Lexium: MCode reference 3.4,
5.1.64 to 5.1.66, 5.1.93, 7.2. MDrivePlus: reference of 2012, 3.4.3, 5-63 to 5-67, 7.2.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from multidrop.families.lexium.manual.point_types import POINTS

STEP_DIRECTION, QUADRATURE, UP_DOWN = "step and direction", "quadrature", "up and down"

Types = Mapping[int, frozenset[int]]
"""The types that each point takes."""


class Points(NamedTuple):
    """Inputs and outputs of a product. `input_types` lacks an analog input that cannot be set up.

    `fresh` are the set-ups from the factory, of inputs and of points that are either; `shared`: points are either, and
    `sources` where an output may also source. `clocks` are the two inputs of a clock, `clock_types` what its types
    mean; `follow` is the flag that switches it on. `low` and `high` are the points of the groups that are read and
    written at once. `analog` is the most that the analog input reads, `live_zero` the most for 4 to 20 mA.
    """

    inputs: tuple[int, ...] = (1, 2, 3, 4)
    outputs: tuple[int, ...] = (1, 2, 3)
    input_types: Types = MappingProxyType({})
    output_types: Types = MappingProxyType({})
    fresh: Mapping[int, tuple[int, ...]] = MappingProxyType({})
    shared: bool = False
    sources: bool = False
    clocks: tuple[int, ...] = ()
    clock_types: Mapping[int, str] = MappingProxyType({})
    follow: str = "FL"
    capture: int = 12
    low: tuple[int, ...] = (1, 2, 3, 4)
    high: tuple[int, ...] = ()
    analog: int = 4095
    live_zero: int = 3200


def _points(group: str, like: Points) -> Points:
    """The points of a group of products: the types that each takes, and its set-up from the factory."""
    table = POINTS[group]
    return like._replace(
        input_types={n: each.inputs for n, each in table.items() if each.inputs},
        output_types={n: each.outputs | each.hmt for n, each in table.items() if each.outputs},
        fresh={n: each.fresh for n, each in table.items()},
    )


_CLOCKS = {13: STEP_DIRECTION, 14: QUADRATURE, 15: UP_DOWN}
LEXIUM_POINTS = _points("lexium", Points(clocks=(3, 4), clock_types=_CLOCKS))
MODULE_POINTS = _points("module", LEXIUM_POINTS)
_BASE, _EXPANDED = (1, 2, 3, 4), (9, 10, 11, 12)
MDRIVE_POINTS = _points(
    "mdrive", Points(outputs=_BASE, shared=True, follow="CM", capture=60, analog=1023, live_zero=800)
)
EXPANDED_POINTS = _points(
    "expanded",
    MDRIVE_POINTS._replace(
        inputs=(*_BASE, *_EXPANDED, 7, 8, 13),
        outputs=(*_BASE, *_EXPANDED, 7, 8, 13),
        sources=True,
        clocks=(7, 8),
        clock_types={33: STEP_DIRECTION, 34: QUADRATURE, 35: UP_DOWN},
        high=_EXPANDED,
    ),
)


class Model(NamedTuple):
    """One product. What it prints of itself; how it differs in time, motion and programs.

    `codes` are the errors that it gives in place of a Lexium's. `single_supply`: +V is the only supply.
    `per_microstep` bounds VM and SL by MS, steps/s; `disabled_moves`: with DE=0 moves are counted, not refused.
    `free_ms`: EE=1 leaves MS alone. `settles`: MV and MP last until MT is over; `holds_without_ht`: HT=0 alone keeps
    the run current. `compute` is the time before MA and MR begin, s; `tries` how often the end of a move is corrected.
    `trips_on_steps`: TP is in motor steps with EE=1 too. `floating`: it has floating point and its functions.
    `longest_name` counts characters; `name_codes`: DN takes a code. `break_here`: BP alone breaks a program.
    `clears_variables`: CP takes the 0/1 form and S; `clear_ends_handler`: CP of everything ends OE too.
    `lasting_programs`: they are in NVM as they are typed.
    `waits_to_print`: a program waits while the transmitter is full, which loses nothing then.
    `prompts_at_start`: a prompt follows the sign-on. `captures_relative`: TR sets PC too, TP does not.
    `flags_by_nak`: with a checksum the drive carries a line out and replies NAK while an error is set.
    `wakes_by_line`: in party mode the first line is carried out, too; its LF is the one that party mode waits for.
    `echoes_before_value`: a LF right behind the CR of a line is given back before what the line prints, not after it.
    """

    version: str
    part: str
    sign_on: str = "Copyright\xa9 2010 Schneider Electric Motion USA\r\n"
    points: Points = LEXIUM_POINTS
    ethernet: bool = False
    auxiliary: bool = True
    single_supply: bool = False
    codes: Mapping[int, int] = MappingProxyType({})
    encoder_lines: int = 1000
    per_microstep: int | None = 10000
    disabled_moves: bool = False
    free_ms: bool = False
    settles: bool = False
    holds_without_ht: bool = False
    compute: float = 0.0
    tries: int = 1
    trips_on_steps: bool = False
    floating: bool = True
    longest_name: int = 3
    name_codes: bool = False
    break_here: bool = True
    clears_variables: bool = True
    clear_ends_handler: bool = False
    lasting_programs: bool = False
    waits_to_print: bool = False
    prompts_at_start: bool = False
    captures_relative: bool = False
    flags_by_nak: bool = False
    wakes_by_line: bool = False
    echoes_before_value: bool = False


def _lexium(name: str, *, ethernet: bool = False) -> Model:
    return Model(version=f"{name} 6.002, Hw: 3.2", part=f"{name}571", ethernet=ethernet)


MODULE = _lexium("LMMCM")._replace(part="LMMCM15", points=MODULE_POINTS, auxiliary=False, free_ms=True)
"""The Motion Module prints LMMCM as its product (5.1.141). No manual shows its part number."""


MDRIVE = Model(
    version="3.010",
    part="MDI1FRD23A7",
    sign_on="Copyright\xa9 2001-2009 by Intelligent Motion Systems, Inc.\r\n",
    points=MDRIVE_POINTS,
    auxiliary=False,
    single_supply=True,
    codes={60: 20},
    encoder_lines=512,
    per_microstep=None,
    disabled_moves=True,
    settles=True,
    holds_without_ht=True,
    compute=0.0025,
    tries=3,
    trips_on_steps=True,
    floating=False,
    longest_name=2,
    name_codes=True,
    break_here=False,
    clears_variables=False,
    clear_ends_handler=True,
    lasting_programs=True,
    waits_to_print=True,
    prompts_at_start=True,
    captures_relative=True,
    flags_by_nak=True,
    wakes_by_line=True,
    echoes_before_value=True,
)

MODELS: Mapping[str, Model] = {
    "LMDOM": _lexium("LMDOM"),
    "LMDCM": _lexium("LMDCM"),
    "LMDOE": _lexium("LMDOE", ethernet=True),
    "LMDCE": _lexium("LMDCE", ethernet=True),
    "LMM": MODULE,
    "MDI": MDRIVE,
    "MDIE": MDRIVE._replace(part="MDI1FRD23A7-EQ"),
    "MDIX": MDRIVE._replace(part="MDI3CRL23C7-EQ", points=EXPANDED_POINTS),
}
"""By personality."""
