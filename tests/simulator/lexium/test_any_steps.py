"""Whatever is asked of a drive and done to it: it makes no difference in how many steps its time is advanced."""

from __future__ import annotations

from random import Random

import pytest

from tests.support.lexium import drive

_TEXT = """\
MA 100000|MA -50000|MR 7777|MR -3333|MA 0|MA 9,0,1|SL 30000|SL -200000|SL 0|HM 1|HM 3|HI 1|HI 4|HF 2|EE=1|EE=0
AS=0|AS=1|AS=2|AS=3|MU=1|MU=2|MU=0|CF|DE=0|DE=1|P=0|PM=1|SM=1|SM=0|ST=0|AT=2|AT=3|DT=2|AJ=50|BE=1|BL=2000|BM=1
BM=0|LS=1,60000,1|LS=0,-60000,1|LS=1,0,0|RD=1|RD=0|MS=128|MS=256|TS=60000|TD=0|TQ=80|LM=4|LM=1|LM=2|LT=50|LG=3000
LD=500|SC 1|TP=5000,0|TE=2|TR=3000,0|TE=16|TE=0|VI=500|VM=300000|RC=100"""
LINES = _TEXT.replace("\n", "|").split("|")


def history(seed: int, parts: int) -> list[tuple[object, ...]]:
    """What a drive tells after each of forty random lines, some with a push behind them."""
    random = Random(seed)
    device = drive(
        "IS=1,1,0",
        "IS=2,2,0",
        "IS=3,3,0",
        stall_at=random.choice([None, 40000, -20000, 0]),
        locked=tuple((start, start + 2) for start in (random.uniform(0, 20), random.uniform(0, 20))),
        home=random.choice([None, -10000, 30000]),
        limit_plus=random.choice([None, 80000]),
        limit_minus=random.choice([None, -90000]),
        load=random.choice([0, 0.3, 0.3, 1.2]),
    )
    t, told = 0.0, []
    for _ in range(40):
        line, push, step = (
            random.choice(LINES),
            random.choice([0, 0, 0, 300, -300, 5000]),
            random.choice([0.05, 0.3, 1.5]),
        )
        refused = device.execute(line, t).refused
        if push:
            device.world.push(push, t)
        device.advance(t)
        for part in range(1, parts):
            device.advance(t + step * part / parts)
        t += step
        device.advance(t)
        rotor, error = device.motor.axis.rotor, device.memory.values["ER"]
        told.append((line, refused, error, device.position(t), device.moving(t), round(rotor.position(t), 3)))
    return told


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.timeout(60)
def test_time_may_be_advanced_in_any_number_of_steps(seed: int) -> None:
    assert history(seed, 1) == history(seed, 7)
