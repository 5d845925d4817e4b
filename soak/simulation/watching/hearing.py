"""What a session says and what somebody types, as it happens: notes of both for the judge."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from functools import partial

from multidrop.dialects import Codec
from multidrop.drives.bus import Bus
from multidrop.drives.events import Ended, Sent
from multidrop.drives.stop_forms import stop_forms
from multidrop.shell.events import Failed, Notified, OnBus, Output, Printed
from multidrop.shell.session import Session
from multidrop.transports import telnet
from multidrop.transports.relay import Kind, frame
from multidrop.transports.relay_pipe import RelayPipe
from soak.simulation.records.history import Shown, Stop
from soak.simulation.records.phrases import STOP
from soak.simulation.watching.session import ASKED
from soak.simulation.world import World

STOPPED = re.compile(r"(?:(\w+): )(?:(\w+): )?stopped, velocity 0 ")


def heard(world: World, event: object, who: str = "") -> None:
    """Take what a session says."""
    if not who and world.process.dead:
        return
    if isinstance(event, OnBus):
        world.history.exchanges += isinstance(event.event, Ended)
        if isinstance(event.event, Sent):
            world.history.sent.add((event.bus, event.event.request.text))
        return
    if isinstance(event, Notified | Failed | Printed | Output):
        world.history.note(world.loop.now, type(event).__name__, event.text)
        world.history.notices.append((world.loop.now, event.text))
    if isinstance(event, Notified):
        world.history.unsent(event.text)
        if (found := STOPPED.match(event.text)) is not None:
            _judge_stopped(world, found[1], found[2] or "", who)
    if isinstance(event, Printed) and (asked := ASKED.get()) is not None:
        names = world.place(event.bus).names
        drive = event.address if event.address in names else names[0]
        form, began, restarts = world.history.questions[asked[0]], asked[1], world.restarts(event.bus, drive)
        world.history.shown.append(Shown(event.bus, drive, event.text, form, began, world.loop.now, restarts))


def _judge_stopped(world: World, line: str, drive: str, who: str) -> None:
    """Note a drive that is said to stand and moves, unless a line has started it since the stop."""
    now = world.floor.now()
    for placed in world.floor.floor.drives:
        if placed.bus != line or (drive and placed.spec.name != drive):
            continue
        since = max((each.at for each in world.history.stops if each.who == who), default=0.0)
        name = placed.spec.name
        started = any(each.at >= since and (each.line, each.drive) == (line, name) for each in world.history.executed)
        shadow = placed.unit.shadow
        assert shadow is not None
        if not started and any(each.velocity for each in shadow.motion(now)):
            world.history.untrue.append(f"{world.loop.now:.3f} {line}:{name} is said to be stopped, and moves")


def typed(world: World, data: bytes, session: Session, who: str = "") -> None:
    """Take what somebody types; at a stop, note what has to leave next on each line."""
    world.history.note(world.loop.now, f"key{who}", data.hex())
    if data[:1] in (b"y", b"Y"):
        world.history.told.yes.append(world.loop.now)
    if STOP in data:
        buses = {name: bus for name, bus in session.buses.items() if not bus.link.lost}
        forms = {f"{name}{who}": _forms(world, bus) for name, bus in buses.items()}
        repeats = {name + who: stop_forms(bus.roster).repeats for name, bus in buses.items() if name not in session.raw}
        pieces = {name: tuple(each.data for each in found) for name, found in repeats.items()}
        parts = {name + who: _parts(bus) for name, bus in buses.items()}
        trying = session.reconnections.trying
        for name, bus in buses.items():
            pipe = bus.link.transport
            if (
                isinstance(pipe, RelayPipe) and pipe._relay.room <= 0
            ):  # the far side has taken nothing of the last stops
                world.history.full.append((world.loop.now, f"{name}{who}"))
        lost = tuple(name + who for name, bus in session.buses.items() if bus.link.lost and name in trying)
        reaches = {f"{name}{who}": _reaches(bus) for name, bus in buses.items() if world.place(name).kind != "usb"}
        stop = Stop(
            world.loop.now,
            forms,
            who,
            len(world.history.written),
            lost=lost,
            pieces=pieces,
            parts=parts,
            reaches=reaches,
        )
        world.history.stops.append(stop)


def _reaches(bus: Bus) -> dict[str, Callable[[bytes], bool]]:
    """By drive, whether bytes hold its stop."""
    found: dict[str, Callable[[bytes], bool]] = {}
    for drive in bus.roster.all_drives:
        codec, name, sure = drive.state.codec, drive.state.address or drive.state.name, not drive.state.settings_unknown
        own = codec.stop([name], sure)
        if codec.stop_replies:
            found[drive.shown] = partial(_in, own)
        else:
            found[drive.shown] = partial(codec.hears_stop, address=name, sure=sure)
    return found


def _parts(bus: Bus) -> tuple[bytes, ...]:
    """The bytes that a stop of a line is made of."""
    forms = stop_forms(bus.roster)
    cut, _ = forms.written(cut=True)
    found = (forms.immediate, forms.unterminated, forms.invalidate, cut, *(each.data for each in forms.repeats))
    return tuple(filter(None, (*found, *_unsure(bus))))


def _in(own: bytes, left: bytes) -> bool:
    return own in left


def _unsure(bus: Bus) -> Iterator[bytes]:
    """The same with settings in doubt: an owed stop that is written as this one waits for the line makes them so."""
    names: dict[Codec, list[str]] = {}
    for drive in bus.roster.all_drives:
        names.setdefault(drive.state.codec, []).append(drive.state.address or drive.state.name)
    for half_sent in (False, True):
        yield b"".join(codec.stop(each, sure=False, half_sent=half_sent) for codec, each in names.items())


def _forms(world: World, bus: Bus) -> tuple[bytes, ...]:
    """What a stop of a line may begin with."""
    forms, kind = stop_forms(bus.roster), world.place(bus.name).kind
    found = (forms.immediate,) if forms.framed else (forms.immediate, forms.unterminated, *_unsure(bus))
    if kind == "rfc2217":
        purge = b"" if forms.framed else telnet.message(telnet.Setting.PURGE, telnet.PURGE_UNSENT)
        return tuple(purge + telnet.escaped(each) for each in found)
    if kind == "ssh":
        drop = b"" if forms.framed else frame(Kind.DROP)
        return (drop + bytes((Kind.DATA,)),)
    return found
