"""Live seeds and judge them. Run: `make simulate SEED=7`, or SEEDS=1-200 on all cores; STEPS=60 for longer stories.

A seed that breaks a rule is shrunk to the fewest steps and kinds of faults. Its trace follows, the command that lives
just these again (ONLY=, WITHOUT=), and the one line of the seed. RESUME=FILE keeps the results of a range, so that it
can be taken up again; SUM='FILE FILE' adds up such files. MUTANT=NAME plants a defect first, and ends at the seed that
catches it; MUTANT=all tries each.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from soak.simulation import mutants
from soak.simulation.figures import Figures
from soak.simulation.judges.judge import judged
from soak.simulation.records.climate import FAULTS
from soak.simulation.runs import STEPS, kept, lives, run, verdict
from soak.simulation.shrinking import Life, shrunk
from soak.simulation.story import whole
from soak.simulation.trace import readable


def main(arguments: list[str] | None = None) -> int:
    """Live the seeds of the arguments; return 1 if one broke, 2 for wrong arguments."""
    parser = argparse.ArgumentParser(prog="make simulate", description=__doc__)
    parser.add_argument("--seed", type=int)
    parser.add_argument("--seeds", default="1-100", help="a range, A-B")
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--only", type=_numbers, help="the only steps that are told: 3,9,12")
    parser.add_argument("--without", type=_kinds, default=(), help="kinds of faults that are left out: flip,late")
    parser.add_argument("--jobs", type=int, default=0, help="processes; one a core unless given")
    parser.add_argument("--resume", type=Path, help="a file of results to take up again")
    parser.add_argument("--sum", type=Path, nargs="+", help="add up files of results, and live nothing")
    parser.add_argument("--mutant", default="", help="a defect of soak/mutants that is planted first; all: each")
    parser.add_argument("--until-broken", action="store_true", help="end at the first seed that breaks a rule")
    chosen = parser.parse_args(arguments)
    if chosen.seed is not None:
        steps = chosen.only if chosen.only is not None else whole(chosen.seed, chosen.steps)
        return _one(Life(chosen.seed, steps, chosen.without), whole=chosen.only is None)
    first, _, last = chosen.seeds.partition("-")
    try:
        if chosen.sum:
            return _sum(chosen.sum)
        seeds = range(int(first), int(last or first) + 1)
        return _mutants(seeds, chosen) if chosen.mutant else _range(seeds, chosen)
    except ValueError as problem:
        print(problem, file=sys.stderr)
        return 2


def _numbers(text: str) -> tuple[int, ...]:
    return tuple(map(int, filter(None, text.split(","))))


def _kinds(text: str) -> tuple[str, ...]:
    kinds = tuple(filter(None, text.split(",")))
    if unknown := [each for each in kinds if each not in FAULTS]:
        raise argparse.ArgumentTypeError(f"no kind of fault {unknown[0]}; valid: {', '.join(FAULTS)}")
    return kinds


def _one(life: Life, whole: bool) -> int:
    """Live a seed; shrink a whole story that breaks a rule, and show what is left of it."""
    world = life.live()
    found = judged(world)
    for name in found.rules[:1]:
        life = shrunk(life, name) if whole else life
        _show(life)
    print(verdict(world, found))
    return int(bool(found.breaches))


def _show(life: Life) -> None:
    world = life.live(keep=True)
    print("\n".join(readable(world.history)))
    for rule, text in judged(world).breaches:
        print(f"{rule.name} ({rule.sentence} docs/safety.md, {rule.promise!r}): {text}")
    print(f"again: {life.command}")


def _mutants(seeds: range, chosen: argparse.Namespace) -> int:
    """Plant mutants; print a row for each, and what its seed broke. Return 1 if one was not caught."""
    tried = []
    print(mutants.TITLE)
    for name in mutants.chosen(chosen.mutant):
        tried.append(each := mutants.caught(name, seeds, chosen.steps, chosen.jobs))
        print(each.row)
        if not each.rule or chosen.mutant != mutants.ALL:
            print(each.said)
        sys.stdout.flush()
    print(f"{sum(bool(each.rule) for each in tried)} of {len(tried)} mutants caught")
    return int(not all(each.rule for each in tried))


def _sum(files: list[Path]) -> int:
    """Add up the results of files; say which seeds broke a rule."""
    figures = Figures()
    for each in (found for file in files for found in kept(file)):
        figures.add(each)
        if each.breaches:
            print(each.line)
    print("\n".join(figures.rows()))
    return int(figures.broken > 0)


def _range(seeds: range, chosen: argparse.Namespace) -> int:
    """Live a range; shrink the first seed that breaks each rule."""
    figures, seen = Figures(), set[str]()
    for each in run(lives(seeds, chosen.steps), chosen.jobs, chosen.resume):
        figures.add(each)
        if not each.breaches:
            continue
        print(each.line)
        for name, text in each.breaches:
            print(f"  {name}: {text}")
        if chosen.until_broken:
            return 1
        name = each.breaches[0][0]
        if name not in seen:
            seen.add(name)
            print(f"  again: {shrunk(Life(each.seed, whole(each.seed, chosen.steps)), name).command}")
        sys.stdout.flush()
    print("\n".join(figures.rows()))
    return int(figures.broken > 0)


if __name__ == "__main__":
    raise SystemExit(main())
