"""Choose the tests that `make quick` leaves out as slow, from the durations of one run: `make unmeasured`.

One test in ten takes three quarters of the time: those that take longer than `QUICK` a case.
"""

from __future__ import annotations

import re
import sys
from collections import Counter
from pathlib import Path

from tests.support.choose_measured import function

QUICK = 0.03
"""The longest time of a case of a quick test, s: the mean of all cases of a function."""
SLOW = Path(__file__).with_name("slow.txt")


def choose(durations: str) -> list[str]:
    """The test functions that are slow, in the durations as pytest prints them."""
    times, calls = Counter[str](), Counter[str]()
    for line in durations.splitlines():
        if found := re.match(r"\s*([\d.]+)s (call|setup|teardown)\s+(\S.*)$", line):
            times[function(found[3])] += float(found[1])
            calls[function(found[3])] += found[2] == "call"
    return sorted(name for name in times if times[name] > QUICK * calls[name])


if __name__ == "__main__":
    SLOW.write_text("\n".join(choose(Path(sys.argv[1]).read_text())) + "\n")
