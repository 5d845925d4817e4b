"""What a comment takes from a line: nothing that a person meant to send, in any language of a file."""

from __future__ import annotations

import re

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from multidrop.base.comments import grouped_at, uncommented, unsent
from multidrop.base.errors import Diagnostic
from multidrop.base.files import toml_of
from multidrop.dialects.program_files import Problem
from multidrop.families.lexium.manual import program_checker, program_file
from multidrop.families.pmx.manual import program_file as pmx_file
from multidrop.families.tmcl.manual import program_file as tmcl_file
from tests.support.cases import for_each


def mcode(line: str) -> list[Problem]:
    return [each for each in program_checker.check(f"PG 1\nLB G1\n{line}\nH 1\nBR G1\nPG\n") if each.line == 3]


def script(line: str) -> list[Problem]:
    return [each for each in pmx_file.check(f"PRG 0\n{line}\nWAITX\nEND\n") if each.line == 2]


def tmcl(line: str) -> list[Problem]:
    return [each for each in tmcl_file.check(f"STAP 0, 1\n{line}\nSTOP\n") if each.line == 2]


LANGUAGES = {"mcode": mcode, "pmx": script, "tmcl": tmcl}
GROUPED = (
    ("mcode", "MR 51'200"), ("mcode", "MR 51`200"), ("mcode", "MR 51\\200"), ("mcode", "MR -51'200"),
    ("mcode", "MR 51'200 ' far"), ("mcode", "MR 51'200'000"), ("mcode", "MR 51'200\\ far"), ("mcode", "R1=R2+51'200"),
    ("mcode", "MR51'200"), ("mcode", "MR 51'200.5"), ("mcode", "\tMR 51`200\t"),
    ("mcode", "MA 51'200,1"), ("mcode", "R1=51'200*R2"), ("mcode", "MA 51'200 , 1"), ("mcode", "MR 51'200mm"),
    ("pmx", "X51;200"), ("pmx", "X51;200Y5"), ("pmx", "V1=51;200;300"), ("pmx", "V1=51;200+V2"),
    ("tmcl", "MVP ABS, 0, 51;200"), ("tmcl", "Far = 51;200"),
)  # fmt: skip


@for_each(("language", "line"), GROUPED)
def test_a_number_in_groups_of_digits_is_an_error_with_the_number_to_write(language: str, line: str) -> None:
    [found] = LANGUAGES[language](line)
    assert not found.warning and "would be read as" in found.what, found
    assert line[found.column - 1 :].startswith("51"), found


BEHIND = (
    ("mcode", "MR 51' far"), ("mcode", "MR 51'20"), ("mcode", "MR 51'2000"), ("mcode", "MR 51`"),
    ("mcode", "BR G1'back"), ("mcode", "MR 51'200 steps"), ("mcode", "MR 1'51'200 and"),
    ("pmx", "X51;far"), ("pmx", "X51;20"), ("tmcl", "ROR 0, 51//200"), ("tmcl", "ROR 0, 51;x"),
)  # fmt: skip


@for_each(("language", "line"), BEHIND)
def test_another_comment_right_behind_a_number_is_a_warning(language: str, line: str) -> None:
    assert [each.warning for each in LANGUAGES[language](line) if "right behind a number" in each.what] == [True]


PLAIN = (
    ("mcode", "MR 51 '200"), ("mcode", "MR 51 \\200"), ("mcode", "MR 51\t\\200"), ("mcode", "\\ MR 5"),
    ("mcode", "MR 51 ' it's 51'200"), ("mcode", 'PR "51\'200"'), ("mcode", 'PR "a\\nb"'), ("mcode", "MR 51 ` far"),
    ("pmx", "X51 ;200"), ("pmx", "; 51;200"), ("tmcl", "ROR 0, 51 // 51;200"), ("tmcl", "ROR 0, 51 ;200"),
)  # fmt: skip


@for_each(("language", "line"), PLAIN)
def test_a_comment_after_a_blank_says_what_it_likes(language: str, line: str) -> None:
    assert LANGUAGES[language](line) == []


def test_a_backslash_in_a_word_begins_no_comment() -> None:
    for line, column in (("RC=2\\5", 5), ("MR 51\\ far", 6), ("LB G2\\x", 6)):
        wrong = [each for each in mcode(line) if not each.warning]
        assert wrong[0].column == column and "only at the start of a line or after a blank" in wrong[0].what
        with pytest.raises(Diagnostic, match="x:2:"):
            program_file.read(f"PG 1\n{line}\nE\nPG\n", "x")


@for_each(("language", "line"), [("mcode", "MR 5^M"), ("mcode", "MR 5^M^J"), ("pmx", "X51^M"), ("tmcl", "ROR 0, 5^J")])
def test_enter_in_two_characters_is_named(language: str, line: str) -> None:
    assert [each.what for each in LANGUAGES[language](line)] == [
        f"{line[line.index('^') :][:2]} stands for Enter; leave it out"
    ]


