"""A program and the settings of a cell reach the simulated drive whole, or the cell is refused."""

from __future__ import annotations

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.simulator.cells import load
from multidrop.simulator.floor import Floor
from tests.support.cases import for_each

HEAD = '[[bus]]\nname = "w"\n[[bus.drive]]\npersonality = "LMDCM"\n'


def floor(tmp_path, text: str) -> Floor:
    (tmp_path / "cell.toml").write_text(HEAD + text, encoding="utf-8")
    return Floor(load(tmp_path / "cell.toml"))


@for_each("line", ["MR 51'200", "MR 51`200", "MR 51\\200", "MR 51\\ far"])
def test_a_number_that_a_comment_would_cut_is_refused(tmp_path, line: str) -> None:
    text = "\n".join(("PG 1", "LB A1", line, "E", "PG")).replace("\\", "\\\\")
    with pytest.raises(Diagnostic, match="program_text:3"):
        floor(tmp_path, f'program_text = """{text}"""\n')


def test_comments_of_a_program_are_left_out(tmp_path) -> None:
    lines = ["\\\\ a program", "PG 1", "LB A1 ' begin", "MR 51 \\\\200", "E `end", "PG"]
    made = floor(tmp_path, 'program_text = """' + "\n".join(lines) + '\n"""\n')
    program = made.drives[0].device.program
    assert [program.lines[at].text for at in program.order] == ["LB A1", "MR 51", "E"]


def test_a_setting_with_a_comment_is_refused(tmp_path) -> None:
    with pytest.raises(Diagnostic, match="a comment would be cut off"):
        floor(tmp_path, 'set = { IS = "1,2,1\'5" }\n')
