"""Choose the tests in which coverage is not measured, from one run that measured all: `make unmeasured`.

Measuring doubles the time of a test that computes. Left out are tests of half a second and more that show little
which cheaper ones do not: all after those that together show `SHARE` of the branches, most branches a second first.
"""

from __future__ import annotations

import heapq
import re
import sqlite3
import sys
from collections import Counter, defaultdict
from contextlib import closing
from pathlib import Path

SHARE = 0.985
CHEAP = 0.5
"""s; a test that takes less is measured whatever it shows."""
UNMEASURED = Path(__file__).with_name("unmeasured.txt")


def function(node: str) -> str:
    """The test function of a node, or of a context of coverage."""
    return re.split(r"[\[|]", node, maxsplit=1)[0]


def choose(times: Counter[str], shown: dict[str, set[tuple[int, int, int]]]) -> list[str]:
    """The test functions to leave out. `times`: s; `shown`: branches by test function."""
    everything = set().union(*shown.values())
    left, measured = set(everything), set[str]()
    queue = [(-len(branches) / (times[name] + 0.03), name) for name, branches in shown.items()]
    heapq.heapify(queue)
    while queue and len(left) > (1 - SHARE) * len(everything):
        _, name = heapq.heappop(queue)
        worth = -len(shown[name] & left) / (times[name] + 0.03)
        if queue and worth > queue[0][0]:
            heapq.heappush(queue, (worth, name))
        else:
            measured.add(name)
            left -= shown[name]
    return sorted(name for name in shown if name not in measured and times[name] >= CHEAP)


def main(data: str, durations: str) -> None:
    """Read a coverage file with a context for each test, and the durations that pytest printed."""
    times: Counter[str] = Counter()
    for line in Path(durations).read_text().splitlines():
        if found := re.match(r"([\d.]+)s (?:call|setup|teardown)\s+(\S.*)$", line):
            times[function(found[2])] += float(found[1])
    with closing(sqlite3.connect(data)) as database:
        names = {number: function(name) for number, name in database.execute("select id, context from context")}
        shown: dict[str, set[tuple[int, int, int]]] = defaultdict(set)
        for file, context, begin, end in database.execute("select file_id, context_id, fromno, tono from arc"):
            if names[context]:  # else at import
                shown[names[context]].add((file, begin, end))
    UNMEASURED.write_text("\n".join(choose(times, shown)) + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
