"""The work of the verbs on what is in drives: settings, registers, plots, snapshots, twins."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence

from multidrop.base.errors import Diagnostic, Inexpressible
from multidrop.base.on_demand import imported
from multidrop.dialects import Procedure
from multidrop.dialects.families import FAMILIES, dialects
from multidrop.dialects.family import Registers
from multidrop.drives.drive import Drive
from multidrop.shell import motions, plot_targets
from multidrop.shell.events import By
from multidrop.shell.operations.conditions import simulated_cell
from multidrop.shell.params import work
from multidrop.shell.params.work import Options
from multidrop.shell.plots.series import parse_series, read_first
from multidrop.shell.session import TRAVEL
from multidrop.shell.verbs.call import Call

FLAGS = ("--dry-run", "--save", "--communication", "--other-product", "--defaults")
VALUES = {"--with": "a value", "--against": "a value"}


def _parsed(call: Call) -> tuple[str, list[str], dict[str, str], list[str]]:
    """The action, the flags, the options with values, and the other words. Raises Diagnostic."""
    if "".join(call.split()[:1]) not in ("read", "save", "backup", "diff", "restore"):
        raise call.wrong()
    (what, *words), options = call.sort(FLAGS, VALUES, listed=True)
    values = {name: value for name, value in options if value}
    if what in ("backup", "restore") and not 1 <= len(words) <= 2:
        raise call.wrong()
    return what, [name for name, value in options if not value], values, words


def params_recorded(call: Call) -> str:
    """The line, with the address of the drive that is selected now."""
    what, flags, values, words = _parsed(call)
    aside = what in ("read", "save") or what == "diff" and ("--defaults" in flags or "--against" in values)
    names, targets = words[: not aside], words[not aside :]
    target = targets[0] if targets else call.session.qualified_address(call.drive())
    given = [word for pair in values.items() for word in pair]
    return " ".join(("/params", what, *map(shlex.quote, (*names, *filter(None, [target]), *flags, *given))))


async def params(call: Call) -> None:
    what, flags, values, words = _parsed(call)
    if what in ("read", "save"):
        if len(words) > 1 or flags or values:
            raise call.wrong()
        await (work.read if what == "read" else work.save)(call.session, "".join(words))
    elif what == "backup":
        work.check_new(call.output_file(words[0]), "".join(words[1:]))
        await work.backup(call.session, words[0], "".join(words[1:]))
    elif what == "restore":
        options = Options(
            named=frozenset(name.strip().upper() for name in values.get("--with", "").split(",") if name.strip()),
            communication="--communication" in flags,
            save="--save" in flags,
            dry_run="--dry-run" in flags,
            other_product="--other-product" in flags,
        )
        await work.restore_each(call.session, words[0], "".join(words[1:]), options)
    else:
        aside = ("--defaults" in flags) + ("--against" in values)
        if len(words) > 2 - aside or not aside and not words or aside == 2:
            raise call.wrong()
        name, target = ("", words) if aside else (words[0], words[1:])
        other = call.drive(values["--against"]) if "--against" in values else None
        await work.diff(call.session, "".join(target), name=name, other=other)


async def plot(call: Call) -> None:
    workspace = call.session
    match call.split():
        case []:
            for each in workspace.plots:
                workspace.output(f"plotting to {each.where}, {each.rate}")
            if workspace.plotted:
                workspace.output(f"plotting on the screen: {' '.join(each.text for each in workspace.plotted)}")
            elif not workspace.plots:
                workspace.output("plotting: nothing")
        case ["off"]:
            if not workspace.plots and not workspace.plotted:
                raise Diagnostic("no plot is running", "/plot")
            if workspace.plotted:
                workspace.plotted = ()
                workspace.changed()
            for each in list(workspace.plots):
                workspace.notify(await each.end())
        case words:
            options, texts = _plotted(call, words)
            if options:
                await plot_targets.needed().begin(call, options, texts)
            else:
                await _plot_on_screen(call, texts)


async def _plot_on_screen(call: Call, texts: list[str]) -> None:
    """Show a plot on the screen; other plots go on."""
    workspace = call.session
    screen = workspace.front.screen
    if screen is None:
        targets = plot_targets.offered()
        raise Diagnostic("no screen to plot on", "/plot", f"valid here: {targets.valid}" if targets is not None else "")
    series = parse_series(workspace, texts)
    await read_first(workspace, series)
    workspace.plotted = series
    workspace.changed()
    if call.by is By.OPERATOR:  # a page that a macro or a script opens would take the keys of a person who types
        await screen("plot")


def _plotted(call: Call, words: list[str]) -> tuple[dict[str, str], list[str]]:
    """The options, and what to plot; a bare word that can only be a target has the first option."""
    options: dict[str, str] = {}
    addresses: list[str] = []
    targets = plot_targets.offered()
    known, endings = plot_targets.options(), targets.endings if targets is not None else ()
    left = iter(words)
    for word in left:
        option = word
        if word in (*known, "--drive"):
            value = next(left, "")
        elif word.endswith(endings) or "://" in word:
            option, value = known[0], word
        else:
            option, value = "--drive", word
        if not value or option in options:
            raise call.wrong(f"{option} is given twice" if value else f"{option} needs a value")
        if option == "--drive":
            addresses.append(value)
        else:
            options[option] = value
    return options, addresses


def _registered(call: Call) -> tuple[Drive, Registers]:
    """The selected drive and its registers. Raises Inexpressible if its family has none."""
    drive = call.drive()
    if (registers := drive.family.registers) is None:
        having = {name: dialects()[name].scheme for name, family in FAMILIES.items() if family.offers("registers")}
        opened = " or ".join(f"{scheme}://HOST" if scheme else f"dialect={name}" for name, scheme in having.items())
        where = call.session.display_name(drive)
        raise Inexpressible(f"{where}: no registers; {call.verb.name} is valid on a bus opened with {opened}")
    return drive, registers


async def _show(call: Call, drive: Drive, talk: Procedure[tuple[str, ...]]) -> None:
    for line in await drive.run(talk, typed=True):
        call.session.output(line)


async def _write(
    call: Call, drive: Drive, talk: Procedure[tuple[str, ...]], writes: str, lines: Sequence[str] = ()
) -> None:
    """Run a conversation that writes. `writes`: the line that does the same as far as it starts something; empty: it
    may do anything. `lines` do the same, as far as words have its registers.
    """
    session = call.session
    await session.path.agreed_to_write(drive, f"{call.verb.name} {call.rest.strip()}", call.by)
    async with session.path.starting(drive, writes):
        printed = await motions.perform(session, drive, lines, talk)
    for line in printed:
        session.output(line)


def _number(call: Call, text: str) -> int:
    if not re.fullmatch(r"[+-]?(0[xX][0-9A-Fa-f]{1,16}|\d{1,20})", text, re.ASCII):
        raise call.wrong(f"no number {text}; valid: as 87 or 0x57")
    return int(text, 16 if "x" in text.lower() else 10)


async def register(call: Call) -> None:
    drive, registers = _registered(call)
    found = re.fullmatch(r"(\S+?)(?:\s*=\s*(.+)|\s+(\S+))?", call.rest.strip())
    if found is None:
        raise call.wrong()
    address = _number(call, found[1])
    if not 0 <= address <= 0xFFFF:
        raise call.wrong(f"no register {found[1]}; valid: 0 to 0xFFFF")
    if found[2] is None:
        count = _number(call, found[3]) if found[3] else None
        await _show(call, drive, registers.read(address, count))
        return
    values = [_number(call, text.strip()) for text in found[2].split(",")]
    lines = registers.lines(address, values)
    for line in lines:
        if call.session.scaled:
            await imported(TRAVEL)(call.session.units, drive, line, call.by)
        await call.session.path.guard(drive, line, call.by)
    known = len(lines) == len(values) and len([line for line in lines if drive.starts(line)]) < 2
    writes = next(filter(drive.starts, lines), lines[0]) if known else ""
    await _write(call, drive, registers.write(address, values), writes, lines)


async def coil(call: Call) -> None:
    drive, registers = _registered(call)
    words = call.words()
    number = _number(call, words[0])
    if not 1 <= number <= 0x10000:
        raise call.wrong(f"no output {words[0]}; valid: from 1")
    if len(words) == 1:
        await _show(call, drive, registers.read_coil(number))
    elif words[1] in ("0", "1"):
        line = f"O{number}={words[1]}"
        writes = "" if drive.starts(line) else line
        await _write(call, drive, registers.write_coil(number, words[1] == "1"), writes)
    else:
        raise call.wrong()


async def device(call: Call) -> None:
    drive, registers = _registered(call)
    call.words()
    await _show(call, drive, registers.device())


async def snapshot(call: Call) -> None:
    from multidrop.shell import snapshots  # and with it the simulator, which no other verb needs

    (file,) = call.words()
    await snapshots.save(call.session, call.output_file(file), call.session.units.scales)


async def sim(call: Call) -> None:
    cell = simulated_cell(call.session)
    if cell is None:
        raise Diagnostic("no simulated bus is selected", "/sim", "/open sim: opens the demo cell")
    cell.command(f"/sim {call.rest}")
