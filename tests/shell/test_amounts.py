"""Amounts as a person types them: with a unit, or as the drive counts. A wrong one gets one line that says why."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.dialects.units import Takes
from multidrop.shell.amounts import AmountReader
from tests.support.fake_session import FakeDrive, FakeUnits


def reader(scale: str = "5 mm/turn", *, referenced: bool = True) -> AmountReader:
    """Read for an axis of 51200 steps a turn; an empty scale: it has none."""
    units, drive = FakeUnits(), FakeDrive("a", unreferenced=frozenset() if referenced else frozenset({""}))
    if scale:
        units.give("a", scale)
    return AmountReader(units, drive, "", "steps")  # type: ignore[arg-type]


@pytest.mark.parametrize("text", ["1 mm", "1mm", "{1 mm}", " {1mm} ", "+1 mm", "1.0 mm", "1  mm"])
def test_an_amount_in_a_unit_is_one_however_it_is_written(text: str) -> None:
    amount = reader().read(text, Takes.DISTANCE)
    assert (amount.number, amount.text, amount.typed) == (10240, "{1 mm}", "1 mm")
    assert reader().other(amount, Takes.DISTANCE) == "10240 steps"


@pytest.mark.parametrize("text", ["10240", "+10240", "{10240}", "10240 steps", "10240 step"])
def test_a_plain_number_is_the_drives_own(text: str) -> None:
    amount = reader().read(text, Takes.DISTANCE)
    assert (amount.number, amount.text, amount.typed) == (10240, "10240", "10240")
    assert reader().other(amount, Takes.DISTANCE) == "1 mm"
    assert reader("").other(amount, Takes.DISTANCE) == ""


@pytest.mark.parametrize(
    ("text", "takes", "why"),
    [
        ("", Takes.DISTANCE, "nothing was typed"),
        ("mm", Takes.DISTANCE, "mm is no number with a unit"),
        ("1 mm 2", Takes.DISTANCE, "is no number with a unit"),
        ("1 furlong", Takes.DISTANCE, "no unit furlong"),
        ("1,5 mm", Takes.DISTANCE, "a number has no comma"),
        ("1.5", Takes.DISTANCE, "1.5 has no unit, and steps are whole"),
        ("99999999999", Takes.DISTANCE, "99999999999 is out of range"),
        ("999999999999999999999", Takes.DISTANCE, "is no number with a unit"),
        ("900000 m", Takes.DISTANCE, "for the drive"),
        ("0.00001 mm", Takes.DISTANCE, "after rounding"),
        ("1 mm/s", Takes.DISTANCE, "1 mm/s is a velocity, not a distance"),
        ("1 deg", Takes.DISTANCE, "the scale of the axis is 5 mm/turn"),
        ("1 mm", Takes.SPEED, "1 mm is a distance, not a velocity"),
        ("-1", Takes.SPEED, "it takes a velocity without sign"),
        ("MR 5", Takes.DISTANCE, "MR 5 is no number with a unit"),
    ],
)
def test_a_wrong_amount_gets_one_line(text: str, takes: Takes, why: str) -> None:
    with pytest.raises(Diagnostic) as problem:
        reader().read(text, takes)
    assert why in problem.value.message
    assert "\n" not in str(problem.value)


def test_an_axis_without_a_scale_takes_no_unit_and_says_how_it_gets_one() -> None:
    with pytest.raises(Diagnostic) as problem:
        reader("").read("1 mm", Takes.DISTANCE)
    assert (problem.value.message, problem.value.hint) == (
        "1 mm: the axis has no scale",
        "type steps, or give it a scale: /setup",
    )
    assert reader("").asks(Takes.DISTANCE) == "steps, such as 10240"


def test_a_place_needs_a_reference_and_a_distance_does_not() -> None:
    lost = reader(referenced=False)
    with pytest.raises(Diagnostic, match="the position is not referenced"):
        lost.read("1 mm", Takes.PLACE)
    assert lost.read("1 mm", Takes.DISTANCE).number == 10240
    assert lost.read("5", Takes.PLACE).number == 5


def test_the_levels_are_powers_of_ten_in_the_same_unit() -> None:
    scaled, plain = reader(), reader("")
    assert scaled.read("1 mm", Takes.DISTANCE).level(1) == "10 mm"
    assert scaled.read("1 mm", Takes.DISTANCE).level(-1) == "0.1 mm"
    assert scaled.read("2.5 mm", Takes.DISTANCE).level(-1) == "1 mm"
    assert plain.read("5", Takes.DISTANCE).level(-1) == "1"
    assert plain.read("1", Takes.DISTANCE).level(-1) == "1"


@given(st.text(max_size=30))
def test_any_text_is_an_amount_or_has_one_line_why_not(text: str) -> None:
    for scale in ("5 mm/turn", ""):
        try:
            amount = reader(scale).read(text, Takes.DISTANCE)
        except Diagnostic as problem:
            assert "\n" not in problem.message
        else:
            assert reader(scale).read(amount.text, Takes.DISTANCE) == amount


@given(st.integers(1, 2_000_000), st.sampled_from(["mm", "um", "in", "mturn"]))
def test_what_is_shown_is_what_is_sent(thousandths: int, unit: str) -> None:
    try:
        amount = reader().read(f"{thousandths / 1000:.3f} {unit}", Takes.DISTANCE)
    except Diagnostic:
        return  # rounding would spoil it
    assert amount.given is not None and amount.given.value == Fraction(thousandths, 1000)
    assert reader().read(amount.typed, Takes.DISTANCE) == amount
    assert amount.times(-1).number == -amount.number
    assert reader().read(amount.times(-1).text, Takes.DISTANCE) == amount.times(-1)
