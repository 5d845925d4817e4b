"""Memory that lasts: S, IP and FD (manual 5.1.45, 5.1.63, 5.1.113)."""

from __future__ import annotations

from collections.abc import Callable

from multidrop.dialects.mcode.manual.errors import ErrorNumber as E
from multidrop.simulator.lexium.motion.axis import MOVES
from multidrop.simulator.lexium.motion.inputs import Inputs
from multidrop.simulator.lexium.motion.limits import FRESH
from multidrop.simulator.lexium.motion.motor import Motor
from multidrop.simulator.lexium.motion.outputs import Outputs
from multidrop.simulator.lexium.state.errors import Fault
from multidrop.simulator.lexium.state.memory import KEPT_BY_FD, Memory, Store
from multidrop.simulator.lexium.state.program_memory import Program
from multidrop.simulator.lexium.state.timeline import Timeline


class Nvm:
    """NVM of one drive; the language uses it as its `Storage`. `restart` restarts the drive as at power-up."""

    def __init__(
        self,
        memory: Memory,
        program: Program,
        timeline: Timeline,
        inputs: Inputs,
        outputs: Outputs,
        motor: Motor,
        restart: Callable[[], None],
    ) -> None:
        self._memory, self._program, self._timeline = memory, program, timeline
        self._inputs, self._outputs, self._motor, self._restart = inputs, outputs, motor, restart
        self.store = Store(program=Program(product=memory.product))

    @property
    def locked(self) -> bool:
        """Whether a lock (LK) has been saved."""
        return bool(self.store.values.get("LK"))

    def save(self) -> None:
        """S. Raises Fault (73)."""
        if self._moving() and self._motor.axis.kind in MOVES:
            raise Fault(E.MOVING_SAVE)
        self.keep()

    def initialise(self) -> None:
        """IP. Raises Fault (74)."""
        if self._moving():
            raise Fault(E.MOVING_CLEAR)
        self.load()

    def factory_defaults(self) -> None:
        """FD: programs, variables and settings are gone. Raises Fault (73)."""
        if self._moving():
            raise Fault(E.MOVING_SAVE)
        self._erase()
        self._restart()

    def program_changed(self) -> None:
        """Keep a change of program memory at once, on products that do so without S."""
        if self._memory.model.lasting_programs:
            self.store.program = self._program

    def keep(self) -> None:
        """Copy everything that lasts to NVM."""
        store = self.store
        self._memory.save(store)
        store.inputs, store.outputs = dict(self._inputs.types), dict(self._outputs.types)
        store.limits = dict(self._motor.limits.software)
        store.trips = dict(self._motor.trips.defined)
        store.program = self._program.copy()

    def load(self) -> None:
        """Take back variables, flags and set-ups; programs stay as they are."""
        store = self.store
        self._motor.reload(lambda: self._memory.load(store), self._timeline.now)
        self._inputs.restore(store.inputs)
        self._outputs.restore(store.outputs)
        self._motor.limits.software.update({**FRESH, **store.limits})
        self._motor.trips.restore(store.trips)

    def load_program(self) -> None:
        """Take back program memory."""
        self._program.load(self.store.program)

    def _erase(self) -> None:
        """Reset NVM to factory defaults, except what these leave alone."""
        fresh, kept = Store(program=Program(product=self._memory.product)), self.store
        Memory(self._memory.product).save(fresh)
        fresh.values.update({name: value for name, value in kept.values.items() if name in KEPT_BY_FD})
        fresh.texts.update({name: value for name, value in kept.texts.items() if name in KEPT_BY_FD})
        self.store = fresh

    def _moving(self) -> bool:
        return self._motor.status.moving(self._timeline.now)
