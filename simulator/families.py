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
    return {personality: each.record for each in simulated().values() for personality in each.personalities}


FAMILIES: Mapping[str, type[SimulatedFamily]] = OnDemand(
    lambda: {name: each.record for name, each in simulated().items()}
)
"""By name."""
PROGRAMS: Mapping[str, type[ProgramRun]] = OnDemand(
    lambda: {name: each.programs for name, each in simulated().items() if each.programs}
)
"""The runs of program files, by the name of their family."""
BY_PERSONALITY: Mapping[str, type[SimulatedFamily]] = OnDemand(_personalities)


def family_of(personality: str) -> type[SimulatedFamily]:
    return BY_PERSONALITY[personality]
