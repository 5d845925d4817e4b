"""The story of a seed: what the person does, and what happens to the machine, one act a step.

Each step draws from a random source of its own. So a step does the same whether the steps before it are told or left
out, which is what shrinking rests on.
"""

from __future__ import annotations

import asyncio
import contextlib
from random import Random
from typing import TYPE_CHECKING

from multidrop.base.errors import Diagnostic
from soak.simulation import acts_connections
from soak.simulation.act import Act
from soak.simulation.acts.automation import AUTOMATION
from soak.simulation.acts.crews import AFTER_CREWS as LAST_CREWS
from soak.simulation.acts.crews import CREWS
from soak.simulation.acts.failing import FAILING
from soak.simulation.acts.files import FILES
from soak.simulation.acts.hand import HAND
from soak.simulation.acts.meetings import HELD_UP, MEETINGS
from soak.simulation.acts.operators import OPERATORS
from soak.simulation.acts.quitting import QUITTING
from soak.simulation.acts.strangers import STRANGER
from soak.simulation.acts.workshop_desk import DESK
from soak.simulation.acts.workshop_ends import ENDS, PORT
from soak.simulation.acts_kill import files, kill, power_cut
from soak.simulation.bounds import sample
from soak.simulation.cut_ins import drawn_aim
from soak.simulation.process import Killed

if TYPE_CHECKING:
    from soak.simulation.world import World

STOP = b"\x18"


def one_line(world: World, rng: Random) -> None:
    """Type a command."""
    world.person.type(world.command(rng), rng.choice((0.0, 0.0, 0.01)))


def several_lines(world: World, rng: Random) -> None:
    """Type several commands at once."""
    world.person.type(b"".join(world.command(rng) for _ in range(rng.randrange(2, 5))), rng.choice((0.0, 0.02)))


def stop(world: World, rng: Random) -> None:
    """Type the stop key, before and after commands."""
    before = b"".join(world.command(rng) for _ in range(rng.randrange(0, 3)))
    before += world.command(rng)[: -rng.randrange(1, 4)] * (rng.random() < 0.2)  # Enter was not typed
    world.stops += 1
    after = world.command(rng) if rng.random() < 0.5 else b""
    world.person.type(before + STOP + after, rng.choice((0.0, 0.01)))
    world.person.type(b"/resume\r", 0.0)


def paste(world: World, rng: Random) -> None:
    """Paste several lines in brackets; the stop may come before their Enter, or right behind it."""
    lines = b"".join(world.command(rng) for _ in range(rng.randrange(1, 5))).decode().replace("\r", rng.choice("\r\n"))
    stops = rng.random() < 0.2
    world.stops += stops
    world.person.paste(lines, enter=rng.random() < 0.8 or not stops)
    if stops:
        world.person.type(STOP + b"/resume\r")


def unread(world: World, rng: Random) -> None:
    """Let nobody read the terminal for a while, or read a byte a second, and write much to it."""
    world.terminal.reader(rng.random() ** 2 * 30, slow=rng.random() < 0.4)
    world.person.type(b"/help\r/status\r" + b"".join(world.command(rng) for _ in range(rng.randrange(3))))


def hang_up(world: World, rng: Random) -> None:
    """Type some lines, and hang up the terminal in the middle of them."""
    world.person.type(b"".join(world.command(rng) for _ in range(rng.randrange(3))), rng.choice((0.0, 0.02)))
    process = world.process

    def gone() -> None:
        if world.process is process:
            world.hang_up()

    world.loop.call_later(rng.random() ** 2 * 0.5, gone)


def stop_cuts_in(world: World, rng: Random) -> None:
    """Type commands, and a stop that comes in the middle of the loop's work."""
    world.person.type(b"".join(world.command(rng) for _ in range(rng.randrange(1, 4))), rng.choice((0.0, 0.01)))
    world.stops += 1
    world.person.type_stop(drawn_aim(rng, bool(world.kernel.usb.plugged)))
    world.person.type(world.command(rng) * (rng.random() < 0.5) + b"/resume\r", 0.0)


