"""The variables and flags of motion that are more than a number in memory with a range."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from math import inf

from multidrop.dialects.mcode.manual.errors import ErrorNumber as E
from multidrop.simulator.lexium.motion.motor import Motor
from multidrop.simulator.lexium.state.errors import Fault
from multidrop.simulator.lexium.state.expressions import Read, Value, whole
from multidrop.simulator.lexium.state.interpreter import Core
from multidrop.simulator.lexium.state.memory import BANKED

Write = Callable[[Value], None]

LEAST_MS = 10
"""With hMT (manual 5.1.6)."""
MOST_DELAY = 65535
"""HT and MT together (manual 5.1.86)."""


class MotionVariables:
    """The motion variables of one drive."""

    def __init__(self, core: Core, motor: Motor) -> None:
        self._memory, self._values, self._timeline, self._motor = core.memory, core.values, core.timeline, motor

    def readers(self) -> dict[str, Read]:
        motor, timeline = self._motor, self._timeline
        counters, status, hmt = motor.counters, motor.status, motor.hmt
        return {
            "P": lambda: counters.value(counters.source, timeline.now),
            "C1": lambda: counters.value("C1", timeline.now),
            "C2": lambda: counters.value("C2", timeline.now),
            "V": lambda: status.speed(timeline.now),
            "AV": lambda: status.rotor_speed(timeline.now),
            "AF": lambda: hmt.status(timeline.now),
            "CB": lambda: hmt.bounds,
            "LL": lambda: hmt.lag(timeline.now),
            "MV": lambda: int(status.reported(timeline.now)),
            "MP": lambda: int(status.positioning(timeline.now)),
            "VC": lambda: int(status.changing(timeline.now)),
            "I6": lambda: int(status.at_index(timeline.now)),
            "IT": lambda: round(motor.heat.bridge(timeline.now)),
        }

    def writers(self) -> dict[str, Write]:
        return {
            "VI": self._write_vi,
            "VM": self._write_vm,
            "MS": self._write_ms,
            "EE": self._write_ee,
            "HT": partial(self._write_delay, "MT", "HT"),
            "MT": partial(self._write_delay, "HT", "MT"),
            **{name: partial(self._write_counter, name) for name in ("P", "C1", "C2")},
            "ST": self._write_st,
            "MF": self._write_mf,
            "TS": self._write_ts,
            "AS": self._write_as,
            "CB": lambda value: self._motor.hmt.set_bounds(self._memory.checked("CB", value)),
            "DE": lambda value: self._motor.enable(self._memory.checked("DE", value), self._timeline.now),
            **{name: partial(self._write_geometry, name) for name in ("EL", "SA")},
            **{name: partial(self._write_encoder, name) for name in ("DB", "PM", "SF")},
            "RD": self._write_rd,
        }

    # Velocities and resolution.

    def _write_vi(self, value: Value) -> None:
        number = self._velocity("VI", value)
        if number >= self._values["VM"]:
            raise Fault(E.VI_NOT_BELOW_VM)
        self._values["VI"] = number

    def _write_vm(self, value: Value) -> None:
        number = self._velocity("VM", value)
        if number <= self._values["VI"]:
            raise Fault(E.VM_NOT_ABOVE_VI)
        self._values["VM"] = number

    def _velocity(self, name: str, value: Value) -> int:
        """A velocity in the unit of motion. Raises Fault (21, 77)."""
        number = self._memory.checked(name, value)
        if not self._memory.counting:
            self._check_resolution(number)
        return number

    def _check_resolution(self, velocity: int) -> None:
        """Raise Fault (77) for what this resolution does not reach, on products that have such a bound."""
        fastest = self._memory.model.per_microstep
        if fastest and velocity > self._values["MS"] * fastest:
            raise Fault(E.VELOCITY_TOO_HIGH)

    def _write_ts(self, value: Value) -> None:
        number = self._memory.checked("TS", value)
        self._check_resolution(number)
        self._motor.torque.set_speed(number)

    def _write_ms(self, value: Value) -> None:
        """A, D, VI and VM keep their ratio to the full step (manual 5.1.85), as far as their ranges let them."""
        memory, values, number = self._memory, self._values, self._memory.checked("MS", value)
        if memory.counting and not memory.model.free_ms and number != values["MS"]:
            raise Fault(E.OUT_OF_RANGE)
        if memory.counting:
            self._check_ratio({"MS": number})
        if values.get("AS") and number < LEAST_MS:
            raise Fault(E.OUT_OF_RANGE)
        self._keep_ratio(memory.steps, number / values["MS"])
        self._motor.axis.rescale(lambda: values.update(MS=number), self._timeline.now)
        self._timeline.replan()

    def _keep_ratio(self, steps: dict[str, Value], ratio: float) -> None:
        """Scale A, D, VI and VM in steps, also while an LMM counts and they are not in force."""
        words = self._memory.words
        for name in BANKED:
            steps[name] = int(steps[name] * ratio + 0.5)
        for name in BANKED:
            low, high = words[name].bounds()
            steps[name] = min(max(steps[name], low or 0), high or inf)
        steps["VI"] = min(steps["VI"], (words["VM"].high or inf) - 1)
        steps["VM"] = max(steps["VM"], steps["VI"] + 1)

    def _check_ratio(self, changed: Mapping[str, Value]) -> None:
        """Check that microsteps are fine enough for the encoder, two for a count (manual 5.1.38). Raises Fault (36).

        A product whose MS is locked at its finest while it counts is always fine enough.
        """
        new = {**self._values, **changed}
        if self._memory.model.free_ms and new["MS"] * round(360 / new["SA"]) < new["EL"] * 8:
            raise Fault(E.ENCODER_RATIO)

    def _write_geometry(self, name: str, value: Value) -> None:
        """EL and SA: what a step and a count are, which are not changed on the move."""
        row = self._memory.row(name)
        number = value if name == "SA" else whole(value)
        if row is None or not row.accepts(number) or self._moving():
            raise Fault(E.OUT_OF_RANGE)
        if self._values.get("EE"):
            self._check_ratio({name: number})
        self._motor.axis.rescale(lambda: self._memory.write(row, value), self._timeline.now)
        self._timeline.replan()

    def _write_rd(self, value: Value) -> None:
        number = self._memory.checked("RD", value)
        if self._moving():
            raise Fault(E.DIRECTION_WHILE_MOVING)
        self._values["RD"] = number
        self._motor.axis.orient(self._timeline.now)

    def _moving(self) -> bool:
        return self._motor.status.moving(self._timeline.now)

    # The encoder and hMT.

    def _write_ee(self, value: Value) -> None:
        """Change between steps and counts: on an LMD MS is 256 meanwhile (manual 7.3.7), and then what it was."""
        number, t = self._memory.checked("EE", value), self._timeline.now
        if number and not self._values["EE"]:
            self._check_ratio({})
            self._check_speeds()
        self._motor.limit_stop.relocate(lambda: self._motor.axis.switch_unit("EE", number, t), t)
        self._timeline.replan()

    def _check_speeds(self) -> None:
        """Check that VI is a count or more, on a product that has a code for less (5-21, 9). Raises Fault (90)."""
        values, model = self._values, self._memory.model
        slowest = values["VI"] * model.encoder_lines * 4
        if model.per_microstep is None and slowest < self._memory.steps_per_turn:
            raise Fault(E.VELOCITY_TOO_LOW)

    def _write_encoder(self, name: str, value: Value) -> None:
        """DB, PM, SF: a rotor that is out of place already is brought back, or stalls."""
        row = self._memory.row(name)
        if row is not None:
            self._memory.write(row, value)
        self._timeline.replan()
        self._motor.encoder.look(self._timeline.now)

    def _write_st(self, value: Value) -> None:
        """The flag that the drive sets; a user clears it, and sets it where it may be written."""
        self._values["ST"] = self._memory.flag("ST", value)
        self._motor.encoder.clear()
        self._timeline.replan()

    def _write_as(self, value: Value) -> None:
        number = self._memory.checked("AS", value)
        if number and self._memory.steps["MS"] < LEAST_MS:
            raise Fault(E.OUT_OF_RANGE)
        self._motor.hmt.set_mode(number, self._timeline.now)
        self._motor.hmt.tune()

    def _write_mf(self, value: Value) -> None:
        """Up to VM, in steps/s whatever the unit of motion is now."""
        row, number = self._memory.row("MF"), whole(value)
        if row is None or not row.accepts(number) or number > self._memory.steps["VM"]:
            raise Fault(E.MAKE_UP_FREQUENCY)
        self._values["MF"] = number

    # Counters and delays.

    def _write_counter(self, name: str, value: Value) -> None:
        motor, t, number = self._motor, self._timeline.now, self._memory.checked(name, value)
        counter = motor.counters.source if name == "P" else name
        motor.limit_stop.relocate(lambda: motor.axis.set_counter(counter, number, t), t)
        self._timeline.replan()

    def _write_delay(self, other: str, name: str, value: Value) -> None:
        """HT or MT, which together may not be more than 65535 (manual 5.1.86)."""
        number = self._memory.checked(name, value)
        if number + self._values[other] > MOST_DELAY:
            raise Fault(E.OUT_OF_RANGE)
        self._values[name] = number
        self._timeline.replan()
