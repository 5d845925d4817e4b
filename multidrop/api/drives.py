"""The awaited drive: one address, and on it one axis, with its program and its settings."""

from __future__ import annotations

import contextlib
import operator
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from multidrop.api.calls import Calls, WrittenStop
from multidrop.api.events import Fault, fault_of
from multidrop.api.fixed import Fixed
from multidrop.api.notebooks import picture
from multidrop.api.programs import AsyncParameters, AsyncPrograms
from multidrop.api.values import seconds, short_text_of, text_of
from multidrop.base.errors import Diagnostic, DriveError, Inexpressible, Refused
from multidrop.base.text import visible
from multidrop.dialects import Motion
from multidrop.dialects.controls import DISABLE, ENABLE
from multidrop.dialects.units import QUANTITY
from multidrop.dialects.values import Conditions
from multidrop.dialects.values import Value as Fact
from multidrop.drives.drive import still
from multidrop.shell import stop_report, waits
from multidrop.shell.line_syntax import join_target
from multidrop.shell.origin import Origin
from multidrop.shell.scripts.expression import DriveQuestion, Value
from multidrop.shell.scripts.questions import ask
from multidrop.shell.workspace import address_of

if TYPE_CHECKING:
    from multidrop.api.telemetry import AsyncTelemetry
    from multidrop.drives.drive import Drive


A = TypeVar("A", Motion, Conditions)


def _amount(number: float, unit: str) -> int | str:
    """Whole steps, or a quantity as a line has it. Raises Diagnostic for another number, TypeError for such steps."""
    if isinstance(number, bool):
        raise TypeError(f"{number} is no number of steps")
    if not unit:
        return operator.index(number)  # type: ignore[arg-type]
    text = f"{{{text_of(number, 'a quantity')} {unit}}}"
    if QUANTITY.fullmatch(text) is None:
        raise Diagnostic(f"not a quantity: {visible(f'{number} {unit}')}", "", 'valid: as in move(12.5, "mm")')
    return text


_WORD = re.compile(r"[A-Za-z]\w*", re.ASCII)


class Limits(NamedTuple):
    """The ends of an axis; None: the drive has no such limit, or does not report it."""

    minus: bool | None
    """The minus switch is active."""
    plus: bool | None
    travel: tuple[int, int] | None
    """The positions between which software limits let it move."""


async def conditions(drive: Drive, slow: bool = True) -> tuple[Conditions, ...]:
    """Read the conditions of each axis; without those of `slow` parts where they are not wanted.

    What such a part has read since the last command is not read again. Raises Inexpressible where the drive is set to
    reply in a way in which nothing is asked.
    """
    facts, asked = dict[str, Fact](), set[str]()
    while left := [
        each for each in drive.family.values.parts(facts) if each.name not in asked and (slow or not each.slow)
    ]:
        part = left[0]
        asked.add(part.name)
        values, at = drive.settings.get(part.name, ({}, -1)) if part.slow else ({}, -1)
        if at != drive.commands:
            commands = drive.commands
            with contextlib.suppress(Refused):
                values = await drive.run(part.read())
                if part.slow:
                    drive.settings[part.name] = (values, commands)
        facts.update(values)
    if not asked:
        raise Inexpressible(f"{drive.shown}: its state is not asked for as it is set to reply (EM=3)")
    return drive.family.values.fold(facts)


class DriveFacts(Fixed):
    """The facts of a drive that are known without asking it."""

    _own = frozenset({"axis", "programs", "parameters"})
    _instead = "; write() gives the drive a value, as in write('VM', 500000)"

    def __init__(self, calls: Calls, drive: Drive, axis: str) -> None:
        self._drive = drive
        self.axis = axis
        """The axis that it moves and reads; empty: the first."""
        self._calls = calls

    @property
    def name(self) -> str:
        """Its address, with the bus where several are open."""
        return address_of(self._calls.shell, self._drive)

    @property
    def address(self) -> str:
        """Its address on the wire; empty where it needs none."""
        return self._drive.address

    @property
    def product(self) -> str:
        """The short name of the product, such as LMDCM; empty if unknown."""
        return self._drive.product

    @property
    def version(self) -> str:
        """The version that it reports."""
        return self._drive.version

    @property
    def referenced(self) -> bool:
        """False after a restart that was seen, until a homing has ended or the position was set."""
        lost = self._drive.state.unreferenced
        return not (lost & {self.axis.lower(), ""} if self.axis else lost)

    @property
    def _target(self) -> str:
        """Its address with its bus, as after an `@`."""
        return join_target(self._drive.link.name, self._drive.address)

    def __repr__(self) -> str:
        """Return its name, product and version."""
        axis = f", axis {self.axis}" if self.axis else ""
        return f"<drive {self.name or self._target}: {self.version or self.product}" + f"{axis}>"

    def _repr_html_(self) -> str | None:
        """Return what is known of it, for a notebook."""
        return picture("Drive", self)


