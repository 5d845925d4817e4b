"""The simulated Arcus PMX-2ED-SA: the controller and its two stored programs, and the commands that a host sends.

The `set` of a cell is what was stored before the first power-up, and speeds, which a unit forgets at the next one.
"""

from __future__ import annotations

from multidrop.dialects import Diagnostic
from multidrop.dialects.pmx.manual import program_file
from multidrop.simulator.cell.spec import DriveSpec, Identity, WorldSpec
from multidrop.simulator.pmx.axis import Axis
from multidrop.simulator.pmx.commands import CommandedController
from multidrop.simulator.pmx.controller import BAUDS, PmxController
from multidrop.simulator.pmx.program_commands import PROGRAMS, answer_program
from multidrop.simulator.pmx.programs import Programs
from multidrop.simulator.world import World


class PmxDevice:
    """One controller, powered up at time 0. Raises Diagnostic for settings that it refuses, and for a program.

    `baud` is its baud rate if the cell file sets no other.
    """

    def __init__(self, spec: DriveSpec, baud: int = 0) -> None:
        specs = (spec.world, spec.further[0] if spec.further else WorldSpec())
        self.worlds = (World(specs[0]), World(specs[1]))
        self.controller = PmxController(spec.name, self.worlds, specs)
        self.commanded = CommandedController(self.controller)
        self.programs = Programs(self.commanded, spec.instruction_us / 1e6)
        self.controller.settings.variables = self.programs.variables
        self.controller.settings["DB"] = next((code for code, each in BAUDS.items() if each == baud), 1)
        self.controller.settings.store()
        self.controller.power_up(0.0)
        self._begin_counters(spec.identity)
        for name, value in (*spec.assignments(), *spec.variables.items()):
            reply = self.execute(f"{name}={value}", 0.0)
            if reply != "OK":
                raise Diagnostic(f"set {name} = {value} is refused: {reply}", f'PMX "{spec.name}"')
        self.controller.settings.store()
        self.controller.baud = BAUDS[self.controller.settings["DB"]]
        self.controller.boot_outputs(0.0)
        if spec.program:
            self.programs.memory.load(program_file.memory(spec.program, spec.program_name))
        self._start_programs(0.0)

    def _begin_counters(self, identity: Identity) -> None:
        """Let the counters begin where a snapshot found them, and report its product and version."""
        controller, counters = self.controller, identity.counters
        controller.product = identity.part or controller.product
        controller.version = identity.version or controller.version
        for key, begin in (("encoder", Axis.set_encoder), ("position", Axis.set_position)):
            for axis, value in zip(controller.axes, counters.get(key, ()), strict=False):
                begin(axis, value, 0.0)

    @property
    def number(self) -> str:
        """Its address, two digits."""
        return self.controller.settings.number

    @property
    def baud(self) -> int:
        """The baud rate of its RS-485 port."""
        return self.controller.baud

    @property
    def powered(self) -> bool:
        """Whether it has power."""
        return self.controller.powered

    @property
    def deadline(self) -> float | None:
        """Time of its next event; None if only new input can cause one."""
        return self.programs.deadline if self.powered else None

    def advance(self, now: float) -> None:
        """Let everything happen that is due up to `now`."""
        if self.powered:
            self.programs.advance(now)

    def execute(self, text: str, now: float) -> str:
        """Carry out one ASCII command of a host; give its reply without CR. Every text has a reply."""
        self.advance(now)
        self.controller.heard(now)
        reply = answer_program(self.programs, text, now)
        return self.commanded.ask(text, now) if reply is None else reply

    def world_changed(self) -> None:
        """Nothing to do: `advance` looks at the whole world anyway."""

    def power(self, on: bool, now: float) -> None:
        """Switch it on or off."""
        self.advance(now)
        if on == self.powered:
            return
        if on:
            self.programs.power_up(now)
            self.controller.power_up(now)
            self._start_programs(now)
        else:
            for program in range(PROGRAMS):
                self.programs.control(program, 0, now)
            self.controller.power_off(now)

    def supply(self, on: bool, now: float) -> None:
        """Switch the drivers' power; the controller keeps counting."""
        self.advance(now)
        self.controller.supply(on, now)

    def _start_programs(self, now: float) -> None:
        for program in range(PROGRAMS):
            if self.controller.settings["SLOAD"] >> program & 1:
                self.programs.control(program, 1, now)
