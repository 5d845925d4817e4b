"""Whatever is asked of a drive and done to it: nothing crashes, and it makes no difference how its time is advanced."""

from __future__ import annotations

from random import Random

import pytest

from multidrop.families.lexium.manual.errors import TEXTS
from multidrop.families.lexium.manual.table import MDRIVE, MNEMONICS
from tests.support.lexium import drive

MDRIVES = ("MDI", "MDIE", "MDIX")
_BOTH = """\
MA 100000|MA -50000|MR 7777|MR -3333|MA 0|MA 9,0,1|SL 30000|SL -200000|SL 0|HM 1|HM 3|HI 1|HI 4|EE=1|EE=0
DE=0|DE=1|P=0|PM=1|SM=1|SM=0|ST=0|MS=128|MS=256|LM=4|LM=1|LM=2|TP=5000,0|TE=2|TR=3000,0|TE=16|TE=0|VI=500|VM=300000
RC=100|"""
_LEXIUM = """\
HF 2|AS=0|AS=1|AS=2|AS=3|MU=1|MU=2|MU=0|CF|AT=2|AT=3|DT=2|AJ=50|BE=1|BL=2000|BM=1|BM=0|LS=1,60000,1|LS=0,-60000,1
LS=1,0,0|RD=1|RD=0|TS=60000|TD=0|TQ=80|LT=50|LG=3000|LD=500|SC 1"""
_MDRIVE = """\
HM 2|HM 4|PM=0|VI=10|VM=5000000|MT=100|MT=0|HT=0|HT=300|-700|700|CM=1|CM=0|CR=1.5|S7=33,0|S7=34,1|S1=1,0,0|S4=17,0,0
S4=16,1,0|O4=1|OL 0|OT 255|OH 3|S9=7,0|S9=0,0|JE=1|JE=0|S13=60,0|S13=61,0|PS|RS|EX 1|E|DB=1|SF=10|EL=1000|S5=9"""
PROGRAM = "PG 1\nLB G1\nMR 5000\nH\nIC R1\nMR -4000\nH 100\nBR G1,R1<5\nE\nPG"


def history(personality: str, seed: int, parts: int) -> list[tuple[object, ...]]:
    """What a drive tells after each of forty random lines, some with a push or (MDrivePlus) an input behind them."""
    random, mdrive = Random(seed), personality in MDRIVES
    lines = (_BOTH + (_MDRIVE if mdrive else _LEXIUM)).replace("\n", "|").split("|")
    device = drive(
        *(("S1=1,0,0", "S2=2,0,0", "S3=3,0,0") if mdrive else ("IS=1,1,0", "IS=2,2,0", "IS=3,3,0")),
        personality=personality,
        program=PROGRAM if mdrive else "",
        stall_at=random.choice([None, 40000, -20000, *([] if mdrive else [0])]),
        locked=tuple((start, start + 2) for start in (random.uniform(0, 20), random.uniform(0, 20))),
        home=random.choice([None, -10000, *([(-15000, -10000), (20000, 30000), (5000, 5100)] if mdrive else [30000])]),
        limit_plus=random.choice([None, 80000]),
        limit_minus=random.choice([None, -90000]),
        load=random.choice([0, 0.3, 0.3, 1.2]),
    )
    t, told = 0.0, []
    for _ in range(40):
        line, push = random.choice(lines), random.choice([0, 0, 0, 300, -300, 5000])
        point, level = random.choice([0, 0, 1, 4, *device.motor.inputs.numbers]), random.choice([0, 1, None])
        step = random.choice([0.05, 0.3, 1.5, *([0.001] if mdrive else [])])
        refused = device.execute(line, t).refused
        if push:
            device.world.push(push, t)
        if point and mdrive:
            device.world.set_input(point, level, t)
        device.advance(t)
        for part in range(1, parts):
            device.advance(t + step * part / parts)
        t += step
        device.advance(t)
        rotor, error = device.motor.axis.rotor, device.memory.values["ER"]
        assert not mdrive or error in TEXTS["MDI"], line
        where = round(rotor.position(t), 3)
        told.append((line, refused, error, device.position(t), device.moving(t), where, device.outputs(t)))
    return told


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.timeout(60)
def test_time_may_be_advanced_in_any_number_of_steps(seed: int) -> None:
    assert history("LMDCM", seed, 1) == history("LMDCM", seed, 7)


@pytest.mark.slow
@pytest.mark.parametrize("personality", MDRIVES)
@pytest.mark.parametrize("seed", range(8))
@pytest.mark.timeout(60)
def test_time_of_an_mdrive_may_be_advanced_in_any_number_of_steps(personality: str, seed: int) -> None:
    assert history(personality, seed, 1) == history(personality, seed, 7)


ARGUMENTS = ("", "0", "1", "-1", "5,K1", "K1", "16,0,0", "9", "1,0,0,0", "R1", "Q1", "2.5", '"a"', "9" * 11, "I9,1")


@pytest.mark.slow
@pytest.mark.parametrize("personality", MDRIVES)
def test_no_line_crashes_a_unit(personality: str) -> None:
    """Every word of both firmwares with every kind of argument, only a code of its own comes back."""
    device = drive("VA Q1", personality=personality, program=PROGRAM.replace("G1", "K1"))
    for word in sorted({*MNEMONICS, *MDRIVE, "CT", "ZZ", "O5", "S14"} - {"ER"}):
        for argument in ARGUMENTS:
            for line in (f"{word} {argument}", f"{word}={argument}", f"PR {word}", f"IC {word}", f"R1={word}"):
                device.execute(line, device.now)
                assert device.memory.values["ER"] in TEXTS["MDI"], line
                device.core.mode.address = None
        device.escape(device.now)
        device.advance(device.now + 0.01)
