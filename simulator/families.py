"""The simulated drives, as the families declare them (`multidrop.families.NAME.FAMILY`).

Their code is imported at the first use of one of the drives.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from multidrop.base.on_demand import OnDemand
from multidrop.simulator.declared import simulated

if TYPE_CHECKING:
    from multidrop.simulator.family import SimulatedFamily
    from multidrop.simulator.program_run import ProgramRun


def _personalities() -> dict[str, str]:
    return {personality: family.record for family in simulated().values() for personality in family.personalities}


FAMILIES: Mapping[str, type[SimulatedFamily]] = OnDemand(
    lambda: {name: family.record for name, family in simulated().items()}
)
"""By name."""
PROGRAMS: Mapping[str, type[ProgramRun]] = OnDemand(
    lambda: {name: family.programs for name, family in simulated().items() if family.programs}
)
"""The runs of program files, by the name of their family."""
BY_PERSONALITY: Mapping[str, type[SimulatedFamily]] = OnDemand(_personalities)


def family_of(personality: str) -> type[SimulatedFamily]:
    return BY_PERSONALITY[personality]
