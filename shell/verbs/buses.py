"""The work of the verbs on ports and buses: open, close, select, list, name, raw bytes."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import TYPE_CHECKING

from multidrop.base.errors import Diagnostic, Inexpressible, NoAnswer
from multidrop.base.text import whole
from multidrop.dialects.units import Takes
from multidrop.shell import configuration
from multidrop.shell.events import By
from multidrop.shell.finding import scanning
from multidrop.shell.line_syntax import split_target
from multidrop.shell.openings import model
from multidrop.shell.raw import TERMINATORS, Form, RawLine, Watched, parse_bytes
from multidrop.shell.verbs.call import Call

if TYPE_CHECKING:
    pass

BREAK = 250
"""The length of a break, ms."""
LONGEST_BREAK = 2000
"""The same, at most: a break holds back a stop, which is then repeated."""
HIGHEST_BAUD = 10_000_000
SWITCH = {"on": True, "off": False}
FORMS = {form.value[0]: form for form in Form}


async def open_(call: Call) -> None:
    url, *name = call.words()
    for bus in await call.session.open(url, name[0] if name else None):
        if bus.silent and call.by is not By.OPERATOR:
            await call.session.forget(bus)
            raise NoAnswer(bus.silent)


async def close(call: Call) -> None:
    (name,) = call.words()
    bus, session = call.session.bus(name), call.session
    selected = session.selected_bus == bus.name
    if selected:  # what follows was written for this bus, and never goes to another one
        session.selected_bus, session.deselected = "", True
    try:
        await session.forget(bus)
    finally:
        if selected and session.front.before_quit is not None and session.buses:  # a person sees which one is next
            session.select("", next(iter(session.buses)))
        session.changed()
    session.notify(f"{name} is closed")


async def use(call: Call) -> None:
    workspace = call.session
    (target,) = call.words()
    bus, address = split_target(target)
    if not bus and target in workspace.buses:
        selected = workspace.buses.get(workspace.selected_bus)
        if not selected or all(target not in (drive.address, drive.label) for drive in selected.drives.values()):
            bus, address = target, ""
    workspace.select(address, bus)
    drive = workspace.selected
    empty = f"{workspace.selected_bus}, where no drive has replied"
    workspace.notify(f"lines go to {workspace.display_name(drive) if drive else empty}")


async def drives(call: Call) -> None:
    workspace = call.session
    call.words()
    if not workspace.buses:
        raise Diagnostic("nothing is open", "/drives", "/open URL opens a line of drives")
    for bus in workspace.buses.values():
        if not bus.drives:
            workspace.output(f"  {bus.name}: no drive has replied")
        for drive in bus.drives.values():
            mark = "*" if drive is workspace.selected else " "
            mode = " (in program mode)" if drive.programming else ""
            mode += " (position not referenced)" if drive.state.unreferenced else ""
            mode += " (not identified)" if drive.state.stranger else ""
            words = (mark, workspace.display_name(drive), drive.label, model(drive))
            workspace.output(" ".join(word for word in words if word) + mode)


async def scan(call: Call) -> None:
    workspace = call.session
    bus = workspace.bus(call.word())
    if call.by is By.OPERATOR and workspace.openings.searches(bus):
        return await workspace.openings.search(bus)
    found = await scanning.extend(workspace, bus)
    if found and workspace.of(bus).selected is None:
        workspace.identified(bus)
    for address in found:
        workspace.output(f"{bus.name}: {address} {model(bus.drives[address])}")
    if not found:
        workspace.notify(f"{bus.name}: no other drive replies", outcome=True)


async def referenced(call: Call) -> None:
    drive = call.drive(call.word())
    name = call.session.display_name(drive) or drive.shown
    if drive not in call.session.bus(drive.link.name).drives.values():
        raise Diagnostic(f"no drive {name}", hint="/drives lists them")
    lost = bool(drive.state.unreferenced)
    drive.state.referenced()
    call.session.notify(f"{name}: its position {'counts again' if lost else 'was not marked as not referenced'}")
    call.session.changed()


async def status(call: Call) -> None:
    drive = call.drive(call.word())
    if not drive.family.offers("status"):
        raise Inexpressible(f"{call.session.display_name(drive)}: drives of this family do not report their state")
    for line in await drive.run(drive.family.status()):
        call.session.output(line)
    units = call.session.units if call.session.scaled else None
    if units is None or not units.shown or not units.axes(drive) or drive.programming:
        return
    await units.look(drive)
    for each in await drive.motion():
        place = units.words(drive, each.axis, each.position, Takes.PLACE)
        speed = units.words(drive, each.axis, each.velocity, Takes.VELOCITY)
        if place:
            lost = "" if units.referenced(drive, each.axis) else ", not referenced"
            shown = ", ".join(filter(None, (part.strip(" ()") for part in (place, speed))))
            call.session.output(f"{each.axis} in units: {shown}{lost}".lstrip())


async def rename(call: Call) -> None:
    name, *bus = call.words()
    call.session.rename_bus(call.session.bus("".join(bus)), name)


async def tab(call: Call) -> None:
    where, *bus = call.words()
    if where not in ("left", "right"):
        raise call.wrong()
    call.session.move_bus(call.session.bus("".join(bus)), 1 if where == "right" else -1)


async def keep(call: Call) -> None:
    name, *bus = call.words()
    url = call.session.openings.url_of(call.session.bus("".join(bus)))
    path = configuration.save(name, url)
    call.session.notify(f"{path}: connection {name} is saved: {url}", outcome=True)


def _raw(call: Call) -> RawLine:
    """The selected bus in raw mode. Raises Diagnostic for any other."""
    bus = call.session.bus()
    found = call.session.raw.get(bus.name)
    if found is None:
        raise Diagnostic(f"{bus.name} is not in raw mode", call.verb.name, "/raw on begins it")
    return found


async def raw(call: Call) -> None:
    match call.words() or ["on"]:
        case [("on" | "off") as word]:
            bus = call.session.bus()
            if (word == "on") == (bus.name in call.session.raw):
                state = "already" if word == "on" else "not"
                raise Diagnostic(f"{bus.name} is {state} in raw mode", call.verb.name)
            openings = call.session.openings
            await (openings.raw_on(bus) if word == "on" else openings.raw_off(bus))
        case ["open", url]:
            before = {*call.session.buses}
            await call.session.open(url, raw=True)
            call.session.select("", next(name for name in call.session.buses if name not in before))
        case ["baud", number]:
            line, baud = _raw(call), whole(number, 1, HIGHEST_BAUD)
            if baud is None:
                raise call.wrong(f"no baud rate {number}")
            await _set(line, f"the baud rate {baud}", lambda: line.control().set_baud(baud))
            line.bus.set_baud(baud)
            call.session.notify(f"{line.bus.name}: {baud} baud")
        case [("dtr" | "rts") as pin, word]:
            line = _raw(call)
            if word not in SWITCH:
                raise call.wrong()
            control = line.control()
            await _set(line, pin.upper(), lambda: (control.set_dtr if pin == "dtr" else control.set_rts)(SWITCH[word]))
            call.session.notify(f"{line.bus.name}: {pin.upper()} {word}")
        case ["break", *length]:
            await _send_break(call, length[0] if length else str(BREAK))
        case ["end", word]:
            line = _raw(call)
            if word not in TERMINATORS:
                raise call.wrong()
            line.end = TERMINATORS[word]
            call.session.notify(f"{line.bus.name}: {word} follows a typed text")
        case ["show", word]:
            line = _raw(call)
            if word not in FORMS:
                raise call.wrong()
            line.form = FORMS[word]
            call.session.notify(f"{line.bus.name}: bytes are shown as {word}")
        case _:
            raise call.wrong()


async def _send_break(call: Call, text: str) -> None:
    line = _raw(call)
    length = whole(text, 1, LONGEST_BREAK)
    if length is None:
        raise call.wrong(f"a break takes 1 to {LONGEST_BREAK} ms")
    control = line.control()
    try:
        await _set(line, "break", lambda: control.set_break(True))
        await asyncio.sleep(length / 1000)
    finally:  # also when a stop ends the wait: a break holds back what is written
        await _set(line, "break", lambda: control.set_break(False))
    call.session.notify(f"{line.bus.name}: a break of {length} ms was sent")


async def _set(line: RawLine, what: str, change: Callable[[], None]) -> None:
    """Change a setting of the port, in a thread: a server may have to confirm it. Raises Diagnostic."""
    try:
        await asyncio.to_thread(change)
    except OSError as error:
        why = error.strerror or str(error)
        raise Diagnostic(f"the port does not take {what} ({why})", line.bus.name, "nothing was changed") from None


async def hex_(call: Call) -> None:
    words, workspace = call.words(), call.session
    bus = workspace.bus()
    if bus.name in workspace.raw:
        raise Diagnostic(f"{bus.name} is raw: its bytes are shown", call.verb.name, "/raw show text|hex|both")
    record = workspace.of(bus)
    shown = record.bytes_shown
    word = words[0] if words else "off" if shown else "on"
    form = FORMS.get("both" if word == "on" else word)
    if form is None and word != "off":
        raise call.wrong()
    if form is None:
        if shown is not None:
            shown.close()
            record.bytes_shown = None
        workspace.notify(f"{bus.name}: bytes are not shown")
        return
    if shown is None:
        shown = record.bytes_shown = Watched(bus, workspace.publish, workspace.wall)
        shown.open()
    shown.form = form
    workspace.notify(f"{bus.name}: bytes are shown as {form.value[0]}, without polls; /hex off ends it")


async def bytes_(call: Call) -> None:
    line, data = _raw(call), parse_bytes(call.rest)
    if not data:
        raise call.wrong()
    await call.session.path.send_bytes(line.bus, data, call.by)
