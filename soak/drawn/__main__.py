"""Draw mutants and try them. Run: `make mutants ROOM=drives N=100 SEED=7`; without ROOM, N in each room.

Prints what saw each, and a line for each room: `drives: 92 of 100 seen`. A mutant that behaves as the program does is
marked in `soak/drawn/equivalent.csv`, with the reason, and is not drawn. `make map` measures again which tests execute
which line.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from soak.drawn import tests_of
from soak.drawn.rooms import ROOMS, draw
from soak.drawn.trial import Verdict, tried


def main(arguments: Sequence[str] | None = None) -> int:
    """Do what the arguments say; return 2 for wrong ones."""
    parser = argparse.ArgumentParser(prog="make mutants", description=__doc__)
    parser.add_argument("--room", choices=ROOMS, help="without it, every room")
    parser.add_argument("--count", type=int, default=100, help="number of mutants of a room")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--list", action="store_true", help="print what is drawn, and try nothing")
    parser.add_argument(
        "--measured", nargs=3, metavar=("DATA", "DURATIONS", "QUICK"), help="make the map of tests anew"
    )
    parser.add_argument("--some", action="store_true", help="keep what is known of tests that were not measured")
    chosen = parser.parse_args(arguments)
    if chosen.measured:
        data, durations, quick = map(Path, chosen.measured)
        made = tests_of.measured(data, durations.read_text(), quick.read_text().split())
        tests_of.keep(tests_of.joined(tests_of.kept(), made) if chosen.some else made)
        return 0
    if not tests_of.FILE.exists() and not chosen.list:
        print(f"{tests_of.FILE} is missing; `make map` makes it", file=sys.stderr)
        return 2
    rooms = [chosen.room] if chosen.room else list(ROOMS)
    lines = [_room(room, chosen) for room in rooms]
    print("\n".join(lines))
    return 0


def _room(room: str, chosen: argparse.Namespace) -> str:
    """Try the mutants of a room; print what nothing saw, and return the line of the room."""
    drawn = draw(room, chosen.count, chosen.seed)
    if chosen.list:
        print("\n".join(each.words for each in drawn))
        return f"{room}: {len(drawn)} drawn"
    began = time.monotonic()
    verdicts = tried(drawn, tests_of.kept(), chosen.jobs, _tell)
    seen = [each for each in verdicts if each.by]
    quick = sum(each.quick for each in seen)
    took = time.monotonic() - began
    print(f"{room}: {quick} of {len(seen)} seen by the quick tests and the seeds, {took:.0f} s")
    return f"{room}: {len(seen)} of {len(verdicts)} seen"


def _tell(verdict: Verdict) -> None:
    """Print what saw a mutant."""
    sight = verdict.by or f"NOT SEEN by {verdict.tests} tests and the seeds"
    print(f"{verdict.mutant.words}\n    {sight}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
