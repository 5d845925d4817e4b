"""Program files of the PMX: A-SCRIPT or compiled lines; the lines of a memory; what is said of a file."""

from __future__ import annotations

from pathlib import Path

import pytest

from multidrop.base.errors import Diagnostic, NoAnswer, Refused
from multidrop.base.files import SourceLine, program_text_of
from multidrop.dialects.codec import End, Reply
from multidrop.families.pmx.host import programs
from multidrop.families.pmx.host.codec import Pmx, PmxState
from multidrop.families.pmx.host.programs import PmxPrograms
from multidrop.families.pmx.manual import program_file
from tests.support.pmx_programs import EXAMPLES, TEN_TIMES, plain


def load(file: Path) -> list[SourceLine]:
    return program_file.read(program_text_of(file), str(file))


def test_a_file_of_a_script_is_its_lines_without_remarks(tmp_path: Path) -> None:
    file = tmp_path / "a.prg"
    file.write_bytes(b"\xef\xbb\xbf; first\r\nX1000 ; far\r\n\r\n  WAITX\r\nEND\r\n\x1a")
    assert [(each.number, each.text) for each in load(file)] == [(2, "X1000"), (4, "WAITX"), (5, "END")]
    file.write_bytes(b"X1 ; \xb5\nEND\n")
    assert len(load(file)) == 2


@pytest.mark.parametrize("text", EXAMPLES)
def test_what_is_listed_of_a_memory_reads_as_the_program(text: str) -> None:
    held = program_file.memory(text, "a.prg")
    listed = [f"SA{at}={token}" for at, token in enumerate(held)]
    assert plain("\n".join(program_file.readable(listed))) == plain(text)
    assert program_file.memory("\n".join(["; a backup", *listed]), "raw") == held


def test_lines_of_a_unit_are_taken_as_they_are_but_not_made_readable() -> None:
    text = "SA0=PS0\nSA2=&1023$5\nSA3="
    assert program_file.compiled(program_file.read(text, "x")) == [(1, 0, "PS0"), (2, 2, "&1023$5"), (3, 3, "")]
    with pytest.raises(program_file.Undecodable):
        program_file.readable(text.splitlines())


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("SA0=PS0\nX1000\n", "a.prg:2:1: 'X1000' is not a compiled line"),
        ("SA1275=XX", "a.prg:1:3: no line 1275"),
        ("SA1=XX\nSA1=XX", "a.prg:2:3: SA1 is already in line 1"),
        (f"SA1={'X' * 41}", "a.prg:1:1: a compiled line has 40"),
        ("X1\nFOO\nBAR\nEND", r"a.prg:2:1: unknown command FOO \(1 more"),
        ("", "a.prg:1:1: holds no program"),
    ],
)
def test_what_is_wrong_with_a_file_is_told(text: str, says: str) -> None:
    with pytest.raises(Diagnostic, match=says):
        program_file.read(text, "a.prg")


def test_a_file_that_cannot_be_read_is_told(tmp_path: Path) -> None:
    with pytest.raises(Diagnostic, match="cannot be read"):
        load(tmp_path / "gone.prg")
    (tmp_path / "b.prg").write_bytes(b"X1\0")
    with pytest.raises(Diagnostic, match="not a text file"):
        load(tmp_path / "b.prg")


def test_each_compiled_line_knows_its_line_of_the_file() -> None:
    stored = program_file.compiled(program_file.read(TEN_TIMES, "x"))
    assert stored[0] == (2, 0, "&HSPD=$20000") and stored[-1][0] == len(TEN_TIMES.splitlines())


def nothing(done: int, total: int) -> None:
    """No progress."""


class Far:
    """A controller that keeps lines; `sign` is what it answers to the question whether it is the simulator."""

    def __init__(self, sign: str = "simulator", lose: int = -1) -> None:
        self.sign, self.lose = sign, lose
        self.held: dict[str, str] = {}
        self.sent: list[str] = []

    def answer(self, text: str) -> Reply:
        self.sent.append(text)
        name, setting, value = text.partition("=")
        if setting:
            if len(self.sent) != self.lose:
                self.held[name] = value
            return Reply(("OK",), acknowledged=True)
        if text == "MULTIDROP":
            refused = self.sign.startswith("?")
            return Reply((self.sign,), End.REFUSED if refused else End.DONE) if self.sign else Reply(end=End.TIMEOUT)
        return Reply(("0" if name.startswith("SASTAT") else self.held.get(name, "0"),))


def held(talk, far: Far):  # type: ignore[no-untyped-def]
    """The talk's result, with this controller at the other end."""
    try:
        request = next(talk)
        while True:
            request = talk.send(far.answer(request.text))
    except StopIteration as end:
        return end.value


def put(far: Far, text: str) -> None:
    held(PmxPrograms(PmxState(Pmx(), "00")).download(program_file.read(text, "x"), None, lambda done, total: None), far)


def test_a_script_is_written_and_what_a_longer_one_has_left_is_erased() -> None:
    far = Far()
    put(far, EXAMPLES[5])
    put(far, "X1\nEND")
    assert {name: token for name, token in far.held.items() if token != "0"} == {
        "SA0": "CV1",
        "SA1": "&X$1",
        "SA2": "XX",
    }
    state = PmxState(Pmx(), "00")
    assert PmxPrograms(PmxState(Pmx(), "00")).readable(held(PmxPrograms(state).read((), nothing), far)) == ("X1", "END")
    assert held(PmxPrograms(state).upload(True), far) == ("SA0=CV1", "SA1=&X$1", "SA2=XX")


def test_a_script_is_refused_by_anything_but_the_simulator_before_something_is_written() -> None:
    for sign in ("?MULTIDROP", "OK", "0"):
        far = Far(sign)
        with pytest.raises(Refused, match="not public"):
            put(far, "X1\nEND")
        assert far.held == {} and far.sent == ["MULTIDROP"]
    with pytest.raises(NoAnswer, match="nothing was written"):
        put(Far(""), "X1\nEND")


def test_compiled_lines_are_written_to_anything_and_nothing_else_is_asked_of_it() -> None:
    far = Far("?MULTIDROP")
    put(far, "SA0=PS0\nSA5=&1038$7\n")
    assert far.held == {"SA0": "PS0", "SA5": "&1038$7"} and "MULTIDROP" not in far.sent


def test_a_line_that_was_not_kept_names_its_line_of_the_file() -> None:
    with pytest.raises(NoAnswer, match="line 2: .* has '0' at SA0"):
        put(Far(lose=4), "; remark\nX1\nEND")


def test_a_controller_without_a_program_says_so() -> None:
    with pytest.raises(Refused, match="00 holds no program"):
        held(programs.PmxPrograms(PmxState(Pmx(), "00")).upload(False), Far())
    assert (
        PmxPrograms(PmxState(Pmx(), "00")).readable(held(PmxPrograms(PmxState(Pmx(), "00")).read((), nothing), Far()))
        == ()
    )
