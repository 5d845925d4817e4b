"""What the verbs on programs do in a session: check a file, list a program, trace and step one."""

from __future__ import annotations

import asyncio
import shlex
from collections.abc import Sequence
from math import inf

from multidrop.base import new_file
from multidrop.base.errors import Diagnostic, Inexpressible
from multidrop.base.text import counted
from multidrop.dialects.families import program_language_of
from multidrop.dialects.program_files import errors
from multidrop.drives.drive import Drive
from multidrop.shell import program_listing
from multidrop.shell.line_syntax import split_target
from multidrop.shell.programs import debugging
from multidrop.shell.programs.checking import examine
from multidrop.shell.programs.debugging import LEFT, Debugger
from multidrop.shell.session import Call
from multidrop.simulator.declared import simulated
from multidrop.simulator.families import PROGRAMS


async def check(call: Call, file: str, personality: str) -> None:
    """Check a program file for the selected drive, or for another product. Raises Inexpressible for its errors."""
    wanted, language = personality.upper(), program_language_of(file)
    valid = simulated()[language].personalities
    if wanted and wanted not in valid:
        raise Diagnostic(f"no personality {wanted}", call.verb.name, f"valid for {file}: {', '.join(valid)}")
    selected = call.session.selected
    own = selected.product if selected else ""
    product = wanted or (own if own in valid else PROGRAMS[language].drive.personality)
    call.warn_of_editor(file)
    reported = {own: (selected.version, selected.state.part)} if selected else {}
    checked = await asyncio.to_thread(examine, file, product, reported=reported)
    for problem in checked.problems:
        call.session.notify(problem.line_for(file), warning=True)
    if not checked.right:
        count = len(errors(checked.problems))
        raise Inexpressible(f"{file}: {counted(count, 'error')} for {product}")
    call.output(f"{file}: {checked.facts}")


# The listing


def listed(call: Call, words: Sequence[str]) -> tuple[Drive, str]:
    """The drive, and the file: the word with a dot or a slash."""
    files = [word for word in words if "." in word or "/" in word]
    targets = [word for word in words if word and word not in files]
    if len(files) > 1 or len(targets) > 1:
        raise call.wrong()
    return call.drive("".join(targets)), "".join(files)


def listed_line(call: Call, words: Sequence[str]) -> str:
    """The line of a listing, as a macro records it."""
    drive, file = listed(call, words)
    target = call.session.qualified_address(drive)
    return " ".join(filter(None, ("/list", target, shlex.quote(file) if file else "")))


async def list_program(call: Call, words: Sequence[str]) -> None:
    """Print the program of a drive, or write it into a new file."""
    drive, file = listed(call, words)
    if file:
        new_file.check(call.output_file(file), printed=True)
    lines = await program_listing.readable(call.session, drive)
    if not lines:
        program_listing.say_none(call.session, drive)
    if file and lines:
        return program_listing.save_new(call.session, drive, file, lines)
    for line in lines:
        call.output(line)


# The debugger


def at_drive(call: Call, words: Sequence[str]) -> tuple[str, Sequence[str]]:
    """The target, and the other words. A drive's name goes before a label's."""
    words = [word for word in words if word]
    bus, address = split_target(words[0] if words else "")
    known = call.bus(bus).drives if words and ":" not in words[0] else {}
    if words and (":" in words[0] or address in known or any(drive.label == address for drive in known.values())):
        return words[0], words[1:]
    return "", words


def debugger_line(call: Call, words: Sequence[str]) -> str:
    """The line of a debugger's verb, as a macro records it."""
    target, others = at_drive(call, words)
    return " ".join(filter(None, (call.verb.name, call.session.qualified_address(call.drive(target)), *others)))


def _parts(call: Call, words: Sequence[str], low: int, high: float) -> tuple[Debugger, Sequence[str]]:
    """The debugger of the drive that the line is for, and the other words."""
    target, others = at_drive(call, words)
    if not low <= len(others) <= high:
        raise call.wrong()
    return debugging.of(call.session, call.drive(target)), others


async def trace(call: Call, words: Sequence[str]) -> None:
    debugger, others = _parts(call, words, 0, 1)
    await debugger.trace(call.origin, "".join(others))


async def step(call: Call, words: Sequence[str]) -> None:
    debugger, others = _parts(call, words, 0, 1)
    if others:
        await debugger.begin(call.origin, others[0])
    else:
        await debugger.step(call.origin)


async def continue_(call: Call, words: Sequence[str]) -> None:
    debugger, _ = _parts(call, words, 0, 0)
    await debugger.go_on(call.origin)


async def break_(call: Call, words: Sequence[str]) -> None:
    debugger, others = _parts(call, words, 0, 2)
    match others:
        case []:
            debugger.say(
                LEFT.format(debugger.break_point) if debugger.break_point else "no break point of this session"
            )
        case ["off"]:
            await debugger.break_off()
        case ["now"]:
            await debugger.break_now(call.origin)
        case [place, *passes]:
            await debugger.break_at(place, debugging.passes_of(passes[0]) if passes else 1)


async def watch(call: Call, words: Sequence[str]) -> None:
    debugger, others = _parts(call, words, 1, inf)
    await debugger.watch(call.origin, [] if others == ["off"] else others)
