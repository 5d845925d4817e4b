"""`program check`, `download` and `send` on program files as people write them: everything in one round, each once."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from multidrop.families.lexium.host.mcode.family import MCodeFamily
from multidrop.families.lexium.manual.program_file import read
from tests.conftest import Bench
from tests.support.front_door import Home
from tests.support.mcode_drives import Desk

TABLE = 'VA Pa = 0 \' step\nVA Pb=25600\nPG 1\nLB Ga\n\tPR "pos\t", P, "\terr\t", ER\n\tMR\tPb\n\tH\n\tE\nPG\nS\n'
SETTINGS = "'[VARIABLES]\nVM=400000  ' fast\nVA Q1=5\nQ1=7\nIS=1,1,0\nEM 1\n\nS\n"

Check = Callable[..., tuple[int, str, list[str]]]


@pytest.fixture
def check(home: Home, monkeypatch: pytest.MonkeyPatch) -> Check:
    """Write a file and check it: exit code, standard output, the lines on standard error."""
    monkeypatch.chdir(home.folder)

    def run(text: str, *more: str, name: str = "a.mxt") -> tuple[int, str, list[str]]:
        code, out, err = home.run("program", "check", home.file(name, text), *more)
        return code, out, err.splitlines()

    return run


# -- a TAB


def test_a_tab_within_quotation_marks_is_a_character_and_elsewhere_a_blank(check: Check) -> None:
    assert check(TABLE) == (0, "a.mxt: nothing wrong, 5 lines of program\n", [])
    assert [line.text for line in read(TABLE, "x")][3:6] == ["LB Ga", 'PR "pos\t", P, "\terr\t", ER', "MR Pb"]


@pytest.mark.parametrize("em", range(4))
def test_a_tab_is_sent_stored_listed_and_printed_as_it_is(bench: Callable[..., Bench], em: int) -> None:
    desk = Desk(bench, (em, 0))
    assert desk.type('PR "a\tb",\tR1') == ("a\tb0",)
    assert b'PR "a\tb", R1,"~"\r' in desk.bench.written
    desk.bench.run(
        MCodeFamily(desk.state).programs.download(read(TABLE, "x"), None, lambda done, total: None), desk.state
    )
    assert ['PR "pos\t", P, "\terr\t", ER' in line for line in desk.type("L")].count(True) == 1
    desk.type("EX Ga")
    desk.bench.wait(2.0)
    desk.bench.line.events(desk.bench.now)
    assert "pos\t0\terr\t0" in [line.lstrip(">") for line in desk.bench.strays]


@pytest.mark.parametrize("character", ["\x00", "\x07", "\x0b", "\x1b", "\x7f", "\xb5"])
def test_any_other_control_character_is_refused_with_its_place(check: Check, character: str) -> None:
    code, out, (told, *rest) = check(f'PG 1\n  PR "ab{character}"\nPG\n')
    assert (code, out, rest) in ((1, "", []), (2, "", []))
    assert code == 2 or told.startswith("a.mxt:2:9: ")


# -- settings only


def test_a_file_of_settings_is_a_warning(check: Check) -> None:
    code, out, (told,) = check(SETTINGS)
    assert (code, out) == (0, "a.mxt: nothing wrong, 0 lines of program\n")
    assert told == "a.mxt:2:1: warning: holds no program: settings only"


def test_a_file_of_settings_is_downloaded(bench: Callable[..., Bench]) -> None:
    desk = Desk(bench, (0, 0))
    desk.bench.run(
        MCodeFamily(desk.state).programs.download(read(SETTINGS, "x"), None, lambda done, total: None), desk.state
    )
    assert desk.type("PR VM, Q1") == ("4000007",) and desk.state.codec.em == 1


@pytest.mark.parametrize(
    "line", ["MR 512", "SL 5000", "HM 1", "EX K1", "-100", "LB K1", "BR K1", "E", "FD", "CP", "IP"]
)
def test_a_program_whose_pg_was_forgotten_is_not_taken_for_settings(check: Check, line: str) -> None:
    code, _, told = check(f"VM=5000\n{line}\nS\n")
    assert code == 1 and told[0].startswith(f"a.mxt:2:1: no program, and {line} is not a setting")


# -- one round, no follow-on errors


def test_names_labels_and_what_the_drive_refuses_are_told_in_one_round(check: Check) -> None:
    text = 'MS=7\nVA Q1=5\nPG 1\nLB K1\n MR Q2\n BR K9\n VM=5)\n PR "\xe9"\n H 99999999\n RT 5\nE\nPG\n'
    code, out, told = check(text)
    assert (code, out) == (1, "")
    assert [line.split(" ")[0] for line in told] == [
        f"a.mxt:{place}:" for place in ("1:1", "5:5", "6:5", "7:6", "8:6", "9:2", "10:2")
    ]
    assert "warning: H 99999999 is out of range" in told[5] and told[5].endswith("; H takes 1 to 65000")
    assert "error 21" in told[0] and "unknown name Q2" in told[1] and "no label K9" in told[2]
    last = json.dumps({"file": "a.mxt", "errors": 6, "summary": ""})
    assert check(text, "--json")[1].splitlines()[-1] == last


@pytest.mark.parametrize(
    ("text", "places"),
    [
        ("VA Q1=5)\nPG 1\nMR Q1\nQ1=7\nIC Q1\nE\nPG\n", [1]),
        ("VA Q1=99999999999\nPG 1\nMR Q1\nQ1=7\nE\nPG\nQ1=8\n", [1]),
        ("VA VM\nPG 1\nE\nPG\n", [1]),
        ("PG 9999\nLB K1\nBR K1\nE\nPG\nEX K1\n", [1, 6]),
        ("PG\nLB K1\nBR K1\nE\nPG\n", [1]),
        ("PG 1\nLB K1\nE\nPG 50\nLB K2\nBR K1\nE\nPG\n", [4]),
        ("PG 1\nLB K1)\nBR K1\nCL K1,R1=1\nE\nPG\n", [2]),
        ("PG 1\nLB K1\nBR K1\nE\n", [1]),
    ],
)
def test_what_follows_from_an_error_that_was_told_is_not_told(check: Check, text: str, places: list[int]) -> None:
    code, _, told = check(text)
    assert code == 1 and [int(line.split(":")[1]) for line in told] == places


def test_a_personality_is_asked_about_the_lines_that_are_right(check: Check) -> None:
    text = "LB1=5\nPG 1\nF1=2.5\nMR (\nE\nPG\n"
    assert [line.split(" ")[0] for line in check(text)[2]] == ["a.mxt:1:1:", "a.mxt:4:4:"]
    told = check(text, "--personality", "MDI")[2]
    assert [line.split(" ")[0] for line in told] == ["a.mxt:1:1:", "a.mxt:3:1:", "a.mxt:3:1:", "a.mxt:4:4:"]
    assert " this is a program for LMDCE, LMDCM, LMDOE, LMDOM or LMM: no MDI has F1; check it with " in told[2]


@pytest.mark.parametrize(
    ("personality", "line", "word"),
    [
        ("MDI", "BR K1,AO=1", "AO"), ("MDI", "R1=TM+1", "TM"), ("MDI", "PR RD", "RD"), ("MDI", "IC VT", "VT"),
        ("LMDCM", "BR K1,IL=1", "IL"), ("LMDCM", "PR IH", "IH"), ("LMDCM", "MR CR", "CR"), ("LMDCM", "OL 0", "OL"),
    ],
)  # fmt: skip
def test_a_word_of_another_firmware_is_no_word_of_this_drive(
    check: Check, personality: str, line: str, word: str
) -> None:
    code, _, told = check(f"PG 1\nLB K1\n{line}\nE\nPG\n", "--personality", personality)
    unknown, named = sorted(told, key=lambda each: " warning: " in each)
    assert code == 1 and f"a.mxt:3:{line.index(word) + 1}: unknown name {word}; other drives" in unknown
    assert named.startswith("a.mxt:3:1: warning: this is a program for ") and f"no {personality} has {word};" in named
    assert check(f"VA {word}\nPG 1\nLB K1\n{line}\nE\nPG\n", "--personality", personality)[0] == 0


def test_a_program_without_pg_is_told_once_and_what_is_wrong_with_a_setting_where_it_is(check: Check) -> None:
    told = check("RC=400\nLB K1\nMR 5\nH\nE\n")[2]
    assert [line.split(" ")[0] for line in told] == ["a.mxt:1:1:", "a.mxt:2:1:"]
    told = check("VM=*5\nRC=400\n")[2]
    assert [line.split(" ")[0] for line in told] == ["a.mxt:1:1:", "a.mxt:1:4:", "a.mxt:2:1:"]
    assert "settings only" in told[0]


# -- before a download


def test_a_download_says_how_many_more_errors_there_are(home: Home) -> None:
    file = home.file("b.mxt", 'PG 1\nPR "\xe9"\nPR "\xe8"\nE\n')
    code, _, told = home.run("program", "download", "sim:#press", file)
    assert code == 2 and told.startswith("b.mxt:1:1: PG is never ended (2 more") and told.count("\n") == 1


def test_a_download_tells_the_warnings(home: Home) -> None:
    download = ("program", "download", "sim:#eth", home.file("a.mxt", SETTINGS.replace("EM 1\n", "")))
    code, _, told = home.run(*download)
    assert code == 0 and "a.mxt:2:1: warning: holds no program: settings only" in told.splitlines()
    home.file("a.mxt", "PG 1\nLB K1\nBR K1,R1=1&MV\nE\nPG\n")
    code, _, told = home.run(*download)
    assert code == 0 and "is read as (R1=1)&MV" in told


def test_a_refusal_says_which_products_have_the_word(check: Check) -> None:
    code, _, told = check("PG 1\nLB G1\nBR G1,LR=1\nCF\nE\nPG\n", "--personality", "LMDOM")
    assert code == 1 and [line.partition("; ")[2] for line in told] == [
        "LR is for LMDCE, LMDCM", "check it with --personality LMDCE", "CF is for LMDCE, LMDCM"
    ]  # fmt: skip
    assert "this is a program for LMDCE or LMDCM: no LMDOM has LR, CF" in told[1]


def test_a_program_of_another_language_is_named_as_such(check: Check) -> None:
    told = check("X1000\nWAITX\nEND\n")
    assert told == (
        1, "", ["a.mxt:1:1: this is A-SCRIPT, not MCode; name it .prg or .asc, or check it with --language pmx"]
    )  # fmt: skip
    code, _, (told,) = check("PG 1\nLB G1\nMR 5\nH\nE\nPG\n", name="a.prg")
    assert code == 1 and told.startswith("a.prg:1:1: this is MCode, not A-SCRIPT; name it .mxt or .txt, or check")
    assert len(check("X1000\nWAITX\nEND\n", "--language", "mcode")[2]) > 1


# -- canonical spelling


def test_format_rewrites_a_file_without_errors_and_says_how_many_lines(check: Check) -> None:
    text = "vm 5000   ' fast\nPG 1\n\nlb g1\n  mr512\n  h\ne\npg\n"
    spelled = "VM=5000   ' fast\nPG 1\n\nLB G1\n  MR 512\n  H\nE\nPG\n"
    assert check(text, "--format") == (0, "a.mxt: nothing wrong, 4 lines of program; 6 lines formatted\n", [])
    assert Path("a.mxt").read_text() == spelled
    assert check(spelled, "--format")[1] == "a.mxt: nothing wrong, 4 lines of program; 0 lines formatted\n"
    fact = {"file": "a.mxt", "errors": 0, "summary": "nothing wrong, 4 lines of program", "formatted": 6}
    assert check(text, "--format", "--json") == (0, json.dumps(fact) + "\n", [])


def test_format_leaves_a_file_with_errors_and_rewrites_one_with_warnings(check: Check) -> None:
    wrong = "pg 1\nlb g1\nfoo\ne\npg\n"
    code, out, (told,) = check(wrong, "--format")
    assert (code, out, Path("a.mxt").read_text()) == (1, "", wrong) and told.startswith("a.mxt:3:1: unknown name FOO")
    code, out, (told,) = check("pg 1\nlb g1\nmr 5\nmr 6\ne\npg\n", "--format")
    assert code == 0 and told.startswith("a.mxt:3:1: warning: mr 6 in line 4 does not wait")
    assert Path("a.mxt").read_text() == "PG 1\nLB G1\nMR 5\nMR 6\nE\nPG\n"


def test_a_line_that_would_become_too_long_keeps_its_spelling(check: Check) -> None:
    text = "PG 1\nLB G1\npr" + '"0123456789"p' * 4 + '"0123456"\nE\nPG\n'
    assert len(text.splitlines()[2]) == 63
    assert check(text, "--format")[0] == 0 and Path("a.mxt").read_text() == text


def test_a_script_of_the_pmx_is_formatted_too(check: Check) -> None:
    text = "WHILE  V1 < 10 ; ten\n  V1 = V1 + 1\nENDWHILE\nEND\n"
    assert check(text, "--format", name="a.prg")[0] == 0
    assert Path("a.prg").read_text() == "WHILE V1<10    ; ten\n  V1=V1+1\nENDWHILE\nEND\n"


def test_a_program_that_is_too_big_is_one_line_with_its_size_and_that_of_the_drive(check: Check) -> None:
    code, _, [told] = check("PG 1\nLB G1\n" + "R1=1\n" * 5000 + "E\nPG\n")
    assert code == 1 and "program too big: 5002 lines take " in told and "bytes, the drive holds 6384;" in told


def test_of_many_problems_a_hundred_are_shown(check: Check) -> None:
    shown = check("PG 1\nLB G1\n" + "FROB 7\n" * 150 + "E\nPG\n")[2]
    assert len(shown) == 101 and shown[-1] == "a.mxt: 50 more problems, not shown"


# -- set-ups that are stored, and refused when they are executed


LATER = "a drive refuses it when it executes it"


@pytest.mark.parametrize(
    ("lines", "personality", "told"),
    [
        ("IS=9,1,0", "LMDCM", "error 10"),
        ("IS=1,99,0", "LMDCM", "error 8"),
        ("OS=1,3,1", "LMDCM", "error 8"),
        ("TI=7,Ga\nTE=1", "LMDCM", "error 10"),
        ("LS=2,5,1", "LMDCM", "error 21"),
        ("PF=20,1", "LMDCM", "error 21"),
        ("TT=70000,Ga\nTE=8", "LMDCM", "error 21"),
        ("S1=99,0,0", "MDI", "error 8"),
        ("DN=b", "LMDCM", "error 21"),
        ('DN="bc"', "LMDOM", "error 21"),
        ("MU=1,7", "LMDCM", "error 21"),
        ("LS=0,500,1\nLS=1,100,1", "LMDCM", "after the set-ups before it (error 21"),
        ("IS=1,1,0\nIS=2,1,0", "LMDCM", "after the set-ups before it (error 6"),
    ],
)
def test_a_set_up_in_a_program_is_checked_as_one_outside_of_it(
    check: Check, lines: str, personality: str, told: str
) -> None:
    code, _, found = check(f"PG 1\nLB Ga\n{lines}\nE\nPG\n", "--personality", personality)
    (problem,) = [each for each in found if LATER in each]
    number = 2 + (lines.count("\n") + 1 if "after" in told else 1)
    assert problem.startswith(f"a.mxt:{number}:1: warning: ") and told in problem and code == 0


@pytest.mark.parametrize(
    "lines",
    [
        "IS=R1,1,0",
        "IS=1,1,0\nLB Gb\nIS=2,1,0",  # another path may have set input 1 up anew
        "IS=1,1,0\nCL Ga\nIS=2,1,0",
        "IS=1,1,0\nIS=1,0,0\nIS=2,1,0",
        "LS=1,100,1\nLS=0,-100,1",
        "TR=100,0,5\nTE=16",
        'DN="b"',
        "MU=2,1",
    ],
)
def test_nothing_is_said_of_a_set_up_that_the_drive_may_take(check: Check, lines: str) -> None:
    _, _, found = check(f"PG 1\nLB Ga\n{lines}\nE\nPG\n")
    assert [each for each in found if LATER in each] == []


def test_trips_on_position_that_exclude_each_other_are_named_at_the_line_that_enables_both(check: Check) -> None:
    _, _, found = check("PG 1\nLB Ga\nTP=5,Ga\nTR=5,Ga\nTE=2\nTE=16\nTE=19\nTE=0\nE\nPG\n")
    assert [each.partition(": warning: ")[0] for each in found if "error 39" in each] == ["a.mxt:7:1"]


# -- what one unit lacks


UNIT = """[[bus]]
name = "line"
[[bus.drive]]
name = "a"
party = true
[bus.drive.identity]
version = "LMDOM 5.007, Hw: 3.2"
part = "LMDOM421"
"""


def test_a_drive_of_a_cell_decides_which_commands_there_are(check: Check, home: Home) -> None:
    cell = home.file("unit.toml", UNIT.replace('name = "a"', 'name = "a"\npersonality = "LMDOM"'))
    text = "PG 1\nLS=0,5,1\nO1=1\nPR AF\nE\nPG\n"
    code, _, found = check(text, "--cell", f"{cell}#line:a")
    assert code == 1  # an LMDOM has no AF
    assert found == [
        "a.mxt:2:1: warning: LS needs firmware 6, and this drive has 5.007; this drive refuses it",
        "a.mxt:3:1: warning: O1 is not on a NEMA 17 (LMDOM421); this drive refuses it",
        *[each for each in found if "AF" in each],
    ]
    code, _, (told,) = check(text, "--cell", f"{cell}#line:x")
    assert code == 2 and "no such drive" in told


def test_a_download_warns_of_what_the_drive_lacks_by_what_it_reports(home: Home) -> None:
    cell = home.file("unit.toml", UNIT.replace('name = "a"', 'name = "a"\npersonality = "LMDOM"'))
    file = home.file("a.mxt", "PG 1\nLB G1\nLS=0,5,1\nE\nPG\n")
    code, _, err = home.run("program", "download", f"sim:{cell}", file)
    assert code == 0 and f"{file}:3:1: warning: LS needs firmware 6, and this drive has 5.007" in err
    code, out, err = home.run("send", f"sim:{cell}", f"/check {file}")
    assert code == 0 and "LS needs firmware 6, and this drive has 5.007" in err