def test_a_variable_may_be_called_m() -> None:
    assert mcode("R1=R2^M")[0].what == "^M stands for Enter; leave it out"
    assert program_checker.check("VA M=5\nPG 1\nR1=R2^M\nE\nPG\n") == []
    assert mcode('PR "^M"') == []


MARKED = st.text(st.sampled_from("51200'`\\;#/ .M^\"AR=,"), max_size=14)


@given(MARKED)
def test_what_a_file_sends_of_a_line_is_all_before_a_comment_that_shows(line: str) -> None:
    if any(not each.warning for each in program_file.scan(f"PG 1\n{line}\nE\nPG\n")[1] if each.line == 2):
        return
    kept = program_file.bare(line)
    rest = line.strip(" ")[len(kept) :].lstrip(" ")
    assert line.strip(" ").startswith(kept) and (not rest or rest[0] in "'`\\")
    if rest and line[line.index(kept) + len(kept) - 1 : line.index(kept) + len(kept)].isdigit() and kept:
        at = line.index(kept) + len(kept)
        assert line[at : at + 1] == " " or grouped_at(line, at) is None


SPELLED = st.text(st.sampled_from("XYV015;=+ -'\t"), max_size=9).map(str)


@given(SPELLED)
@example("X51;20")
@example("V1=5+3")
@example("X5\u00a0")
def test_a_compiled_line_has_every_number_of_its_line(line: str) -> None:
    text = f"PRG 0\n{line}\nEND\n"
    if any(not each.warning for each in pmx_file.check(text)):
        return
    stored = [token for at, _, token in pmx_file.compiled(pmx_file.read(text, "x")) if at == 2]
    kept = line.partition(";")[0]
    assert bool(stored) == bool(kept.strip(" \t"))
    shown = [each for each in pmx_file.readable(f"SA{n}={token}" for n, token in enumerate(pmx_file.memory(text, "x")))]
    body = "".join(each.strip() for each in shown if each.strip() not in ("PRG 0", "END"))
    assert _numbers(body) == _numbers(kept), (shown, kept)


TMCL_LINE = st.tuples(
    st.sampled_from(["MVP ABS,", "ROR ", "SAP 4, ", "STOP", "WAIT TICKS, 0,", "A = "]),
    st.text(st.sampled_from("051,;/ -x_.'\t\u00a0"), max_size=8),
).map("".join)


@given(TMCL_LINE)
@example("ROR 0, 51;20")
@example("ROR 0,\u00a051")
def test_an_assembled_line_has_every_number_of_its_line(line: str) -> None:
    text = f"{line}\nSTOP\n"
    if any(not each.warning for each in tmcl_file.check(text)):
        return
    kept = line[: tmcl_file.remark_at(line)]
    first = tmcl_file.compiled(tmcl_file.read(text, "x"))[0].call
    if "=" not in kept and kept.strip():
        numbers = _numbers(str(first) if first.row else "") or [first.value]
        assert all(each in (first.type, first.motor, first.value) for each in _numbers(kept)), (line, numbers)


def _numbers(text: str) -> list[int]:
    return [int(each) for each in re.findall(r"0x[0-9a-fA-F]+|[0-9]+", text) if not each.startswith("0x")]


@for_each(
    ("line", "kept"),
    [
        ('PR "a # b"', 'PR "a # b"'), ('PR "a" # b', 'PR "a"'), ('PR "a # b', 'PR "a # b'), ("MR 51#200", "MR 51#200"),
        ("MR 51 # 200", "MR 51"), ("# x", ""), ("  # x", ""), ("/wait 'a # b' 5 # x", "/wait 'a # b' 5"),
        ("/print it's 5 # it's", "/print it's 5"), ("MR 5\t# x", "MR 5"), ("MR 5\u00a0# x", "MR 5\u00a0# x"),
    ],
)  # fmt: skip
def test_a_comment_of_a_script_is_not_in_quotation_marks(line: str, kept: str) -> None:
    assert uncommented(line) == kept


def test_a_typed_line_has_no_comment_of_scripts_and_no_enter() -> None:
    for line in ("MR 5 # x", "# x", "MR 5^M", "MR 5^J", "MR 5^M^J", "MR 5^M "):
        assert "leave it out" in unsent(line), line
    for line in ("MR 51#200", 'PR "a # b"', 'PR "^M"', "R1=R2 ^ M", "R1=R2^MX", "R1=R2^15"):
        assert unsent(line) == "", line
    assert "write ^ M for the variable M" in unsent("R1=R2^M")


def test_a_number_in_a_toml_file_is_not_cut() -> None:
    with pytest.raises(Diagnostic, match="cell:2: not TOML: 51#200 would be read as 51; write 51200"):
        toml_of('name = "51#200"\nposition = 51#200\n', "cell")
    assert toml_of("position = 51_200 #200\nload = 0.3# x\n", "cell") == {"position": 51200, "load": 0.3}
