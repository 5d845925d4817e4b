"""Programs as people write them for MDrivePlus units: checked and run from the command line on each personality."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.support.front_door import Home

FEEDER = """
' [VARIABLES]
VM 5000000
A 1000000
NE=1
S1=1,0,0          ' home
S2=2,1,0
S4=17,0,0         ' moving
S3=16,1,0
S5=9
VA CT
VA AO=3
VA TS = 2
OL 0
' [PROGRAMS]
PG 100
LB SU
  BR Mx
LB Rd
  IC CT
  RT
LB Tm
  O3=1
  H 10
  O3=0
  OL 13
  RT
LB Mx
  MR 51200
  H
  -25600          ' the same move again
  H
  CL Rd
  CL Tm
  BR Mx, CT < AO
  PR "Count ", CT, " at ", P
  OL 0
E
PG
S
' [END]
"""
ENCODED = """
EE=1
DB=2
SF=40
SM=0
PM=1
VI=40
VM=30720
PG 1
LB SU
  P=0
  MA 2048
  H
  PR "at ",P," steps ",C1
  HI 1
  H
  PR "index ",I6
E
PG
S
"""
EXPANDED = """
S1=0,1,0
S9=16,1,1
S10=16,1,1
S11=17,0,0
S12=4,0,0
S13=60,0
S7=33,0
EL=512
D12=5
CW=20
PG 1
LB SU
  OH 3
  PR IH
  TC=Tz
  TE=4
  OT 0
  PR IN
E
LB Tz
  PR PC
  RT
PG
"""

FILES = {"feeder.mxt": FEEDER, "encoded.mxt": ENCODED, "expanded.mxt": EXPANDED}
Run = Callable[..., tuple[int, list[str], list[str]]]


@pytest.fixture
def run(home: Home) -> Run:
    """Run `program`: exit code, printed lines, narration."""
    for name, text in FILES.items():
        home.file(name, text)

    def program(*arguments: str) -> tuple[int, list[str], list[str]]:
        code, out, err = home.run("program", *arguments)
        return code, out.splitlines(), err.splitlines()

    return program


@pytest.mark.parametrize("personality", ["MDI", "MDIE", "MDIX"])
def test_a_program_with_names_that_a_lexium_has_as_words(run: Run, personality: str) -> None:
    code, out, _ = run("check", "feeder.mxt", "--personality", personality)
    assert (code, out) == (0, ["feeder.mxt: nothing wrong, 22 lines of program"])
    code, out, told = run("test", "feeder.mxt", "--personality", personality)
    assert (code, told) == (0, [])
    assert out[0].endswith("  Count 3 at 76800") and "6 motions, 46 lines, no errors" in out[1]


def test_a_lexium_says_what_it_does_not_take_of_it(run: Run) -> None:
    code, out, told = run("check", "feeder.mxt", "--personality", "LMDCM")
    assert (code, out) == (1, [])
    assert any(
        "warning: this is a program for MDI, MDIE or MDIX: no LMDCM has S1, S2, S4, S3 and" in line for line in told
    )
    assert "feeder.mxt:3:1: VM 5000000: error 21, value out of range or not allowed; VM takes 2 to 2560000" in told
    assert "feeder.mxt:19:1: LB Rd: error 29, the name is a command of the drive; choose another name" in told


def test_a_program_in_encoder_counts(run: Run) -> None:
    for personality in ("MDIE", "MDIX"):
        assert run("check", "encoded.mxt", "--personality", personality)[0] == 0
        code, out, told = run("test", "encoded.mxt", "--personality", personality)
        assert (code, told) == (0, [])
        assert [line.split("  ")[-1] for line in out[:2]] == ["at 2048 steps 51200", "index 1"]
    code, _, told = run("check", "encoded.mxt", "--personality", "MDI")
    assert told[1].startswith(
        "encoded.mxt:2:1: warning: this is a program for MDIE, MDIX, LMDCE, LMDCM or LMM: no MDI "
    )
    assert code == 1 and told[0] == "encoded.mxt:2:1: EE=1: error 37, not available in this drive; EE is for MDIE, MDIX"


def test_a_program_for_expanded_io(run: Run) -> None:
    assert run("check", "expanded.mxt", "--personality", "MDIX")[0] == 0
    code, out, told = run("test", "expanded.mxt", "--personality", "MDIX")
    assert (code, told) == (0, [])
    assert [line.split()[-1] for line in out[:2]] == ["15", "206"]
    code, _, told = run("check", "expanded.mxt", "--personality", "MDIE")
    assert told[1].startswith(
        "expanded.mxt:3:1: warning: this is a program for MDIX: no MDIE has S9, S10, S11, S12 and"
    )
    assert code == 1 and told[0] == "expanded.mxt:3:1: S9=16,1,1: error 37, not available in this drive; S9 is for MDIX"
