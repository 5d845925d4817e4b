"""Scales and quantities: what is read, what is refused, values to counts and back."""

import re
from fractions import Fraction

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.dialects.units import (
    PLACES,
    Basis,
    Measure,
    Quantity,
    Takes,
    Unit,
    check_own,
    decimal,
    quantities,
    quantity,
    scale,
    strange_brace,
    unit_of,
    with_numbers,
)

TURN = Basis((("MS", "256"), ("EE", "0")), Fraction(51_200))


def measure(text, basis=TURN, own=(), **more):
    return Measure(scale({"scale": text, **more}, own), basis)


@pytest.mark.parametrize(
    ("found", "typed", "takes", "native"),
    [
        ("5 mm/turn", "12.5 mm", Takes.DISTANCE, 128_000),
        ("5 mm/turn", "50 mm/s", Takes.SPEED, 512_000),
        ("5 mm/turn", "2 m/s2", Takes.ACCELERATION, 20_480_000),
        ("5 mm/turn", "1 in", Takes.DISTANCE, 260_096),
        ("5 mm/turn", "3 m/min", Takes.VELOCITY, 512_000),
        ("5 mm/turn", "-1 mturn", Takes.DISTANCE, -51_200),
        ("-5 mm/turn", "1 mturn", Takes.DISTANCE, 51_200),
        ("-5 mm/turn", "12.5 mm", Takes.DISTANCE, -128_000),
        ("-5 mm/turn", "50 mm/s", Takes.SPEED, 512_000),
        ("-5 mm/turn", "50 mm/s", Takes.VELOCITY, -512_000),
        ("-360 deg/turn", "90 deg", Takes.PLACE, -12_800),
        ("36 deg/turn", "1 turn", Takes.DISTANCE, 512_000),
        ("36 deg/turn", "6 rpm", Takes.VELOCITY, 51_200),
        ("36 deg/turn", "60 mrpm", Takes.VELOCITY, 51_200),
        ("0.4 um/step", "-1 mm", Takes.DISTANCE, -2500),
        ("2 pallet/turn", "1 pallet", Takes.DISTANCE, 25_600),
    ],
)
def test_a_quantity_becomes_the_drives_own_number(found, typed, takes, native):
    own = ("pallet",)
    assert measure(found, own=own).native(quantity(typed, own), takes) == native


def test_a_place_counts_from_the_zero_of_the_scale_and_a_distance_does_not():
    axis = measure("5 mm/turn", zero="120 mm", travel="0..300 mm")
    assert axis.native(quantity("120 mm"), Takes.PLACE) == 0
    assert axis.native(quantity("0 mm"), Takes.PLACE) == -1_228_800
    assert axis.native(quantity("120 mm"), Takes.DISTANCE) == 1_228_800
    assert (axis.shown(51_200), axis.shown(51_200, Takes.DISTANCE)) == ("125 mm", "5 mm")
    assert axis.scale.travel == (0, Fraction(3, 10))
    assert axis.steps(quantity("5 mm")) == 51_200  # the world's places have no zero of the scale's


def test_a_drive_that_counts_velocity_in_units_of_its_own_is_given_those():
    chip = Basis(
        (), Fraction(51_200), Fraction(2**3 * 2048 * 32, 16_000_000), Fraction(2 ** (3 + 7 + 29), 16_000_000**2)
    )
    axis = measure("1 turn/turn", chip)
    assert axis.native(quantity("60 rpm"), Takes.VELOCITY) == round(51_200 * 2**3 * 2048 * 32 / 16e6)
    assert axis.native(quantity("10 turn/s2"), Takes.ACCELERATION) == round(512_000 * 2**39 / 16e6**2)
    assert axis.value(1678, Takes.VELOCITY) == pytest.approx(1, rel=1e-3)


