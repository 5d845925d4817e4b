"""Playing a macro: each line goes to a given `run`, at the interval at which it was typed."""

from __future__ import annotations

import time
from collections.abc import Awaitable, Callable, Mapping

from dialects.errors import Diagnostic
from macros.model import Macro, fill, value_names

Run = Callable[[str], Awaitable[None]]
Sleep = Callable[[float], Awaitable[None]]


def filled_lines(macro: Macro, values: Mapping[str, str]) -> list[str]:
    """Fill in the values of a macro's lines. Raises Diagnostic for a missing value and for one that no line takes."""
    taken = set[str]().union(*(value_names(step.line) for step in macro.steps))
    for name in values:
        if name not in taken:
            hint = f"valid: {', '.join(sorted(taken))}" if taken else "the macro takes no values"
            raise Diagnostic(f"no line takes the value {name}", f"macro {macro.name}", hint)
    return [fill(step.line, values, f"macro {macro.name}, step {number}") for number, step in enumerate(macro.steps, 1)]


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
    filled = filled_lines(macro, values)
    started = clock()
    for step, line in zip(macro.steps, filled, strict=True):
        wait = started + step.after - clock()
        if wait > 0:
            await sleep(wait)
        started = clock()
        await run(line)
