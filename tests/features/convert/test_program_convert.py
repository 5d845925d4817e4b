"""`multidrop program convert`: the new file, the report, exit codes; both programs run beside each other."""

from __future__ import annotations

from tests.support.front_door import Home

FEEDER = "S1=0,0,0   ' part\nS3=16,1,0\nPG 1\nLB SU\nLB K1\nBR K1,I1=0\nO3=1\nMR 5000\nH\nO3=0\nPR P\nE\nPG\nS\n"
CONVERT = ("--to", "lexium", "--until", "0.6", "-o")


def test_a_program_is_converted_and_does_the_same(home: Home) -> None:
    home.file("a.mxt", FEEDER)
    code, out, err = home.run("program", "convert", "a.mxt", *CONVERT, "b.mxt")
    assert (code, err) == (0, "")
    assert (home.folder / "b.mxt").read_text() == FEEDER.replace("S1=0,0,0", "IS=1,0,0").replace(
        "S3=16,1,0", "OS=3,16,1"
    )
    first, second, last = out.splitlines()
    assert first.startswith("a.mxt:1:1: S1=0,0,0 is now IS=1,0,0; ") and "REWIRE" in second
    assert last == "MDI to LMDCM in b.mxt: 2 changes; run beside each other in 27 worlds, 0 differ"


def test_a_difference_of_the_runs_is_shown_and_is_exit_code_1(home: Home) -> None:
    home.file("a.mxt", "S1=16,1,0\nPG 1\nLB SU\nPR IL\nE\nPG\n")
    code, out, _ = home.run("program", "convert", "a.mxt", *CONVERT, "b.mxt")
    assert code == 1 and (home.folder / "b.mxt").exists()
    assert "differs with no input active: print 1: '14', converted: '15'" in out.splitlines()


def test_nothing_is_written_where_a_line_is_refused(home: Home) -> None:
    home.file("a.mxt", FEEDER.replace("S3=", "S4=").replace("PR P", "PR I5"))
    code, out, err = home.run("program", "convert", "a.mxt", *CONVERT, "b.mxt")
    assert (code, out) == (1, "") and not (home.folder / "b.mxt").exists()
    assert [line.partition(" ")[0] for line in err.splitlines()] == ["a.mxt:2:1:", "a.mxt:11:1:", "a.mxt:"]


def test_what_the_new_drive_refuses_is_refused_at_the_line_of_the_original(home: Home) -> None:
    home.file("a.mxt", "VA Q1=3000000\nVM=Q1\nPG 1\nMR 5\nH\n5\nE\nPG\n")
    code, _, err = home.run("program", "convert", "a.mxt", *CONVERT, "b.mxt")
    assert (
        code == 1
        and err.startswith("a.mxt:2:1: once converted: VM=Q1: error 21")
        and not (home.folder / "b.mxt").exists()
    )


def test_wrong_input_is_one_line(home: Home) -> None:
    home.file("a.mxt", FEEDER)
    home.file("lmd.mxt", "IS=1,0,0\nPG 1\nE\nPG\n")
    home.file("p.prg", "END\n")
    for words, message in {
        ("lmd.mxt", *CONVERT, "b.mxt"): "lmd.mxt: line 1: this is a program for LMD",
        ("p.prg", *CONVERT, "b.mxt"): "p.prg: A-SCRIPT cannot be converted for lexium",
        ("a.mxt", *CONVERT, "a.mxt"): "a.mxt: exists already",
        ("a.mxt", "--personality", "MDI", *CONVERT, "b.mxt"): "--personality: no lexium is MDI; valid: LMDCM",
        ("none.mxt", *CONVERT, "b.mxt"): "none.mxt: cannot be read",
    }.items():
        code, out, err = home.run("program", "convert", *words)
        assert code in (1, 2) and out == "" and err.startswith(message) and err.count("\n") == 1, err


def test_the_text_may_go_to_standard_output(home: Home) -> None:
    home.file("a.mxt", "S1=0,0,0   ' part\nPG 1\nPR P\nE\nPG\n")
    code, out, err = home.run("program", "convert", "a.mxt", *CONVERT, "-")
    assert code == 0 and out.startswith("IS=1,0,0   ' part\nPG 1\n") and err.endswith("0 differ\n")
