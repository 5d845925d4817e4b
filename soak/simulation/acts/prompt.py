"""What a person types at the prompt: commands, the stop key, pastes, verbs; and a terminal or a loop that is away."""

from __future__ import annotations

from random import Random

from soak.simulation.acts.act import Act
from soak.simulation.records.phrases import STOP
from soak.simulation.system.cut_ins import drawn_aim
from soak.simulation.world import World


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


PROMPT = (
    Act("a line", 55, one_line),
    Act("several lines", 20, several_lines),
    Act("stop", 4, stop),
    Act("stop cuts in", 5, stop_cuts_in),
    Act("paste", 4, paste),
    Act("terminal unread", 1, unread, fault=True),
    Act("terminal hangs up", 1, hang_up, fault=True),
    Act("starve", 1, starve, fault=True),
    Act("verb", 7, verb),
)
