"""The supply of a simulated drive: on, off, without +V, and how it begins (manual 3.4.4, 5.1.121, 5.1.127).

A serial drive begins at once. One with Ethernet is silent for `ETHERNET_BOOT` seconds after it was switched on, reset
(^C, an input of that type) or set to factory defaults, as real ones are; a cell begins with all of its drives up.
"""

from __future__ import annotations

from multidrop.dialects.mcode.manual.errors import ErrorNumber as E
from multidrop.dialects.mcode.manual.grammar import Name
from multidrop.simulator.lexium.language.interpreter import Interpreter
from multidrop.simulator.lexium.language.program_mode import ProgramMode
from multidrop.simulator.lexium.motion.inputs import Inputs
from multidrop.simulator.lexium.motion.motor import Motor
from multidrop.simulator.lexium.motion.outputs import Outputs
from multidrop.simulator.lexium.nvm import Nvm
from multidrop.simulator.lexium.state.comm_settings import CommSettings
from multidrop.simulator.lexium.state.error_flag import ErrorFlag
from multidrop.simulator.lexium.state.memory import Memory
from multidrop.simulator.lexium.state.printer import Printer
from multidrop.simulator.lexium.state.program_memory import Program
from multidrop.simulator.lexium.state.timeline import Timeline
from multidrop.simulator.world import World

ETHERNET_BOOT = 20.0
"""Seconds, of the device's own time."""
PROMPT = ">"
BAUDS = {48: 4800, 96: 9600, 19: 19200, 38: 38400, 11: 115200}
"""By BD."""


class Power:
    """The supply of one drive. `boots_at` is when one that begins again will be up; `boots` counts its beginnings."""

    def __init__(
        self,
        memory: Memory,
        program: Program,
        timeline: Timeline,
        world: World,
        settings: CommSettings,
        errors: ErrorFlag,
        printer: Printer,
        interpreter: Interpreter,
        mode: ProgramMode,
        inputs: Inputs,
        outputs: Outputs,
        motor: Motor,
        nvm: Nvm,
    ) -> None:
        self._memory, self._program, self._timeline, self._world = memory, program, timeline, world
        self._settings, self._errors, self._printer = settings, errors, printer
        self._interpreter, self._mode, self._nvm = interpreter, mode, nvm
        self._inputs, self._outputs, self._motor = inputs, outputs, motor
        self.boots_at: float | None = None
        self.boots = 0

    @property
    def on(self) -> bool:
        """Whether it has power, and is up."""
        return self._motor.bridges.powered

    def switch(self, on: bool) -> None:
        """Switch the drive on or off now. What NVM holds stays."""
        if on == (self.on or self.boots_at is not None):
            return
        if on:
            self._world.powered_up(self._timeline.now)
            self.restart()
        else:
            self._go_down()
            self._printer.take()

    def restart(self) -> None:
        """Begin as at power-up: now, or when it has booted."""
        if not self._settings.ethernet:
            self.come_up()
            return
        self._go_down()
        self.boots_at = self._timeline.now + ETHERNET_BOOT

    def come_up(self) -> None:
        """Begin with power: the drive has booted."""
        self._motor.bridges.powered, self.boots_at = True, None
        self.boots += 1
        self.boot()

    def supply(self, on: bool) -> None:
        """Switch +V alone, with the auxiliary supply left on."""
        if self._motor.supply(on, self._timeline.now):
            self._interpreter.raise_error(E.MOTOR_VOLTAGE)
            self._motor.trips.power_lost(self._timeline.now)
        self._timeline.replan()

    def boot(self) -> None:
        """Begin with what NVM holds: sign on, but not in party mode, and run SU."""
        memory, t = self._memory, self._timeline.now
        self._interpreter.clear()
        memory.defaults()
        self._outputs.defaults()
        self._nvm.load()
        self._nvm.load_program()
        self._errors.clear()
        memory.await_input("")
        self._mode.address = None
        self._motor.restart(t)
        self._inputs.begin(t)
        self._printer.baud = BAUDS[int(memory.values.get("BD", 96))]
        if not self._settings.party:
            self._sign_on()
        if "SU" in self._program.labels:
            self._interpreter.start(Name("SU"), t)

    def _sign_on(self) -> None:
        model, settings = self._memory.model, self._settings
        prompts = model.prompts_at_start and settings.echo_mode == 0 and not settings.checksum
        self._printer.announce(model.sign_on + (PROMPT if prompts else ""))

    def _go_down(self) -> None:
        self._motor.stop(self._timeline.now)
        self._interpreter.finish()
        self._motor.trips.clear()
        self._motor.bridges.powered, self.boots_at = False, None
