"""One table of the families of drives: what a front end must know stands in their records and nowhere else."""

from __future__ import annotations

import re

import pytest

from multidrop.dialects.families import DEFAULT, FAMILIES, dialects, family_of, languages, program_languages, seen
from multidrop.dialects.family import Hints
from multidrop.dialects.motions import NO_SIGNS
from multidrop.shell.connect import urls
from multidrop.shell.connect.schemes import schemes
from tests.support.paths import ROOMS, ROOT

OUTSIDE = (*(set(ROOMS) - {"families", "multidrop"}), "multidrop/api", "multidrop/commands")
NAME = re.compile(r"(?i)\b(?:mcode|modbus|lexium|mdriveplus|pmx|performax|arcus|tmcl|tmcm|trinamic)")


def test_nothing_outside_the_families_names_one() -> None:
    """In code, comments, texts and tables; the registry has the table of what is in the wheel."""
    named = [
        f"{path.relative_to(ROOT)}:{number}: {found[0]}"
        for room in OUTSIDE
        for path in sorted((ROOT / room).rglob("*"))
        if path.suffix in (".py", ".csv", ".toml", ".tcss") and path != ROOT / "base" / "registry.py"
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        for found in NAME.finditer(line)
    ]
    assert named == []


@pytest.mark.parametrize("family", FAMILIES.values(), ids=FAMILIES)
def test_codec_and_state_lead_to_their_record(family) -> None:
    state = family.new_state(family.codec, "a")
    assert (state.address, state.codec, type(family_of(state))) == ("a", family.codec, family)


@pytest.mark.parametrize("family", FAMILIES.values(), ids=FAMILIES)
def test_a_url_names_a_family_by_its_scheme_or_by_dialect(family) -> None:
    if scheme := dialects()[family.name].scheme:
        assert scheme in schemes() and urls.parse(f"{scheme}://h").hints == Hints(family=family.name)
    else:
        assert urls.parse(f"/dev/ttyUSB0?dialect={family.name}").hints == Hints(family=family.name)


def test_an_unknown_line_is_of_the_default_family_and_no_other() -> None:
    assert urls.parse("/dev/ttyUSB0").hints == Hints() and DEFAULT == "mcode"


def test_each_row_leads_to_the_record_of_its_name_and_to_a_language_of_files() -> None:
    for name, row in dialects().items():
        assert FAMILIES[name].name == name
        assert (row.files is None) == (not FAMILIES[name].offers("programs"))
        if row.files is not None:
            language = row.files.language
            assert callable(language.check) and callable(language.measure)


def test_each_language_is_listed_once_and_each_ending_means_one_family() -> None:
    known = languages()
    assert len(known) == len({id(each) for each in known})
    endings = [ending for programs in program_languages().values() for ending in programs.endings]
    assert len(endings) == len(set(endings))


def test_whole_messages_of_the_family_are_not_called_another_language_or_baud_rate() -> None:
    assert seen(bytes.fromhex("00000000000301ab05"), "modbus") == ""
    assert all("another language" in seen(b"SSH-2.0-OpenSSH\r\n", name) for name in ("modbus", "mcode"))


@pytest.mark.parametrize("name", FAMILIES)
@pytest.mark.parametrize("axis", ["", "x", "0"])
def test_signs_that_could_not_be_read_show_no_place_and_no_program(name: str, axis: str) -> None:
    """The drive was away as they were asked for; the line behind them goes on."""
    family = FAMILIES[name]
    motions = family(family.new_state(family.codec, "")).motions
    assert motions.place(NO_SIGNS, axis) is None and not motions.runs(NO_SIGNS)
