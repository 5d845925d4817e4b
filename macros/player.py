"""Plays a macro: its lines through a `run` that is given, at the times at which they were typed."""

from __future__ import annotations

import time
from collections.abc import Awaitable, Callable, Mapping

from dialects.errors import Diagnostic
from macros.model import Macro, fill, names_in

Run = Callable[[str], Awaitable[None]]
Sleep = Callable[[float], Awaitable[None]]


def lines(macro: Macro, values: Mapping[str, str]) -> list[str]:
    """The macro's lines with their values filled in.

    Raises Diagnostic where a value is missing, or one is given that no line takes.
    """
    taken = set[str]().union(*(names_in(step.line) for step in macro.steps))
    for name in values:
        if name not in taken:
            hint = f"it takes {', '.join(sorted(taken))}" if taken else "it takes no values"
            raise Diagnostic(f"no line takes the value {name}", f"macro {macro.name}", hint)
    return [fill(step.line, values, f"macro {macro.name}, step {number}") for number, step in enumerate(macro.steps, 1)]


async def play(
    macro: Macro,
    run: Run,
    sleep: Sleep,
    values: Mapping[str, str],
    clock: Callable[[], float] = time.monotonic,
) -> None:
    """Run every line in turn; the first failure ends it and is raised.

    Each step starts `after` seconds after the start of the one before (the first: after the call), or at once
    where that one took longer. Raises Diagnostic before anything is run where the values do not fit. `clock`
    (s) is the one that `sleep` goes by.
    """
    filled = lines(macro, values)
    started = clock()
    for step, line in zip(macro.steps, filled, strict=True):
        wait = started + step.after - clock()
        if wait > 0:
            await sleep(wait)
        started = clock()
        await run(line)
