"""The one table of simulated families. A new family is one row here.

A family is imported at the first use of one of its drives.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

from multidrop.base.errors import Diagnostic
from multidrop.base.on_demand import OnDemand

if TYPE_CHECKING:
    from multidrop.simulator.family import Family, Snapshots
    from multidrop.simulator.program_run import Programs


class Row(NamedTuple):
    """A family: the place of its record, its products by the names that a cell file gives them, and its programs."""

    record: str
    personalities: tuple[str, ...]
    programs: str = ""
    """The place of its `Programs`; empty: there are no program files."""


TABLE: Mapping[str, Row] = {
    "mcode": Row(
        "multidrop.families.lexium.simulator.family:MCODE",
        ("LMDOM", "LMDCM", "LMDOE", "LMDCE", "LMM", "MDI", "MDIE", "MDIX"),
        "multidrop.families.lexium.simulator.program_run:RUNS",
    ),
    "pmx": Row(
        "multidrop.families.pmx.simulator.family:PMX", ("PMX",), "multidrop.families.pmx.simulator.program_run:RUNS"
    ),
    "tmcl": Row(
        "multidrop.families.tmcl.simulator.family:TMCL",
        (
            "TMCM",
            "TMCM-1140",
            "TMCM-1141",
            "TMCM-1161",
            "TMCM-1240",
            "TMCM-1241",
            "TMCM-1260",
            "TMCM-1276",
            "TMCM-3110",
            "TMCM-6110",
            "TMCM-6214",
        ),
        "multidrop.families.tmcl.simulator.program_run:RUNS",
    ),
}
FAMILIES: Mapping[str, Family] = OnDemand({name: row.record for name, row in TABLE.items()})
"""By name."""
PROGRAMS: Mapping[str, Programs] = OnDemand({name: row.programs for name, row in TABLE.items() if row.programs})
"""The runs of program files, by the name of their family."""
BY_PERSONALITY: Mapping[str, Family] = OnDemand(
    {personality: row.record for row in TABLE.values() for personality in row.personalities}
)


def snapshots_of(family: Family) -> Snapshots:
    """Find how drives of a family become tables of a cell file, and back. Raises Diagnostic."""
    if family.snapshots is None:
        raise Diagnostic(f"the simulator has no snapshots of the family {family.name}")
    return family.snapshots


def family_of(personality: str) -> Family:
    return BY_PERSONALITY[personality]
