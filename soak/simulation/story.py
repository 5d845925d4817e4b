"""The story of a seed: what the person does, and what happens to the machine, one act a step.

Each step draws from a random source of its own. So a step does the same whether the steps before it are told or left
out, which is what shrinking rests on.
"""

from __future__ import annotations

import asyncio
import contextlib
from random import Random

from soak.simulation.acts.act import Act
from soak.simulation.acts.automation import AUTOMATION
from soak.simulation.acts.connections import CONNECTIONS
from soak.simulation.acts.crews import AFTER_CREWS as LAST_CREWS
from soak.simulation.acts.crews import CREWS
from soak.simulation.acts.failing import FAILING
from soak.simulation.acts.files import FILES
from soak.simulation.acts.hand import HAND
from soak.simulation.acts.machine import MACHINE
from soak.simulation.acts.meetings import HELD_UP, MEETINGS
from soak.simulation.acts.operators import OPERATORS
from soak.simulation.acts.prompt import PROMPT
from soak.simulation.acts.quitting import QUITTING
from soak.simulation.acts.strangers import STRANGER
from soak.simulation.acts.workshop_desk import DESK
from soak.simulation.acts.workshop_ends import ENDS, PORT
from soak.simulation.system.process import Killed
from soak.simulation.watching.bounds import sample
from soak.simulation.world import World

ACTS = (*PROMPT, *MACHINE, *CONNECTIONS, *AUTOMATION, *FILES, *HAND)
"""Those of any step, each as often as it weighs."""
AFTER_CREWS = (*LAST_CREWS, FAILING, FAILING)
"""The last of all, each once in its place."""
MEETING = 0.3
"""How many seeds have the acts of `MEETINGS`, and how many of their steps: the other stories are without them."""
AT_WORK = 0.2, 0.1
"""How many seeds have the acts of `OPERATORS`, and how many of their steps."""
STARVED = 0.2, 0.1
"""How many seeds have the acts of `HELD_UP`, and how many of their steps."""
AT_ONCE = 0.25
"""How many seeds end with the acts of `CREWS`."""
CREW, LAST = 200, 5
"""The number of the first step with one, and how many there are."""
AFTER = CREW + LAST
"""The number of the first step of the acts that end it."""
AT_LAST = (*AFTER_CREWS, *QUITTING, STRANGER)
"""Those acts, each once."""
WORKSHOP = (*DESK, PORT, *ENDS)
FIRST_JOB, JOBS = 300, 2
"""The number of the first step with a job of a workshop, and how many there are: each story ends with them."""


def whole(seed: int, steps: int) -> tuple[int, ...]:
    """The steps of a whole story: so many, those of the crews in some seeds, and those of a workshop."""
    crews = range(CREW, AFTER + len(AT_LAST)) if Random(f"{seed} crews").random() < AT_ONCE else ()
    return (*range(steps), *crews, *range(FIRST_JOB, FIRST_JOB + JOBS))


def _job(seed: int, step: int) -> Act:
    """The job of a step: twenty seeds have each as often as it weighs, twice."""
    jobs = [each for each in WORKSHOP for _ in range(int(each.weight))]
    return jobs[(seed * JOBS + step - FIRST_JOB) % len(jobs)]


def every_act() -> set[str]:
    """The names of all acts."""
    return {act.name for acts in (ACTS, OPERATORS, HELD_UP, MEETINGS, CREWS, AT_LAST, WORKSHOP) for act in acts}


def drawn(seed: int, step: int, rng: Random) -> Act:
    """Draw the act of a step. It is told where the machine has what it needs."""
    if step >= FIRST_JOB:
        return _job(seed, step)
    if step >= AFTER:
        return AT_LAST[step - AFTER]
    if step >= CREW:
        return rng.choices(CREWS, [each.weight for each in CREWS])[0]
    act = rng.choices(ACTS, [each.weight for each in ACTS])[0]
    seeds, steps = AT_WORK
    apart = Random(f"{seed} work {step}")
    if Random(f"{seed} work").random() < seeds and apart.random() < steps:
        return apart.choices(OPERATORS, [each.weight for each in OPERATORS])[0]
    seeds, steps = STARVED
    apart = Random(f"{seed} held up {step}")
    if Random(f"{seed} held up").random() < seeds and apart.random() < steps:
        return apart.choices(HELD_UP, [each.weight for each in HELD_UP])[0]
    apart = Random(f"{seed} meeting {step}")
    if Random(f"{seed} meetings").random() < MEETING and apart.random() < MEETING:
        return apart.choices(MEETINGS, [each.weight for each in MEETINGS])[0]
    return act


async def tell(world: World, step: int) -> None:
    """Let one thing happen, once a session is there, and time pass."""
    rng = Random(f"{world.seed} step {step}")
    act = drawn(world.seed, step, rng)
    if not act.where(world):
        return
    await world.ready.wait()
    world.step, world.said = step, 0
    pause = rng.random() ** 2 * rng.choice((0.05, 0.6, 1.0, 2.0))
    if not act.fault or not world.climate.calm:
        world.history.count(act.name)
        world.history.note(world.loop.now, "step", f"{step}: {act.name}")
        pause = max(pause, act.do(world, rng) or 0.0)
    await asyncio.sleep(pause)
    with contextlib.suppress(Killed):  # of a stop that cut in here: it ends the program, and not its story
        sample(world)
