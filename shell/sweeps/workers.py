"""The cases of a sweep on the cores of this machine.

The first cases run in this process: they say how long one takes. Further processes begin only where that is worth it.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from itertools import islice

from multidrop.shell.sweeps import trial
from multidrop.shell.sweeps.interruption import Interruption
from multidrop.shell.sweeps.trial import Case, Job, Result

CHUNK = 0.075
"""The work of one chunk, s of processor time."""
WORTH = 0.1
"""The work that is worth further processes, s of processor time."""
FIRST = 3
"""The cases that run in this process first; the last of them is the measure."""
Run = Callable[[Job, Sequence[Case]], list[Result]]


def cores() -> int:
    """The number of cores that this process may use."""
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def results(
    job: Job, cases: Iterator[Case], count: int, jobs: int, interruption: Interruption, run: Run = trial.chunk
) -> Iterator[list[Result]]:
    """Run `count` cases in `jobs` processes; yield the results of each chunk as it ends."""
    seconds = 0.0
    for case in islice(cases, FIRST):
        begin = time.process_time()
        with interruption.open():
            found = run(job, [case])
        seconds = time.process_time() - begin
        yield found
    work = seconds * (count - FIRST)
    if jobs > 1 and work > WORTH:
        size = max(1, round(min(CHUNK, work / jobs / 8) / max(seconds, 1e-6)))
        from multidrop.shell.sweeps.pools import Pools  # 20 ms, which a small sweep is spared

        yield from Pools(job, jobs, interruption, run).results(chunks(cases, size))
    for case in cases:
        with interruption.open():
            found = run(job, [case])
        yield found


def chunks(cases: Iterator[Case], size: int) -> Iterator[list[Case]]:
    """Divide cases into chunks."""
    while found := list(islice(cases, size)):
        yield found
