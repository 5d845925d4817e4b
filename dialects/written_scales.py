"""A scale as files have it, and as a person reads it: what one turn of the motor, or one step, is."""

from __future__ import annotations

from multidrop.dialects.units import TURN, Basis, Measure, Scale, Takes, decimal

UNIT_PLACES = 9
"""Decimal places of what one turn or step is."""


def written(scale: Scale) -> dict[str, str | int]:
    """Return the table from which `units.scale` reads the scale again; with `scale` alone, its text is enough."""
    table: dict[str, str | int] = {"scale": str(scale)}
    if scale.zero or (scale.anchored and scale.travel is None):
        table["zero"] = scale.shown(scale.zero)
    if scale.travel is not None:
        table["travel"] = scale.shown_travel
    if scale.full_steps is not None:
        table["full_steps"] = scale.full_steps
    return table


def preview(scale: Scale, basis: Basis | None, count: str = "step") -> str:
    """Return what a scale means: `one turn = 5 mm = 51200 steps, 1 mm = 10240 steps`.

    `basis`: what the drive reports; None: it is not read. `count`: the drive's own count, in the singular. Raises
    Diagnostic for a scale that the drive cannot use.
    """
    one = f"{decimal(scale.value, UNIT_PLACES)} {scale.unit.name}"
    if scale.of != TURN:
        measure = Measure(scale, basis or Basis())
        return f"one {count} = {one}, {_per_unit(measure, count)}"
    if basis is None:
        return f"one turn = {one}; the {count}s of a turn are not read yet"
    measure = Measure(scale, basis)
    turn = f"{float(basis.turn or 0):.9g} {count}s"
    assumed = f" ({basis.assumed})" if basis.assumed else ""
    return f"one turn = {one} = {turn}{assumed}, {_per_unit(measure, count)}"


def _per_unit(measure: Measure, count: str) -> str:
    number = 1 / abs(measure.value(1, Takes.DISTANCE))
    return f"1 {measure.unit} = {number:.9g} {count}s"
