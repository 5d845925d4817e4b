"""Playing a macro: each line goes to a given `run`, at the interval at which it was typed."""

from __future__ import annotations

import time
from collections.abc import Awaitable, Callable, Mapping

from macros.model import Macro, filled

Run = Callable[[str], Awaitable[None]]
Sleep = Callable[[float], Awaitable[None]]


async def play(
    macro: Macro,
    run: Run,
    sleep: Sleep,
    values: Mapping[str, str],
    clock: Callable[[], float] = time.monotonic,
) -> None:
    """Run each line in turn; raise the first failure.

    Each step starts `after` seconds after the start of the step before (the first: after the call), or at once if
    that step took longer. Raises Diagnostic before the first line if the values do not fit. `sleep` follows `clock`
    (s).
    """
    lines = filled(macro, values)
    started = clock()
    for step, line in zip(macro.steps, lines, strict=True):
        wait = started + step.after - clock()
        if wait > 0:
            await sleep(wait)
        started = clock()
        await run(line)