@pytest.mark.parametrize(
    ("found", "named"),
    [
        ("5 mm", "is no scale"),
        ("5,2 mm/turn", "has no comma"),
        ("0 mm/turn", "the scale is zero"),
        ("-0.0 mm/turn", "the scale is zero"),
        ("5 furlong/turn", "no unit furlong; valid: m, cm, mm, um, in, deg, rad, turn, mturn, pallet"),
        ("5 mturn/turn", "mturn is no unit of the load"),
        ("5 mm/rev", "valid: NUMBER UNIT/turn"),
        ("5 mm/s/turn", "is no scale"),
        ({"zero": "1 mm"}, "no scale"),
        (5, "no scale"),
        ({"scale": "5 mm/turn", "zero": "120"}, "NUMBER SPACE UNIT"),
        ({"scale": "5 mm/turn", "zero": 120}, "zero = 120 has no unit"),
        ({"scale": "5 mm/turn", "zero": "12 deg"}, "zero = 12 deg: the scale is in mm; valid: m, cm, mm, um, in"),
        ({"scale": "5 mm/turn", "zero": "12 mm/s"}, "the scale is in mm"),
        ({"scale": "1 pallet/turn", "zero": "1 mm"}, "valid: pallet"),
        ({"scale": "5 mm/turn", "travel": "0..300 deg"}, "travel = 0 deg: the scale is in mm"),
        ({"scale": "5 mm/turn", "travel": "300..0 mm"}, "ends where it begins"),
        ({"scale": "5 mm/turn", "travel": "0-300 mm"}, "is no range"),
        ({"scale": "5 mm/turn", "travel": "0,5..300 mm"}, "is no range"),
        ({"scale": "5 mm/turn", "zero": "0,5 mm"}, "has no comma"),
        ({"scale": "5 mm/turn", "full_steps": 0}, "full_steps = 0"),
        ({"scale": "5 mm/turn", "full_steps": True}, "full_steps = True"),
        ({"scale": "5 mm/turn", "gear": 3}, "no key gear; valid: scale, zero, travel, full_steps"),
    ],
)
def test_a_wrong_scale_is_refused_with_what_is_valid(found, named):
    with pytest.raises(Diagnostic) as caught:
        scale(found, ("pallet",))
    assert named in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("found", "typed", "takes", "named"),
    [
        ("5 mm/turn", "90 deg", Takes.DISTANCE, "90 deg: the scale of the axis is 5 mm/turn; valid: mm"),
        ("5 mm/turn", "300 rpm", Takes.VELOCITY, "mrpm is the motor's"),
        ("5 mm/turn", "1 turn", Takes.DISTANCE, "mturn is the motor's"),
        ("36 deg/turn", "1 mm", Takes.DISTANCE, "the scale of the axis is 36 deg/turn"),
        ("5 mm/turn", "50 mm/s", Takes.DISTANCE, "50 mm/s is a velocity, not a distance; as in {12.5 mm}"),
        ("5 mm/turn", "50 mm", Takes.VELOCITY, "50 mm is a distance, not a velocity; as in {50 mm/s}"),
        ("5 mm/turn", "50 mm/s2", Takes.SPEED, "50 mm/s2 is an acceleration"),
        ("5 mm/turn", "-50 mm/s", Takes.SPEED, "it takes a velocity without sign"),
        ("5 mm/step", "1 mm", Takes.DISTANCE, "1 mm would be 0 mm after rounding; one step of the drive is 5 mm"),
        ("5 mm/step", "13 mm", Takes.PLACE, "13 mm would be 15 mm after rounding"),
    ],
)
def test_a_quantity_that_the_axis_cannot_take_is_refused(found, typed, takes, named):
    with pytest.raises(Diagnostic) as caught:
        measure(found).native(quantity(typed), takes)
    assert named in str(caught.value)


def test_a_place_in_turns_of_the_motor_is_refused_where_the_scale_has_a_zero():
    assert measure("5 mm/turn").native(quantity("2 mturn"), Takes.PLACE) == 102_400
    with pytest.raises(Diagnostic, match="a zero of their own"):
        measure("5 mm/turn", zero="1 mm").native(quantity("2 mturn"), Takes.PLACE)


def test_nothing_is_guessed_where_no_reading_tells_the_steps_of_a_turn():
    silent = Basis(missing="nothing tells its microsteps")
    with pytest.raises(Diagnostic, match="nothing tells its microsteps; give the scale by the step"):
        measure("5 mm/turn", silent)
    with pytest.raises(Diagnostic, match="nothing tells its microsteps"):
        measure("5 mm/step", silent).native(quantity("1 mturn"), Takes.DISTANCE)
    assert measure("5 mm/step", silent).native(quantity("10 mm"), Takes.DISTANCE) == 2


@pytest.mark.parametrize("word", ["mm", "rpm", "step", "two words", "5s", "mturn", ""])
def test_an_own_unit_has_a_name_that_is_no_other_ones(word):
    with pytest.raises(Diagnostic, match="no name of an own unit"):
        check_own([word])
    check_own(["pallet", "slot_2"])


@pytest.mark.parametrize(
    "text", ["12.5", "mm", "12.5mm", "1e3 mm", "12.5 mm mm", "{12 mm}", "0x10 mm", "٣ mm", "12 mm/h"]
)
def test_what_is_no_number_with_a_unit_is_refused(text):
    with pytest.raises(Diagnostic):
        quantity(text)


