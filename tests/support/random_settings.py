"""Random lines that set up a simulated MCode drive; it refuses some of them."""

from __future__ import annotations

from random import Random

from multidrop.families.lexium.manual import parameters as manual
from multidrop.families.lexium.manual.mnemonic import Mnemonic
from multidrop.families.lexium.manual.point_types import types

PROGRAM = "PG 1\nLB G1\nRT\nLB G2\nRT\nE\nPG"
NAMES = ("TI=1,G1", "TP=100,G2", "TT=9,G1", "TM=G1", "TC=G1", "TR=50,G2,3", "TA=3,G1", "VA Q1=5", "VA Q2", "Q1=7")
RULED = {"MS", "EE", "AS", "VI", "VM", "A", "D", "MF", "TS", "HT", "MT", "SA", "EL", "DE", "MU", "CB", "FL"}
"""Settings that depend on each other."""


def lines(random: Random, product: str, count: int) -> list[str]:
    """Random lines for a product."""
    pool = [each for each in manual.settings(product) if each.name not in manual.WIRE | {"LK", "PW"}]
    plain = [each for each in pool if each.low is not None and each.name not in manual.TRIPS]
    ruled = [each for each in plain if each.name in RULED]
    makers = (
        lambda: _point(random, product, pool),
        lambda: random.choice(NAMES),
        lambda: _plain(random, random.choice(ruled)),
        lambda: _plain(random, random.choice(plain)),
    )
    return [random.choices(makers, (7, 1, 6, 6))[0]() for _ in range(count)]


def _plain(random: Random, row: Mnemonic) -> str:
    low, high = int(row.low or 0), int(row.high or 0)
    value = random.choice((low, high, low + 1, random.randint(low, high), random.randint(1, 800000)))
    return f"{row.name}={random.choice(row.values) if row.values else value}"


def _point(random: Random, product: str, pool: list[Mnemonic]) -> str:
    names = [each.name for each in pool if types(each.name, product)]
    names += [f"{word}{n}" for word in manual.lists(product) for n in (1, 2, 3) if word != "LS"] + ["LS0", "LS1"]
    name = random.choice(names)
    if name.startswith("LS"):
        return f"LS={name[2]},{random.randint(-300, 300)},{random.randint(0, 1)}"
    kind, active = random.choice(sorted(types(name, product))), random.randint(0, 1)
    return f"{name}={kind},{active}" if name[0] == "S" else f"{name[:2]}={name[2]},{kind},{active}"
