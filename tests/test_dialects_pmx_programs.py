"""Program files of the PMX: A-SCRIPT or compiled lines; the lines of a memory; what is said of a file."""

from __future__ import annotations

from pathlib import Path

import pytest

from dialects import Diagnostic
from dialects.pmx import programs, script_code
from tests.pmx_programs import EXAMPLES, TEN_TIMES, plain


def test_a_file_of_a_script_is_its_lines_without_remarks(tmp_path: Path) -> None:
    file = tmp_path / "a.prg"
    file.write_bytes(b"\xef\xbb\xbf; first\r\nX1000 ; far\r\n\r\n  WAITX\r\nEND\r\n\x1a")
    assert [(each.number, each.text) for each in programs.load(file)] == [(2, "X1000"), (4, "WAITX"), (5, "END")]
    file.write_bytes(b"X1 ; \xb5\nEND\n")
    assert len(programs.load(file)) == 2


@pytest.mark.parametrize("text", EXAMPLES)
def test_what_is_listed_of_a_memory_reads_as_the_program(text: str) -> None:
    held = programs.memory(text, "a.prg")
    listed = [f"SA{at}={token}" for at, token in enumerate(held)]
    assert plain("\n".join(programs.readable(listed))) == plain(text)
    assert programs.memory("\n".join(["; a backup", *listed]), "raw") == held


def test_lines_of_a_unit_are_taken_as_they_are_but_not_made_readable() -> None:
    text = "SA0=PS0\nSA2=&1023$5\nSA3="
    assert programs.compiled(programs.read(text, "x")) == [(1, 0, "PS0"), (2, 2, "&1023$5"), (3, 3, "")]
    with pytest.raises(script_code.Undecodable):
        programs.readable(text.splitlines())


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("SA0=PS0\nX1000\n", "a.prg:2:1: 'X1000' is no compiled line"),
        ("SA1275=XX", "a.prg:1:3: there is no line 1275"),
        ("SA1=XX\nSA1=XX", "a.prg:2:3: SA1 stands in line 1 already"),
        (f"SA1={'X' * 41}", "a.prg:1:5: a compiled line has 40"),
        ("X1\nFOO\nBAR\nEND", r"a.prg:2:1: unknown command FOO \(1 more"),
        ("", "a.prg:1:1: holds no program"),
    ],
)
def test_what_is_wrong_with_a_file_is_told(text: str, says: str) -> None:
    with pytest.raises(Diagnostic, match=says):
        programs.read(text, "a.prg")


def test_a_file_that_cannot_be_read_is_told(tmp_path: Path) -> None:
    with pytest.raises(Diagnostic, match="cannot be read"):
        programs.load(tmp_path / "gone.prg")
    (tmp_path / "b.prg").write_bytes(b"X1\0")
    with pytest.raises(Diagnostic, match="no text file"):
        programs.load(tmp_path / "b.prg")


def test_each_compiled_line_knows_its_line_of_the_file() -> None:
    stored = programs.compiled(programs.read(TEN_TIMES, "x"))
    assert stored[0] == (2, 0, "CV20000") and stored[-1][0] == len(TEN_TIMES.splitlines())