@given(st.floats(-1e9, 1e9).map(repr).filter(lambda text: "e" not in text))
def test_a_number_as_python_writes_it_is_taken_and_rounded_to_the_resolution(text):
    axis = measure("5 mm/turn", Basis(turn=Fraction(51_200)))
    counts = Fraction(text) * 10_240
    line = f"MR {{{text} mm}}"
    assert [match[0] for match in quantities(line)] == [line[3:]] and not strange_brace(line)
    try:
        native = axis.native(quantity(f"{text} mm"), Takes.DISTANCE)
    except Diagnostic as refused:
        assert abs(counts) > 2**31 - 1 or 0 < abs(counts) < 51, refused
    else:
        assert native == round(counts) and -(2**31) <= native < 2**31


def test_three_tenths_of_python_are_three_tenths():
    axis = measure("5 mm/turn", Basis(turn=Fraction(51_200)))
    assert axis.native(quantity(f"{3 * 0.1} mm"), Takes.DISTANCE) == 3072


@given(st.text(alphabet='{}" 0123456789.-mMRNaif', max_size=20))
def test_a_line_without_a_strange_brace_has_none_once_its_quantities_are_numbers(text):
    left = re.sub(r'"[^"]*(?:"|$)', "", with_numbers(text))
    assert bool(strange_brace(text)) is bool(re.search("[{}]", left))


def test_only_a_number_a_space_and_a_unit_in_braces_is_a_quantity_of_a_line():
    line = 'MR {12.5 mm} {X} {12mm} {12  mm} { 12 mm} PR "{1 mm}" {-3 mm/s2}'
    assert [match[0] for match in quantities(line)] == ["{12.5 mm}", "{-3 mm/s2}"]


NUMBERS = st.decimals(-100_000, 100_000, allow_nan=False, places=4).map(Fraction)
KINDS = st.sampled_from(["m", "cm", "mm", "um", "in", "deg", "rad", "turn", "pallet"])
SCALES = st.builds(
    lambda number, unit, of: measure(f"{decimal(number)} {unit}/{of}", own=("pallet",)),
    NUMBERS.filter(bool),
    KINDS,
    st.sampled_from(["turn", "step"]),
)
TAKES = st.sampled_from(Takes)


@given(SCALES, TAKES, st.integers(-(2**31) + 1, 2**31 - 1))
def test_a_shown_number_typed_back_is_the_same_number(axis, takes, number):
    number = abs(number) if takes.unsigned else number
    assert axis.native(quantity(axis.shown(number, takes), ("pallet",)), takes) == number


@given(SCALES, TAKES, NUMBERS)
def test_there_and_back_is_within_half_a_step_and_a_hundredth(axis, takes, value):
    unit = unit_of(axis.unit_for(takes), ("pallet",))
    try:
        number = axis.native(Quantity(value, unit), takes)
    except Diagnostic as refused:
        text, far = str(refused), abs(axis.number(Quantity(abs(value), unit), takes)) > 2**31 - 2
        assert "after rounding" in text or (takes.unsigned and value < 0) or (far and "for the drive" in text)
        return
    off = abs(axis.exact(number, takes) - value * unit.factor)
    assert off <= abs(axis.count) / 2
    assert off <= abs(value * unit.factor) / 100


@given(SCALES, TAKES, NUMBERS.filter(bool))
def test_only_the_scale_changes_a_sign(axis, takes, value):
    try:
        number = axis.native(Quantity(value, unit_of(axis.unit_for(takes), ("pallet",))), takes)
    except Diagnostic:
        assume(False)
    flipped = not takes.unsigned and axis.scale.value < 0
    assert (number > 0) == ((value > 0) != flipped)


@given(SCALES, TAKES, NUMBERS, KINDS, st.sampled_from(["", "/s", "/min", "/s2"]))
def test_no_quantity_crosses_kinds(axis, takes, value, name, rate):
    unit = unit_of(name + rate, ("pallet",))
    assume((unit.kind, unit.per) != (axis.scale.kind, takes.per))
    with pytest.raises(Diagnostic):
        axis.native(Quantity(value, unit), takes)


@given(st.text(max_size=30))
def test_any_text_is_a_scale_or_is_refused_in_one_line(text):
    for read in (scale, quantity):
        try:
            read(text)
        except Diagnostic as refused:
            assert len(str(refused).splitlines()) <= 1 or not text.isprintable()


def test_every_unit_is_of_one_kind():
    assert {unit_of(name) for name in PLACES} == {Unit(name, *found) for name, found in PLACES.items()}