def _first(drive: DriveFacts) -> str:
    """Its axis as in `Motion.axis`."""
    return drive.axis.lower() or drive._drive.family.units.axes()[0]


def _of_axis(drive: DriveFacts, axes: Sequence[A]) -> A:
    wanted = drive.axis.lower()
    motion = next((axis for axis in axes if wanted in ("", axis.axis.lower())), None)
    if motion is None:
        names = ", ".join(axis.axis for axis in axes if axis.axis)
        raise Diagnostic(f"no axis {drive.axis}", drive.name, f"valid: {names}" if names else "it has one axis")
    return motion


async def _homing_ended(calls: Calls, drive: Drive, axis: str) -> bool:
    return await calls.run(lambda origin: drive.homing_ended(axis))


class AsyncDrive(DriveFacts):
    """A drive of a session. Steps are the drive's own units: motor steps, or counts with its encoder in use."""

    def __init__(self, calls: Calls, drive: Drive, axis: str = "") -> None:
        super().__init__(calls, drive, axis)
        self._axis_known = not axis
        self.programs = AsyncPrograms(calls, drive)
        self.parameters = AsyncParameters(calls, drive)

    # Lines

    async def send(self, line: str) -> list[str]:
        """Send a line in the drive's own language; return the lines that it prints. Raises Refused, NoAnswer."""
        printed: list[str] = []
        await self._calls.run(lambda origin: self._send(origin, line), printed)
        return printed

    async def _send(self, origin: Origin, *lines: str) -> None:
        shell = self._calls.shell
        for line in filter(self._drive.starts, lines):  # before a setting that belongs to a refused move
            self._drive.check_start(line)
        for line in lines:
            await shell.run(f"@{self._target} {line}", origin)

    async def read(self, name: str | int) -> Value:
        """Read the value of a word of the drive, such as `VM`; of a parameter by number or name.

        `[LINE]` asks with a line that prints one value.
        """
        name = self._drive.family.values.actions.word(str(name), self.axis)
        line = name.startswith("[") and name.endswith("]")
        word = DriveQuestion(name[1:-1] if line else name, self._target, line)
        shell = self._calls.shell
        if not line and not _WORD.fullmatch(name):
            raise Diagnostic(f"{name!r} is not a word of a drive", self.name, "valid: as in read('VM')")
        return await self._calls.run(lambda origin: ask(shell, origin, word))

    async def write(self, name: str | int, value: Value) -> None:
        """Give a word of the drive a value. Raises Refused; Diagnostic where its language has no such form."""
        name = self._drive.family.values.actions.word(str(name), self.axis)
        text = value if isinstance(value, str) else short_text_of(value, f"{name} of {self.name}")
        line = self._drive.family.assign(name, text) if _WORD.fullmatch(name) else None
        if line is None:
            raise Diagnostic(f"no line gives {name!r} a value", self.name, "send() takes any line of the drive")
        self._check_executes()
        await self._calls.run(lambda origin: self._send(origin, line))

    # Motion

    async def move(self, steps: float, unit: str = "", *, beyond: bool = False) -> None:
        """Begin to move by a distance: whole steps, or a number of a unit, as in `move(12.5, "mm")`.

        `beyond`: it may leave the travel of its axis. Raises Refused; Diagnostic for a unit that its scale has not;
        TypeError for a fraction of a step.
        """
        await self._move(self._drive.family.move(self.axis, _amount(steps, unit)), beyond)

    async def move_to(self, position: float, unit: str = "", *, beyond: bool = False) -> None:
        """Begin to move to a position: whole steps, or a number of a unit. As `move` in all else."""
        await self._move(self._drive.family.move_to(self.axis, _amount(position, unit)), beyond)

    async def run_at(self, velocity: float, unit: str = "") -> None:
        """Begin to run at a velocity, negative for minus: whole steps a second, or a number of a unit. 0 ends it.

        Where the language has no such line, the setting of the velocity stays at it, and a unit is refused.
        """
        await self._move(self._drive.family.values.actions.run(_first(self), _amount(velocity, unit)), False)

    async def _move(self, lines: tuple[str, ...], beyond: bool = False) -> None:
        self._check_executes()
        if not self._axis_known:
            await self.motion()
        drive = self._drive
        async with self._calls.moves(drive):  # a mode and its move belong together
            kept = [name for name, (_, at) in drive.settings.items() if at == drive.commands]
            commands = drive.commands + len(lines)
            await self._calls.run(lambda origin: self._send(replace(origin, may_leave_travel=beyond), *lines))
            if drive.commands == commands and "=" not in "".join(lines):  # a move changes no setting
                drive.settings |= {name: (drive.settings[name][0], commands) for name in kept}

    async def wait(self, timeout: float = waits.WAIT_TIMEOUT, *, idle: bool = False) -> None:
        """Wait until two readings show it at rest; with `idle` also until no program runs.

        Raises MotionFailed where its last motion of this session did not end as it should, Timeout after `timeout`
        seconds, DriveError where a homing has ended with an error.
        """
        drive, shell, timeout = self._drive, self._calls.shell, seconds(timeout, "wait")
        await self._calls.run(lambda origin: waits.wait(shell, origin, timeout, idle=idle, drives=[drive], said="wait"))
        for axis in [homing for homing in drive.homings if homing not in drive.homed]:
            well = await _homing_ended(self._calls, drive, axis)
            if not (well or self._drive.family.values.actions.no_error) and await self.error() is not None:
                raise DriveError(f"{self.name}: the homing has ended with an error; read_error() reads and clears it")
        if self._calls.returns is not None:
            await self.motion()

    async def wait_for(self, condition: str, timeout: float = waits.WAIT_TIMEOUT) -> None:
        """Wait until the drive reports a value: `I1=1`, `P>=51200`, `P > {10 mm}`.

        Raises MotionFailed once a motion of this session has failed, Timeout, Diagnostic.
        """
        wanted, shell, timeout = waits.condition(condition), self._calls.shell, seconds(timeout, "wait_for")
        if wanted is None or wanted.target:
            raise Diagnostic(f"no condition {condition!r}", self.name, "valid: as in wait_for('I1=1')")
        wanted = replace(wanted, word=self._drive.family.values.actions.word(wanted.word, self.axis))
        units = shell.units if wanted.quantity else None
        await self._calls.run(
            lambda origin: waits.wait_value(shell, origin, self._drive, wanted, timeout, units, "wait_for")
        )

    # Homing

    async def home(self, direction: str = "", mode: str = "") -> None:
        """Begin to home in a direction, `-` or `+`; `wait` waits for its end.

        `mode`: what it looks for, as the family has it: `home` (the switch), `index`. Raises Diagnostic with the
        choices; a direction is left out where the drive's own settings fix it. Raises Inexpressible where no line homes
        such drives.
        """
        modes = self._drive.family.values.actions.homings(_first(self))
        if not modes:
            raise Inexpressible(f"{self.name}: no line of such drives homes them; nothing was sent")
        lines = modes.get(mode or next(iter(modes)))
        if lines is None:
            raise Diagnostic(f"no mode {mode}", f"home() of {self.name}", f"valid: {', '.join(modes)}")
        if direction not in lines:
            what = f"no direction {direction!r}" if direction else "it needs a direction"
            hint = ", ".join(f"home({sign!r}) sends {line}" for sign, line in lines.items())
            if "" in lines:
                what, hint = "the drive's own settings fix its direction", f"home() sends {lines['']}"
            raise Diagnostic(what, f"home() of {self.name}", hint)
        await self._move((lines[direction],))

    async def homed(self) -> bool:
        """Whether the last homing of this session has ended well, and its position counts since.

        A drive does not keep that it was homed. Reads the drive where a homing may just have ended.
        """
        drive, axis = self._drive, _first(self)
        if axis in drive.homings and axis not in drive.homed:
            self._check_executes()
            if not await self._calls.run(lambda origin: still(drive)):
                return False
            await _homing_ended(self._calls, drive, axis)
        return drive.homed.get(axis, False) and not drive.state.unreferenced & {axis, ""}

    async def accept(self) -> None:
        """Take the position as right, as `/referenced` does: it counts again, and moves are sent again."""
        shell = self._calls.shell
        await self._calls.run(lambda origin: shell.run(f"/referenced {self._target}".strip(), origin))

    # Current, inputs and outputs, errors

    async def enable(self, on: bool = True) -> None:
        """Switch the current of the motor on. Raises Inexpressible where its family has no command for it."""
        name = ENABLE if on else DISABLE
        control = self._drive.family.values.controls(_first(self))[name]
        if control.absent:
            raise Inexpressible(f"{self.name}: no {name}(): {control.absent}")
        self._check_executes()
        await self._calls.run(lambda origin: self._send(origin, *control.filled()))
        if not on:
            text = f"{self.name}: {control.about}; a load that hangs may drop"
            self._calls.shell.notify(text, bus=self._drive.link.name, warning=True)

    async def disable(self) -> None:
        """Switch the current of the motor off: **a load that hangs may drop**. Raises as `enable`."""
        await self.enable(False)

    async def set_output(self, number: int, value: bool) -> None:
        """Switch an output on or off, by its number in the drive's language. Raises Refused where it has none."""
        self._check_executes()
        await self._calls.run(
            lambda origin: self._send(origin, self._drive.family.values.actions.output(number, bool(value)))
        )

    async def inputs(self) -> dict[int | str, bool]:
        """Read the inputs: True is active. By number, and by function where they have one: `home`, `lim+`, `lim-`."""
        levels: dict[int | str, bool] = {}
        for lamp in (await self._conditions()).lamps:
            if not lamp.output and lamp.on is not None:
                levels |= {int(lamp.name): lamp.on} if lamp.name.isdigit() else {}
                levels |= {lamp.function: lamp.on} if lamp.function else {}
        for number, line in self._drive.family.values.actions.ports().items():
            levels[number] = bool(await self.read(f"[{line}]"))
        return levels

    async def limits(self) -> Limits:
        """Read the limit switches, and the travel between software limits."""
        conditions = await self._conditions()
        on = {lamp.function: lamp.on for lamp in conditions.lamps if not lamp.output}
        return Limits(on.get("lim-"), on.get("lim+"), conditions.limits)

    async def error(self) -> Fault | None:
        """Read what is known of its error and leave it set; None: there is none. `read_error` has its number.

        Raises Inexpressible where its family has no error to read.
        """
        if why := self._drive.family.values.actions.no_error:
            raise Inexpressible(f"{self.name}: {why}")
        return fault_of(await self._conditions(slow=False))

    async def read_error(self) -> Fault | None:
        """Read the error **and clear it**; None: there was none. Raises as `error`."""
        fault, actions = None, self._drive.family.values.actions
        if not actions.error:
            fault = await self.error()
        elif code := await self.read(actions.error):
            text = f"error {code}"
            with contextlib.suppress(Diagnostic):
                text = self._drive.family.language.describe_error(int(code), self.product)[0]
            fault = Fault(int(code), text)
        if fault is not None and (clear := actions.clear(_first(self))):
            await self._calls.run(lambda origin: self._send(origin, clear))
        return fault

    async def _conditions(self, slow: bool = True) -> Conditions:
        self._check_executes()
        return _of_axis(self, await self._calls.run(lambda origin: conditions(self._drive, slow)))

    # Position and velocity

    async def position(self) -> int:
        """Read the position."""
        return (await self.motion()).position

    async def velocity(self) -> int:
        """Read the velocity, signed, per second."""
        return (await self.motion()).velocity

    async def position_in(self, unit: str) -> float:
        """Read the position in a unit of its scale, such as `mm`. Raises Diagnostic where it has none."""
        return await self._in("position", unit)

    async def velocity_in(self, unit: str) -> float:
        """Read the velocity in a unit of its scale, such as `mm/s`, signed. Raises as `position_in`."""
        return await self._in("velocity", unit)

    async def _in(self, what: str, unit: str) -> float:
        self._check_executes()
        units, axis = self._calls.shell.units, self.axis.lower()
        return await self._calls.run(lambda origin: units.reading(self._drive, axis, what, unit))

    async def moving(self) -> bool:
        """Read whether it moves; at rest, two readings say so."""
        self._check_executes()
        return not await self._calls.run(lambda origin: still(self._drive))

    async def motion(self) -> Motion:
        """Read position and velocity of its axis at one time."""
        self._check_executes()
        motion = _of_axis(self, await self._calls.run(lambda origin: self._drive.motion()))
        self._axis_known = True
        return motion

    def _check_executes(self) -> None:
        """Raise Refused in program mode, where the drive would store a line or a question."""
        if self._drive.programming:
            raise Refused(f"{self.name} is in program mode and would store this; PG ends it")

    # Stop, samples

    def stop(self) -> WrittenStop:
        """Stop this drive now; await what is returned for the report. It refuses nothing afterwards."""
        shell = self._calls.shell
        halt = shell.bus(self._drive.link.name).stop([self._drive])
        self._drive.motions.stopped(None)
        several = len(shell.buses) > 1
        return WrittenStop(shell, lambda: stop_report.of_halts([halt], shell.wall(halt.at), several))

    def telemetry(self, rate: float = 50.0) -> AsyncTelemetry:
        """Read position and velocity `rate` times a second at most, as an iterator of samples."""
        return self._calls.telemetry([self._drive], rate)
