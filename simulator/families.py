"""The one table of simulated families. A new family is one line here."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from simulator.family import Family
from simulator.lexium.family import MCODE
from simulator.pmx.family import PMX
from simulator.tmcl.family import TMCL

FAMILIES: Mapping[str, Family] = MappingProxyType({each.name: each for each in (MCODE, PMX, TMCL)})
"""By name."""

_BY_PERSONALITY = {personality: each for each in FAMILIES.values() for personality in each.personalities}


def family_of(personality: str) -> Family:
    """Find the family of a personality."""
    return _BY_PERSONALITY[personality]
