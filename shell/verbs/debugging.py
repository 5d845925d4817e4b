"""Verbs for the program in a drive while it runs: trace, single step, break point, watched variables."""

from __future__ import annotations

from multidrop.shell import debugging
from multidrop.shell.debugging import LEFT, Debugger
from multidrop.shell.lines import split_target
from multidrop.shell.verbs.registry import Call, verb


def _parts(call: Call, low: int = 0, high: int | None = None) -> tuple[Debugger, list[str]]:
    """The debugger of the drive that the line is for, and the other words. A drive's name goes before a label's."""
    words = call.words()
    target = words.pop(0) if words and _is_drive(call, words[0]) else ""
    if len(words) < low or (high is not None and len(words) > high):
        raise call.wrong()
    return debugging.of(call.workspace, call.drive(target)), words


def _recorded(call: Call) -> str:
    """The line with the drive's address."""
    words = call.words()
    target = words.pop(0) if words and _is_drive(call, words[0]) else ""
    address = call.workspace.qualified_address(call.drive(target))
    return " ".join(each for each in (call.verb.name, address, *words) if each)


def _is_drive(call: Call, word: str) -> bool:
    bus, address = split_target(word)
    if ":" in word:
        return True
    known = call.workspace.bus(bus).drives
    return address in known or any(drive.label == address for drive in known.values())


@verb("/trace [ADDR] [LABEL]", recorded=_recorded, concurrent=True)
async def trace(call: Call) -> None:
    """Run a program of a drive and show each line as it is executed.

    It begins at LABEL (or an address), by default at SU, else at address 1, and goes on to the end of the program or to
    its break point. For a PMX, LABEL is the number of a program; the lines are those at which the program was seen.
    """
    debugger, words = _parts(call, 0, 1)
    await debugger.trace(words[0] if words else "")


@verb("/step [ADDR] [LABEL]", recorded=_recorded)
async def step(call: Call) -> None:
    """Execute one line of a program that waits for it; with LABEL, begin there and wait.

    The host sends the key of single step only where it is known that the drive waits for it: not in party mode, and not
    with a checksum. The line may start a motion. A stop ends program and single step.
    """
    debugger, words = _parts(call, 0, 1)
    if words:
        await debugger.begin(words[0])
    else:
        await debugger.step()


@verb("/continue [ADDR]", recorded=_recorded)
async def continue_(call: Call) -> None:
    """Let a program that waits run on at normal speed."""
    debugger, _ = _parts(call, 0, 0)
    await debugger.go_on()


@verb(
    "/break [ADDR] [off|now] | /break [ADDR] LABEL [PASSES]",
    recorded=_recorded,
    words={"off": "remove the break point", "now": "break the running program where it is"},
)
async def break_(call: Call) -> None:
    """Set the break point of a drive at a label or an address; at its PASSES-th pass, /trace waits there.

    A drive has one break point. Without arguments, show it.
    """
    debugger, words = _parts(call, 0, 2)
    if not words:
        debugger.say(LEFT.format(debugger.break_point) if debugger.break_point else "no break point of this session")
    elif words == ["off"]:
        await debugger.break_off()
    elif words == ["now"]:
        await debugger.break_now()
    else:
        await debugger.break_at(words[0], debugging.passes_of(words[1]) if len(words) > 1 else 1)


@verb("/watch [ADDR] off | /watch [ADDR] NAME ...", recorded=_recorded, words={"off": "watch nothing"})
async def watch(call: Call) -> None:
    """Show variables now, and whenever a step, a break or the end of a program has changed them."""
    debugger, words = _parts(call, 1)
    await debugger.watch([] if words == ["off"] else words)
