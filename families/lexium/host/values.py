"""What Lexium drives have in common of what is read of them: set-ups, a snapshot, the controls of the axis."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from multidrop.dialects.controls import Controls, Homing, controls_of
from multidrop.dialects.values import Actions, Levels, Readings, Snapshot, Value, Values
from multidrop.families.lexium.manual import points
from multidrop.families.lexium.manual.mnemonic import EXPANDED
from multidrop.families.lexium.manual.points import EXPANDED_INPUTS, INPUTS
from multidrop.families.lexium.manual.statements import UNNAMED

SNAPSHOT_WORDS = ("P", "C1", "C2", "V", "BY", "IN", "I5")
"""The words of the state, as far as the product has them."""
OUTPUT_TYPES = range(16, 30)
"""Types of a point that is not an input (MDrivePlus: S<n>)."""


def number_in(readings: Readings, name: str) -> int:
    value = readings.values.get(name, 0)
    return value if isinstance(value, int) else 0


def rows_of_list(word: str, numbers: Sequence[int], lines: Sequence[str]) -> dict[str, Value]:
    """The set-ups in the lines of PR IS, OS or LS, by number."""
    values: dict[str, Value] = {}
    for line in lines:
        row = re.fullmatch(rf"{word} *= *(\d+) *((?:, *-?\d+)+)", line.strip())
        if row is not None and int(row[1]) in numbers:
            values[f"{word}{int(row[1])}"] = tuple(int(number) for number in row[2].split(",")[1:])
    return values


class LexiumValues(Values):
    """What is read of a Lexium drive over any protocol."""

    @property
    def actions(self) -> Actions:
        return points.LexiumActions(self.state)

    def controls(self, axis: str) -> Controls:
        """The one axis has the same over any protocol. (MCode reference 5.1.30, 5.1.54, 5.1.80, 5.1.84, 5.1.117.)"""
        return controls_of(points.__file__)

    def homings(self, axis: str) -> Sequence[Homing]:
        return points.homings(axis)

    def snapshot_of(self, readings: Readings, now: Mapping[str, int]) -> Snapshot:
        """Make the record of a drive from its settings and its state of the moment, by word."""
        state = self.state
        remarks = []
        if now["V"]:
            remarks.append(f"moving at V={now['V']} while it was read: its position is one of that moment")
        if now["BY"]:
            remarks.append("a program ran while it was read")
        inputs = EXPANDED_INPUTS if state.product in EXPANDED else INPUTS
        types = {name: held for name, held in readings.values.items() if isinstance(held, tuple)}
        outputs = {n for n in inputs if types.get(f"S{n}", (0,))[0] in OUTPUT_TYPES}
        levels = Levels("IN", tuple((n, bit) for bit, n in enumerate(inputs) if n not in outputs))
        counts = number_in(readings, "EE") and not number_in(readings, "AS")
        other = "C1" if counts else "C2"
        return Snapshot(
            kind="mcode",
            product=state.product,
            part=state.part,
            version=state.version,
            serial=state.serial,
            name=UNNAMED,
            readings=readings,
            counters=({"position": (now["P"],)} | ({other: (now[other],)} if other in now else {})),
            inputs=levels.of(now["IN"]),
            levels=levels,
            active=bool(now["V"] or now["BY"]),
            analog=(now["I5"],) if "I5" in now else (),
            remarks=tuple(remarks),
        )
