"""The work of the verbs on programs: check, list, transfer, trace and step."""

from __future__ import annotations

import asyncio
import shlex
from math import inf

from multidrop.base import new_file
from multidrop.base.errors import Diagnostic, Inexpressible
from multidrop.base.text import counted
from multidrop.dialects.families import program_language_of
from multidrop.dialects.program_files import errors
from multidrop.drives.drive import Drive
from multidrop.shell import program_listing
from multidrop.shell.line_syntax import split_target
from multidrop.shell.programs import debugging, transfers
from multidrop.shell.programs.checking import examine
from multidrop.shell.programs.debugging import LEFT, Debugger
from multidrop.shell.verbs.call import Call
from multidrop.simulator.declared import simulated
from multidrop.simulator.families import PROGRAMS

FLAGS = ("--save", "--only-changed", "--no-verify")


def _listed(call: Call) -> tuple[Drive, str]:
    """The drive, and the file: the word with a dot or a slash."""
    words = call.words()
    files = [word for word in words if "." in word or "/" in word]
    targets = [word for word in words if word not in files]
    if len(files) > 1 or len(targets) > 1:
        raise call.wrong()
    return call.drive("".join(targets)), "".join(files)


def list_recorded(call: Call) -> str:
    drive, file = _listed(call)
    words = ("/list", call.session.qualified_address(drive), shlex.quote(file) if file else "")
    return " ".join(word for word in words if word)


async def list_(call: Call) -> None:
    drive, file = _listed(call)
    if file:
        new_file.check(call.output_file(file), printed=True)
    lines = await program_listing.readable(call.session, drive)
    if not lines:
        program_listing.say_none(call.session, drive)
    if file and lines:
        return program_listing.save_new(call.session, drive, file, lines)
    for line in lines:
        call.session.output(line)


def upload_recorded(call: Call) -> str:
    file, *target = call.words()
    return f"/upload {shlex.quote(file)} {call.session.qualified_address(call.drive(''.join(target)))}".rstrip()


async def upload(call: Call) -> None:
    name, *target = call.words()
    file, drive = call.output_file(name), call.drive("".join(target))
    new_file.check(file, printed=True)
    program_listing.save_new(call.session, drive, file, await program_listing.upload(call.session, drive))


def _downloaded(call: Call) -> tuple[str, str, dict[str, str]]:
    """The file, the address, and the options."""
    places, options = call.sort(FLAGS, {"--run": "a label"})
    if not 1 <= len(places) <= 2:
        raise call.wrong()
    return places[0], "".join(places[1:]), dict(options)


def download_recorded(call: Call) -> str:
    file, target, options = _downloaded(call)
    given = [f"{name} {options[name]}".rstrip() for name in (*FLAGS, "--run") if name in options]
    words = ("/download", shlex.quote(file), call.session.qualified_address(call.drive(target)), *given)
    return " ".join(word for word in words if word)


async def download(call: Call) -> None:
    file, target, options = _downloaded(call)
    wanted = transfers.Wanted(
        verify="--no-verify" not in options,
        save="--save" in options,
        only_changed="--only-changed" in options,
        run=options.get("--run", ""),
    )
    call.warn_of_editor(file)
    shown = call.shown if isinstance(call.shown, str) else None
    await transfers.download(call.session, call.drive(target), file, wanted, shown, by=call.by)


async def check(call: Call) -> None:
    file, *personality = call.words()
    wanted, language = "".join(personality).upper(), program_language_of(file)
    valid = simulated()[language].personalities
    if wanted and wanted not in valid:
        raise Diagnostic(f"no personality {wanted}", call.verb.name, f"valid for {file}: {', '.join(valid)}")
    selected = call.session.selected
    own = selected.product if selected else ""
    product = wanted or (own if own in valid else PROGRAMS[language].drive.personality)
    call.warn_of_editor(file)
    reported = {own: (selected.version, selected.state.part)} if selected else {}
    checked = await asyncio.to_thread(examine, file, product, reported=reported)
    for each in checked.problems:
        call.session.notify(each.line_for(file), warning=True)
    if not checked.right:
        count = len(errors(checked.problems))
        raise Inexpressible(f"{file}: {counted(count, 'error')} for {product}")
    call.session.output(f"{file}: {checked.facts}")


def _at_drive(call: Call) -> tuple[str, list[str]]:
    """The target, and the other words. A drive's name goes before a label's."""
    words = call.split()
    bus, address = split_target(words[0] if words else "")
    known = call.session.bus(bus).drives if words and ":" not in words[0] else {}
    if words and (":" in words[0] or address in known or any(drive.label == address for drive in known.values())):
        return words[0], words[1:]
    return "", words


def debugger_recorded(call: Call) -> str:
    target, words = _at_drive(call)
    return " ".join(filter(None, (call.verb.name, call.session.qualified_address(call.drive(target)), *words)))


def _parts(call: Call, low: int, high: float) -> tuple[Debugger, list[str]]:
    """The debugger of the drive that the line is for, and the other words."""
    target, words = _at_drive(call)
    if not low <= len(words) <= high:
        raise call.wrong()
    return debugging.of(call.session, call.drive(target)), words


async def trace(call: Call) -> None:
    debugger, words = _parts(call, 0, 1)
    await debugger.trace("".join(words))


async def step(call: Call) -> None:
    debugger, words = _parts(call, 0, 1)
    if words:
        await debugger.begin(words[0])
    else:
        await debugger.step()


async def continue_(call: Call) -> None:
    debugger, _ = _parts(call, 0, 0)
    await debugger.go_on()


async def break_(call: Call) -> None:
    debugger, words = _parts(call, 0, 2)
    if not words:
        debugger.say(LEFT.format(debugger.break_point) if debugger.break_point else "no break point of this session")
    elif words == ["off"]:
        await debugger.break_off()
    elif words == ["now"]:
        await debugger.break_now()
    else:
        await debugger.break_at(words[0], debugging.passes_of(words[1]) if len(words) > 1 else 1)


async def watch(call: Call) -> None:
    debugger, words = _parts(call, 1, inf)
    await debugger.watch([] if words == ["off"] else words)
