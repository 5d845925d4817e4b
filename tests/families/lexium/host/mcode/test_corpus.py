"""Programs as people write them: nothing wrong with them, and the same in the drive before and after formatting."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.families.lexium.host.mcode.family import MCodeFamily as FAMILY
from multidrop.families.lexium.manual.program_checker import check
from multidrop.families.lexium.manual.program_file import formatted, read, remark_at
from multidrop.families.lexium.manual.statements import canonical
from multidrop.families.lexium.simulator.device import MCodeDevice
from multidrop.shell.programs.checking import examine
from multidrop.simulator.cell.spec import DriveSpec, WorldSpec
from multidrop.simulator.world import World
from tests.conftest import Bench
from tests.support.examples import examples
from tests.support.mcode_drives import one_drive
from tests.support.sample_files import MCODE, product_of

pytestmark = pytest.mark.slow

WARNED = {
    "settings_only": ["holds no program: settings only"],
    "gantry_leader": ['DN="A" is outside of PG: a download executes it at once, and asks before'],
}
EVERY = [pytest.param(file, id=file.stem) for file in MCODE]


def test_the_programs_are_for_every_product() -> None:
    assert {product_of(file) for file in MCODE} == {"LMDOM", "LMDCM", "LMDOE", "LMDCE", "LMM", "MDI", "MDIE", "MDIX"}


@pytest.mark.parametrize("file", EVERY)
def test_nothing_is_wrong_with_a_program_nor_looks_forgotten(file: Path) -> None:
    found = [each.what for each in examine(str(file), product_of(file)).problems]
    assert found == WARNED.get(file.stem, [])


def test_for_another_product_a_program_is_said_to_be_for_its_own() -> None:
    for file in MCODE:
        for product in ("LMDOM", "MDI"):
            wrong = [each for each in check(file.read_text(), product) if not each.warning]
            named = [each for each in check(file.read_text(), product) if "this is a program for" in each.what]
            assert bool(named) >= bool(wrong), (file, product)
            assert all(product_of(file) in each.what for each in named), (file, product)


@pytest.mark.parametrize("file", EVERY)
def test_formatting_keeps_remarks_and_layout_and_is_done_once(file: Path) -> None:
    text = file.read_bytes().decode()
    spelled = formatted(text)
    assert formatted(spelled) == spelled
    for old, new in zip(text.split("\n"), spelled.split("\n"), strict=True):
        assert old[remark_at(old) :] == new[remark_at(new) :]
        assert (old.strip() == "") == (new.strip() == "")
        assert old[: len(old) - len(old.lstrip())] == new[: len(new) - len(new.lstrip())]
    lines = read(text, "x")
    names = frozenset(line.declares for line in lines)
    assert [canonical(line.text, names) for line in lines] == [line.text for line in read(spelled, "x")]


def listing(product: str, text: str) -> Sequence[str]:
    """What a drive lists after it took each line."""
    device = MCodeDevice(DriveSpec(personality=product), World(WorldSpec()))
    refused = [line.text for line in read(text, "x") if device.execute(line.text, 0.0).refused]
    assert refused == []
    return device.execute("L", 0.0).lines


def spelled(listed: Sequence[str], names: frozenset[str]) -> list[str]:
    """A listing in canonical spelling."""
    rows = (row.split(None, 1) for row in listed)
    return [f"{at}  {canonical(text, names)}" for at, text in rows]


@pytest.mark.parametrize("file", EVERY)
def test_a_formatted_program_downloads_to_the_same_listing(file: Path) -> None:
    text, product = file.read_bytes().decode(), product_of(file)
    names = frozenset(line.declares for line in read(text, "x"))
    before = listing(product, text)
    after = listing(product, formatted(text))
    assert len(before) == sum(line.section == "program" and line.mark is None for line in read(text, "x"))
    assert spelled(before, names) == list(after) == spelled(after, names)


LINES = (
    "VM=5000", "MR Q1*2", "MA -100,0,1", "H", "H 250", "IC Q1", "BR G1,Q1<=7", "CL K1,I1=1&MV", "R1=R2+P", "PR P,Q1;",
    'PR "a  \'b",R1', "TI=1,K1", "TE=1", "IS=1,0,1", "F1=SI F2", "Q1=-5", "R2=!R1", "O1=1", "BR 1,P<>-3", "SL -500",
)  # fmt: skip
BLANK = st.sampled_from(["", " ", "\t", "  "])


@st.composite
def typed(draw: st.DrawFn) -> str:
    """A line as somebody may type it: case, blanks, `=` or a blank after the head, a remark."""
    line = draw(st.sampled_from(LINES))
    head, mark, rest = re.split("([ =]|$)", line, maxsplit=1)
    if '"' not in line:
        rest = re.sub(r",|<?=|<>|[*+&]", lambda found: draw(BLANK) + found[0] + draw(BLANK), rest)
        line = head + draw(BLANK) + (draw(st.sampled_from("= ")) if mark else "") + draw(BLANK) + rest
        line = line.lower() if draw(st.booleans()) else line
    return draw(BLANK) + line + draw(st.sampled_from(["", "  ", "\t' it's", "   ` x", "'y"]))


@examples(25, 400)
@given(st.lists(typed(), max_size=12))
def test_any_spelling_of_a_program_formats_to_the_same_listing(lines: list[str]) -> None:
    text = "\n".join(["VA Q1", "PG 1", "lb g1", *lines, "E", " Lb k1", "rt", "pg", ""])
    before, after = (listing("LMDCM", each) for each in (text, formatted(text)))
    assert spelled(before, frozenset()) == list(after)


WORDS = st.sampled_from(
    ["PG 1", "PG", "pg 100", "LB K1", "lb SU", "E", "RT", "BR K1", "BR 100,I1=1", "CL K1", "CL K2", "TI=1,K1", "TE=3"]
    + [
        "MR 5",
        "-7",
        "H",
        "h 5",
        "VA Q1",
        "va k1=2",
        "Q1=MV",
        "OE 0",
        "P=0",
        "BR Q1,",
        "S ' x",
        "DN a",
        "IS=1,,0",
        ")",
        "=5",
    ]
)


@examples(60, 2000)
@given(st.lists(WORDS, max_size=14), st.sampled_from(["LMDCM", "MDI", ""]))
def test_any_lines_are_checked_and_a_formatted_file_has_the_same_findings(lines: list[str], product: str) -> None:
    text = "\n".join(lines)
    found = check(text, product)
    assert all(1 <= each.line <= max(len(lines), 1) and each.column >= 1 and each.what for each in found)
    spelled = formatted(text)
    assert formatted(spelled) == spelled
    assert [(each.line, each.warning) for each in check(spelled, product)] == [(f.line, f.warning) for f in found]


@given(st.text(max_size=60))
def test_any_text_is_formatted_once(text: str) -> None:
    spelled = formatted(text)
    assert formatted(spelled) == spelled and check(text) is not None


@pytest.mark.parametrize("file", EVERY)
def test_a_drive_with_a_program_has_its_formatted_file_too(bench: Callable[..., Bench], file: Path) -> None:
    product = product_of(file)
    desk, state = one_drive(bench, product=product, personality=product)
    text = file.read_bytes().decode()
    for sent, other in ((text, formatted(text)), (formatted(text), text)):
        programs, quiet = FAMILY(state).programs, lambda done, total: None
        desk.run(programs.download(read(sent, "x"), None, quiet), state)
        held = desk.run(programs.read((), quiet), state)
        assert held.lines or file.stem == "settings_only"
        assert not programs.differences(read(sent, "x"), held, None)
        assert not programs.differences(read(other, "x"), held, None)
