"""The supply of a simulated drive and its memory that lasts: on, off, without +V, how it begins, S, IP and FD.

A serial drive begins at once. One with Ethernet is silent for `ETHERNET_BOOT` seconds after it was switched on, reset
(^C, an input of that type) or set to factory defaults, as real ones are; a cell begins with all of its drives up.
Manual 3.4.4, 5.1.45, 5.1.63, 5.1.113, 5.1.121, 5.1.127.
"""

from __future__ import annotations

from multidrop.families.lexium.manual.errors import ErrorNumber as E
from multidrop.families.lexium.manual.grammar import NameTerm
from multidrop.families.lexium.manual.groups import UNIT
from multidrop.families.lexium.simulator.motion.axis import MOVES
from multidrop.families.lexium.simulator.motion.counters import FRESH
from multidrop.families.lexium.simulator.motion.motor import LexiumMotor
from multidrop.families.lexium.simulator.motion.outputs import Outputs
from multidrop.families.lexium.simulator.state.errors import DriveFault
from multidrop.families.lexium.simulator.state.interpreter import Core
from multidrop.families.lexium.simulator.state.memory import Memory, NonVolatileMemory
from multidrop.families.lexium.simulator.state.program_memory import ProgramContents

ETHERNET_BOOT = 20.0
"""Seconds, of the device's own time."""
PROMPT = ">"
BAUDS = {48: 4800, 96: 9600, 19: 19200, 38: 38400, 11: 115200}
"""By BD."""


class Nvm:
    """NVM of one drive. A product with `lasting_programs` keeps each program line at once, without S."""

    def __init__(self, core: Core, motor: LexiumMotor, outputs: Outputs) -> None:
        self._memory, self._program, self._timeline = core.memory, core.program, core.timeline
        self._motor, self._outputs = motor, outputs
        self.store = NonVolatileMemory(program=self._kept(ProgramContents(product=core.memory.product)))

    @property
    def locked(self) -> bool:
        """Return whether a lock (LK) has been saved."""
        return bool(self.store.values.get("LK"))

    def save(self) -> None:
        """S. Raises DriveFault (73)."""
        if self._moving() and self._motor.axis.kind in MOVES:
            raise DriveFault(E.MOVING_SAVE)
        self.keep()

    def initialise(self) -> None:
        """IP. Raises DriveFault (74)."""
        if self._moving():
            raise DriveFault(E.MOVING_CLEAR)
        self.load()

    def erase(self) -> None:
        """Reset NVM to factory defaults, except what these leave alone. Raises DriveFault (73)."""
        if self._moving():
            raise DriveFault(E.MOVING_SAVE)
        fresh, kept = NonVolatileMemory(program=self._kept(ProgramContents(product=self._memory.product))), self.store
        Memory(self._memory.product).save(fresh)
        fresh.values.update({name: value for name, value in kept.values.items() if name in UNIT})
        fresh.texts.update({name: value for name, value in kept.texts.items() if name in UNIT})
        fresh.program.clear()
        self.store = fresh

    def keep(self) -> None:
        store = self.store
        self._memory.save(store)
        store.inputs, store.outputs = dict(self._motor.inputs.types), dict(self._outputs.types)
        store.limits = dict(self._motor.limits.software)
        store.trips = dict(self._motor.trips.defined)
        store.program = self._kept(self._program.copy())

    def load(self) -> None:
        """Take back variables, flags and set-ups; programs stay as they are."""
        store = self.store
        self._motor.reload(lambda: self._memory.load(store), self._timeline.now)
        self._motor.inputs.restore(store.inputs)
        self._outputs.restore(store.outputs)
        self._motor.limits.software.update({**FRESH, **store.limits})
        self._motor.trips.restore(store.trips)

    def _moving(self) -> bool:
        return self._motor.status.moving(self._timeline.now)

    def _kept(self, program: ProgramContents) -> ProgramContents:
        return self._program if self._memory.model.lasting_programs else program


class Power:
    """The supply of one drive. `boots_at` is when one that begins again will be up; `boots` counts its beginnings."""

    def __init__(self, core: Core, motor: LexiumMotor, outputs: Outputs, nvm: Nvm) -> None:
        self._core, self._timeline = core, core.timeline
        self._motor, self._outputs, self.nvm, self._bridges = motor, outputs, nvm, motor.bridges
        self.boots_at: float | None = None
        self.boots = 0

    def factory_defaults(self) -> None:
        """FD: programs, variables and settings are gone. Raises DriveFault (73)."""
        self.nvm.erase()
        self.restart()

    def switch(self, on: bool) -> None:
        """Switch the drive on or off now. What NVM holds stays."""
        if on == (self._bridges.powered or self.boots_at is not None):
            return
        if on:
            self._core.world.powered_up(self._timeline.now)
            self.restart()
        else:
            self._go_down()
            self._core.printer.take()

    def restart(self) -> None:
        """Begin as at power-up: now, or when it has booted."""
        if not self._core.model.ethernet:
            self.come_up()
            return
        self._go_down()
        self.boots_at = self._timeline.now + ETHERNET_BOOT

    def come_up(self) -> None:
        self._bridges.powered, self.boots_at = True, None
        self.boots += 1
        self.boot()

    def supply(self, on: bool) -> None:
        if self._motor.supply(on, self._timeline.now):
            self._core.interpreter.raise_error(E.MOTOR_VOLTAGE)
            self._motor.trips.power_lost(self._timeline.now)
        self._timeline.replan()

    def boot(self) -> None:
        """Begin with what NVM holds: sign on, but not in party mode, and run SU."""
        core, memory, t = self._core, self._core.memory, self._timeline.now
        core.interpreter.clear()
        memory.defaults()
        self._outputs.defaults()
        self.nvm.load()
        core.program.load(self.nvm.store.program)
        core.errors.clear()
        memory.await_input("")
        core.mode.address = None
        self._motor.restart(t)
        self._motor.inputs.begin(t)
        core.printer.baud = BAUDS[int(memory.values.get("BD", 96))]
        if not memory.party:
            prompts = core.model.prompts_at_start and memory.echo_mode == 0 and not memory.checksum
            core.printer.announce(core.model.sign_on + (PROMPT if prompts else ""))
        if "SU" in core.program.labels:
            core.interpreter.start(NameTerm("SU"), t)

    def _go_down(self) -> None:
        self._motor.stop(self._timeline.now)
        self._core.thread.finish()
        self._motor.trips.clear()
        self._bridges.powered, self.boots_at = False, None
