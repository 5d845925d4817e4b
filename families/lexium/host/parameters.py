"""The settings of a Lexium drive, as they are planned over any protocol: its rules are those of MCode."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from multidrop.dialects.values import Change, Parameters, Readings, Value
from multidrop.families.lexium.manual import parameter_plan
from multidrop.families.lexium.manual.groups import SCALES, WIRE


class LexiumParameters(Parameters):
    """The settings of a Lexium drive; a protocol reads and saves them in its own way."""

    language = "MCode"

    def impossible(self, name: str, value: Value, present: Readings) -> str:
        return parameter_plan.impossible(name, value, present.values, present.labels)

    def communicates(self, name: str) -> bool:
        return name in WIRE

    def risk(self, name: str, value: Value, now: Mapping[str, Value]) -> str:
        return parameter_plan.risk(name, value, now)

    def rescales(self, name: str) -> bool:
        return name in SCALES

    def steps(
        self, present: Readings, wanted: Mapping[str, Value], withheld: Mapping[str, str], cannot: dict[str, str]
    ) -> Sequence[Change]:
        return parameter_plan.steps(self.state.product, present, wanted, withheld, cannot)