def starve(world: World, rng: Random) -> None:
    """Let the loop do nothing for a while, in which a stop may come."""
    if rng.random() < 0.7:
        before = b"".join(world.command(rng) for _ in range(rng.randrange(0, 3)))
        world.stops += 1
        world.person.type(before + STOP, rng.choice((0.0, 0.3)))
        world.person.type(b"/resume\r", 0.0)
    world.loop.starve(rng.random() ** 2 * 10)


def verb(world: World, rng: Random) -> None:
    """Type a verb that reads or waits."""
    world.person.type(rng.choice((b"/status\r", b"/wait stopped 3\r", b"/resume\r", b"\r", b"/sleep 0.2\r")), 0.0)


def unplug(world: World, rng: Random) -> None:
    """Pull the cable of a line, for a while."""
    name = rng.choice(world.places).name
    world.floor.command(f"/sim unplug {name}")
    world.loop.call_later(rng.random() * 5, world.floor.command, f"/sim plug {name}")


def power_off(world: World, rng: Random) -> None:
    """Take the power of a drive away, for a while."""
    place = rng.choice(world.places)
    drive = f"{place.name}:{rng.choice(place.names)}"
    with contextlib.suppress(Diagnostic):
        world.floor.command(f"/sim power {drive} off")
        world.loop.call_later(rng.random() * 5, world.floor.command, f"/sim power {drive} on")


def clock_jumps(world: World, rng: Random) -> None:
    """Let the clock of day jump."""
    world.wall.jump(rng.uniform(-4000, 4000))


ACTS = (
    Act("a line", 55, one_line),
    Act("several lines", 20, several_lines),
    Act("stop", 4, stop),
    Act("stop cuts in", 5, stop_cuts_in),
    Act("paste", 4, paste),
    Act("terminal unread", 1, unread, fault=True),
    Act("terminal hangs up", 1, hang_up, fault=True),
    Act("starve", 1, starve, fault=True),
    Act("verb", 7, verb),
    Act("power off", 4, power_off),
    Act("files", 4, files),
    Act("kill", 2, kill),
    Act("PC power cut", 1, power_cut),
    Act("unplug", 4, unplug, fault=True),
    Act("clock jumps", 2, clock_jumps, fault=True),
    *(Act(*each) for each in acts_connections.ACTS),
    *AUTOMATION,
    *FILES,
    *HAND,
)


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


def _drawn(world: World, step: int, rng: Random) -> Act:
    """Draw the act of a step."""
    if step >= FIRST_JOB:
        return _job(world.seed, step)
    if step >= AFTER:
        return AT_LAST[step - AFTER]
    if step >= CREW:
        return rng.choices(CREWS, [each.weight for each in CREWS])[0]
    act = rng.choices(ACTS, [each.weight for each in ACTS])[0]
    seeds, steps = AT_WORK
    apart = Random(f"{world.seed} work {step}")
    if Random(f"{world.seed} work").random() < seeds and apart.random() < steps:
        return apart.choices(OPERATORS, [each.weight for each in OPERATORS])[0]
    seeds, steps = STARVED
    apart = Random(f"{world.seed} held up {step}")
    if Random(f"{world.seed} held up").random() < seeds and apart.random() < steps:
        return apart.choices(HELD_UP, [each.weight for each in HELD_UP])[0]
    apart = Random(f"{world.seed} meeting {step}")
    if Random(f"{world.seed} meetings").random() < MEETING and apart.random() < MEETING:
        return apart.choices(MEETINGS, [each.weight for each in MEETINGS])[0]
    return act


async def tell(world: World, step: int) -> None:
    """Let one thing happen, once a session is there, and time pass."""
    rng = Random(f"{world.seed} step {step}")
    act = _drawn(world, step, rng)
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
