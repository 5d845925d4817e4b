"""One table of the families of drives: what a front end must know stands in their records and nowhere else."""

from __future__ import annotations

import re

from multidrop.dialects.families import DEFAULT, languages, program_languages, seen
from multidrop.dialects.family import Hints
from multidrop.shell.connect import urls
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


def test_an_unknown_line_is_of_the_default_family_and_no_other() -> None:
    assert urls.parse("/dev/ttyUSB0").hints == Hints() and DEFAULT == "mcode"


def test_each_language_is_listed_once_and_each_ending_means_one_family() -> None:
    known = languages()
    assert len(known) == len({id(each) for each in known})
    endings = [ending for programs in program_languages().values() for ending in programs.endings]
    assert len(endings) == len(set(endings))


def test_whole_messages_of_the_family_are_not_called_another_language_or_baud_rate() -> None:
    assert seen(bytes.fromhex("00000000000301ab05"), "modbus") == ""
    assert all("another language" in seen(b"SSH-2.0-OpenSSH\r\n", name) for name in ("modbus", "mcode"))
