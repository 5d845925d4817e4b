"""Live seeds and judge them. Run: `make simulate SEED=7`, `make simulate SEEDS=1-200`, with `STEPS=60` for longer ones.

The last line of a seed is the same in every run of it. A range prints only the seeds that broke, then the counts.
"""

from __future__ import annotations

import argparse
from collections import Counter

from soak.simulation.judge import broken
from soak.simulation.world import World, lived

STEPS = 30


def verdict(world: World) -> str:
    """The line of a seed."""
    rules = dict.fromkeys(rule.name for rule, _ in broken(world))
    said = f"broke {', '.join(rules)}" if rules else "held"
    history = world.history
    return (
        f"seed {world.seed}: {said}, {world.loop.now:.1f} virtual s, {len(history.commands)} commands, "
        f"trace {history.trace}"
    )


def main() -> int:
    """Live the seeds of the arguments; return 1 if one broke."""
    parser = argparse.ArgumentParser(prog="make simulate", description=__doc__)
    parser.add_argument("--seed", type=int)
    parser.add_argument("--seeds", help="a range, A-B")
    parser.add_argument("--steps", type=int, default=STEPS)
    chosen = parser.parse_args()
    if chosen.seed is not None:
        return _one(chosen.seed, chosen.steps)
    first, _, last = (chosen.seeds or "1-100").partition("-")
    return _range(range(int(first), int(last or first) + 1), chosen.steps)


def _one(seed: int, steps: int) -> int:
    world = lived(seed, range(steps), keep=True)
    found = broken(world)
    if found:
        print("\n".join(world.history.lines))
    for rule, text in found:
        print(f"{rule.name}: {text}")
    print(verdict(world))
    return int(bool(found))


def _range(seeds: range, steps: int) -> int:
    counts: Counter[str] = Counter()
    for seed in seeds:
        world = lived(seed, range(steps))
        counts["commands"] += len(world.history.commands)
        counts["virtual s"] += round(world.loop.now)
        counts.update(world.history.counts)
        if found := broken(world):
            counts["broken"] += 1
            print(verdict(world), flush=True)
            for rule, text in found:
                print(f"  {rule.name}: {text}", flush=True)
    print(f"{len(seeds)} seeds: " + ", ".join(f"{number} {name}" for name, number in counts.items()))
    return int(counts["broken"] > 0)


if __name__ == "__main__":
    raise SystemExit(main())
