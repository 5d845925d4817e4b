"""What each variable and flag of a simulated drive reads and writes.

A plain one is a number in memory with the range that the table of mnemonics gives it. The others have a reader or a
writer here. Compiled lines get closures from `reader` and `writer`; these raise Fault with the manual's codes:
20 unknown, 21 wrong value, 25 read only, 30 not there, 32 a label, 35 cannot be read, 37 not in this drive.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache, partial
from math import inf
from typing import TYPE_CHECKING

import simulator.lexium.motion.reactions as reactions
from dialects.mcode.manual.grammar import Argument, Compare, Text
from dialects.mcode.manual.table import Mnemonic, lookup
from simulator.lexium.motion.trips import BITS
from simulator.lexium.state.errors import Fault
from simulator.lexium.state.expressions import ILLEGAL, PI, Read, Value, compile_value, compile_whole, whole
from simulator.lexium.state.memory import BANKED, slot

if TYPE_CHECKING:
    from simulator.lexium.device import MCodeDevice

Write = Callable[[Value], None]

UNKNOWN, WRONG, READ_ONLY, ABSENT, IS_LABEL, UNREADABLE, NOT_HERE = 20, 21, 25, 30, 32, 35, 37
VI_NOT_BELOW, VM_NOT_ABOVE, RATIO, LOCKED, BAD_BAUD, MAKE_UP, MODE_MOVING, TURN_MOVING = 22, 23, 36, 44, 61, 76, 87, 95
TOO_FAST, TOO_LOW = 77, 90
LEAST_MS = 10
"""With hMT (manual 5.1.6)."""
POINTS = (1, 2, 3, 4, 9, 10, 11, 12)
"""Inputs and outputs that bear a word each."""
WATCHED = ("HC", "LD", "LG", "LT", "RC", "SM", "TD", "TQ", "WT")
"""Variables on which hangs what happens next."""
CLOCK_TYPE = 11
"""The error of FL without clock inputs."""


def row_of(device: MCodeDevice, word: str) -> Mnemonic | None:
    """The table's row of a word that this product knows; None where it is a free name. Raises Fault (37)."""
    return _row_of(word, device.product)


@lru_cache(maxsize=4096)
def _row_of(word: str, product: str) -> Mnemonic | None:
    row = lookup(word, product)
    if row is not None and product not in row.products:
        raise Fault(NOT_HERE)
    return row


def reader(device: MCodeDevice, word: str) -> Read:
    """A closure that gives a variable's value."""
    row = row_of(device, word)
    special = READERS.get(word)
    if row is not None and special is not None:
        return partial(special, device)
    values, key = device.memory.values, word if row else slot(word)
    if row is not None and row.kind == "reserved":
        raise Fault(ILLEGAL)
    if row is not None and (word not in values or row.access == "WO"):
        raise Fault(UNREADABLE)

    def read() -> Value:
        try:
            return values[key]
        except KeyError:
            raise Fault(ABSENT) from None

    return read


def writer(device: MCodeDevice, word: str) -> Write:
    """A closure that gives a variable a value, or raises Fault."""
    row = row_of(device, word)
    if row is None:
        return _user_writer(device, word)
    if word in WRITERS:
        return partial(WRITERS[word], device)
    if row.access in ("RO", "RC") or row.kind in ("keyword", "math"):
        raise Fault(READ_ONLY)
    if word not in device.memory.values:
        raise Fault(UNKNOWN)
    if row.low_encoder is not None or row.values:
        return partial(_write_checked, device, row)
    return _plain_writer(device, row)


def _user_writer(device: MCodeDevice, word: str) -> Write:
    memory, key = device.memory, slot(word)
    if word in device.program.labels:
        raise Fault(IS_LABEL)
    if word not in memory.scopes and word not in device.program.declared:
        raise Fault(UNKNOWN)

    def write(value: Value) -> None:
        if key not in memory.values:
            raise Fault(UNKNOWN)
        memory.values[key] = _within(whole(value), -0x80000000, 0x7FFFFFFF)

    return write


def _plain_writer(device: MCodeDevice, row: Mnemonic) -> Write:
    values, name = device.memory.values, row.name
    low, high = row.low or 0, row.high or 0
    if isinstance(row.default, float):

        def write_float(value: Value) -> None:
            values[name] = float(_within(value, low, high))

        return write_float

    def write(value: Value) -> None:
        if not isinstance(value, int):
            value = whole(value)
        if not low <= value <= high:
            raise Fault(WRONG)
        values[name] = value

    return write


def _within(value: Value, low: Value, high: Value) -> Value:
    if not low <= value <= high:
        raise Fault(WRONG)
    return value


def _write_checked(device: MCodeDevice, row: Mnemonic, value: Value) -> None:
    """One whose range hangs on EE, or that takes certain numbers only."""
    if not isinstance(row.default, float):
        value = whole(value)
    if not row.accepts(value, device.memory.counting):
        raise Fault(WRONG)
    device.memory.values[row.name] = value


def _checked(device: MCodeDevice, name: str, value: Value) -> int:
    """A whole number in the table's range. Raises Fault (21, 37)."""
    row = row_of(device, name)
    number = whole(value)
    if row is None or not row.accepts(number, device.memory.counting):
        raise Fault(WRONG)
    return number


def _write_vi(device: MCodeDevice, value: Value) -> None:
    values, number = device.memory.values, _checked(device, "VI", value)
    if not device.memory.counting:
        _slow_enough(device, number)
    if number >= values["VM"]:
        raise Fault(VI_NOT_BELOW)
    values["VI"] = number


def _write_vm(device: MCodeDevice, value: Value) -> None:
    values, number = device.memory.values, _checked(device, "VM", value)
    if not device.memory.counting:
        _slow_enough(device, number)
    if number <= values["VI"]:
        raise Fault(VM_NOT_ABOVE)
    values["VM"] = number


def _slow_enough(device: MCodeDevice, velocity: int) -> None:
    """Raises Fault (77) for what this resolution does not reach, on products that have such a bound."""
    fastest = device.model.per_microstep
    if fastest and velocity > device.memory.values["MS"] * fastest:
        raise Fault(TOO_FAST)


def _write_ts(device: MCodeDevice, value: Value) -> None:
    _slow_enough(device, _checked(device, "TS", value))
    _write_watched("TS", device, value)


def _write_ms(device: MCodeDevice, value: Value) -> None:
    """A, D, VI and VM keep their ratio to the full step (manual 5.1.85), as far as their ranges let them."""
    values, number = device.memory.values, _checked(device, "MS", value)
    if device.memory.counting and not device.model.free_ms and number != values["MS"]:
        raise Fault(WRONG)
    if device.memory.counting:
        _check_ratio(device, {"MS": number})
    if values.get("AS") and number < LEAST_MS:
        raise Fault(WRONG)
    _keep_ratio(device, device.memory.bank if device.memory.counting else values, number / values["MS"])
    device.axis.rescale(device.now)
    values["MS"] = number
    device.axis.orient(device.now)
    device.stale = True


def _keep_ratio(device: MCodeDevice, steps: dict[str, Value], ratio: float) -> None:
    """A, D, VI and VM in steps, also while an LMM counts and they are not in force."""
    for name in BANKED:
        steps[name] = int(steps[name] * ratio + 0.5)
    for name in BANKED:
        low, high = device.memory.words[name].bounds()
        steps[name] = min(max(steps[name], low or 0), high or inf)
    steps["VI"] = min(steps["VI"], (device.memory.words["VM"].high or inf) - 1)
    steps["VM"] = max(steps["VM"], steps["VI"] + 1)


def _check_ratio(device: MCodeDevice, changed: Mapping[str, Value]) -> None:
    """Whether microsteps would be fine enough for the encoder, two for a count (manual 5.1.38). Raises Fault (36).

    A product whose MS is locked at its finest while it counts is always fine enough.
    """
    new = {**device.memory.values, **changed}
    if device.model.free_ms and new["MS"] * round(360 / new["SA"]) < new["EL"] * 8:
        raise Fault(RATIO)


def _check_speeds(device: MCodeDevice) -> None:
    """Whether VI and VM are a count or more, on a product that has a code for less (5-21, 9). Raises Fault (90)."""
    values = device.memory.values
    if (
        device.model.per_microstep is None
        and values["VI"] * device.model.encoder_lines * 4 < device.axis.steps_per_turn
    ):
        raise Fault(TOO_LOW)


def _write_ee(device: MCodeDevice, value: Value) -> None:
    """Between steps and counts: on an LMD MS is 256 meanwhile (manual 7.3.7), and then what it was."""
    number = _checked(device, "EE", value)
    if number and not device.memory.values["EE"]:
        _check_ratio(device, {})
        _check_speeds(device)
    device.motor.limits.jump(device.now, lambda: device.axis.switch("EE", number, device.now))
    device.stale = True


def _write_delay(other: str, name: str, device: MCodeDevice, value: Value) -> None:
    """HT or MT, which together may not be more than 65535 (manual 5.1.86)."""
    number = _checked(device, name, value)
    if number + device.memory.values[other] > 65535:
        raise Fault(WRONG)
    device.memory.values[name] = number
    device.stale = True


def _write_counter(name: str, device: MCodeDevice, value: Value) -> None:
    number = _checked(device, name, value)
    if name == "P":
        name = device.axis.source
    device.motor.limits.jump(device.now, lambda: device.axis.set_counter(name, number, device.now))
    device.stale = True


def _write_er(device: MCodeDevice, value: Value) -> None:
    """Only 0 clears; programs also set a code of their own."""
    number = _checked(device, "ER", value)
    device.memory.values["ER"], device.memory.values["EF"] = number, int(number != 0)


def _write_clearing(name: str, device: MCodeDevice, value: Value) -> None:
    """A flag that the drive sets; a user clears it, and sets it where it may be written."""
    row, number = row_of(device, name), whole(value)
    if number != 0 and (row is None or row.access != "RW" or not row.accepts(number)):
        raise Fault(WRONG)
    device.memory.values[name] = number
    if name == "IF":
        device.pending = ""
    else:
        device.motor.encoder.clear()
        device.stale = True


def _write_mf(device: MCodeDevice, value: Value) -> None:
    """Up to VM, in steps/s whatever the unit of motion is now."""
    row, number, memory = row_of(device, "MF"), whole(value), device.memory
    if row is None or not row.accepts(number) or number > (memory.bank if memory.counting else memory.values)["VM"]:
        raise Fault(MAKE_UP)
    memory.values["MF"] = number


def _write_lk(device: MCodeDevice, value: Value) -> None:
    """A lock that has been saved is opened by CP or FD only (manual 5.1.75)."""
    number = _checked(device, "LK", value)
    if not number and device.memory.values["LK"] and device.nvm.values.get("LK"):
        raise Fault(LOCKED)
    device.memory.values["LK"] = number


def _write_bd(device: MCodeDevice, value: Value) -> None:
    row = row_of(device, "BD")
    if row is None or not row.accepts(whole(value)):
        raise Fault(BAD_BAUD)
    device.memory.values["BD"] = whole(value)


def _write_still(name: str, code: int, device: MCodeDevice, value: Value) -> None:
    """One that may not be changed while moving."""
    number = _checked(device, name, value)
    if device.axis.moving(device.now):
        raise Fault(code)
    device.memory.values[name] = number
    device.axis.orient(device.now)


def _write_as(device: MCodeDevice, value: Value) -> None:
    number, memory = _checked(device, "AS", value), device.memory
    if number and (memory.bank if memory.counting else memory.values)["MS"] < LEAST_MS:
        raise Fault(WRONG)
    device.motor.hmt.set_mode(number, device.now)
    device.motor.tune()


def _write_watched(name: str, device: MCodeDevice, value: Value) -> None:
    """One that may change what happens next."""
    row = row_of(device, name)
    if row is not None:
        _write_checked(device, row, value)
    device.stale = True


def _write_encoder(name: str, device: MCodeDevice, value: Value) -> None:
    """DB, PM, SF: a rotor that is out of place already is brought back, or stalls."""
    _write_watched(name, device, value)
    device.motor.encoder.look(device.now)


def _write_geometry(name: str, device: MCodeDevice, value: Value) -> None:
    """EL and SA: what a step and a count are, which are not changed on the move."""
    row, values = row_of(device, name), device.memory.values
    number = value if name == "SA" else whole(value)
    if row is None or not row.accepts(number) or device.axis.moving(device.now):
        raise Fault(WRONG)
    if values.get("EE"):
        _check_ratio(device, {name: number})
    device.axis.rescale(device.now)
    _write_watched(name, device, value)
    device.axis.orient(device.now)


def _write_output(n: int, device: MCodeDevice, value: Value) -> None:
    device.output_lines.write(n, _checked(device, f"O{n}", value))


def _write_outputs(word: str, device: MCodeDevice, value: Value) -> None:
    """OT, OL, OH. A Lexium's outputs are one group."""
    number, points = _checked(device, word, value), device.model.points
    low = points.low if points.shared else points.outputs
    device.output_lines.write_all(number, {"OT": (*low, *points.high), "OL": low, "OH": points.high}[word])


def _write_te(device: MCodeDevice, value: Value) -> None:
    device.trips.arm(_checked(device, "TE", value), device.now)


def _write_fl(device: MCodeDevice, value: Value) -> None:
    """Following wants inputs 3 and 4 to be a clock; they are so together (manual 5.1.46)."""
    number = _checked(device, "FL", value)
    points = device.model.points
    if number and device.inputs.types[points.clocks[0]][0] not in points.clock_types:
        raise Fault(CLOCK_TYPE)
    device.memory.values["FL"] = number
    device.stale = True


def _write_je(device: MCodeDevice, value: Value) -> None:
    """A jog input that is active already counts; what keeps it from turning is no matter of the flag."""
    device.memory.values["JE"] = _checked(device, "JE", value)
    reactions.try_jog(device)


def _write_filter(n: int, device: MCodeDevice, value: Value) -> None:
    device.memory.values[f"D{n}"] = _checked(device, f"D{n}", value)
    device.stale = True


WRITERS: Mapping[str, Callable[[MCodeDevice, Value], None]] = {
    "VI": _write_vi,
    "VM": _write_vm,
    "MS": _write_ms,
    "EE": _write_ee,
    "HT": partial(_write_delay, "MT", "HT"),
    "MT": partial(_write_delay, "HT", "MT"),
    "P": partial(_write_counter, "P"),
    "C1": partial(_write_counter, "C1"),
    "C2": partial(_write_counter, "C2"),
    "ER": _write_er,
    "IF": partial(_write_clearing, "IF"),
    "ST": partial(_write_clearing, "ST"),
    "BD": _write_bd,
    "LK": _write_lk,
    "MF": _write_mf,
    "TS": _write_ts,
    "AS": _write_as,
    "CB": lambda device, value: device.motor.hmt.set_bounds(_checked(device, "CB", value)),
    "DE": lambda device, value: device.motor.enable(_checked(device, "DE", value), device.now),
    "EL": partial(_write_geometry, "EL"),
    "SA": partial(_write_geometry, "SA"),
    **{name: partial(_write_watched, name) for name in WATCHED},
    **{name: partial(_write_encoder, name) for name in ("DB", "PM", "SF")},
    "RD": partial(_write_still, "RD", TURN_MOVING),
    "TE": _write_te,
    "JE": _write_je,
    "FL": _write_fl,
    "CM": partial(_write_watched, "CM"),
    **{name: partial(_write_outputs, name) for name in ("OT", "OL", "OH")},
    **{f"O{n}": partial(_write_output, n) for n in POINTS},
    **{f"D{n}": partial(_write_filter, n) for n in POINTS},
}


def _read_trip(word: str, device: MCodeDevice) -> Value:
    """The first number of a trip's set-up, 0 for none."""
    trip = device.trips.defined.get(BITS[word])
    return trip.value if trip else 0


def _unreadable(device: MCodeDevice) -> Value:
    raise Fault(UNREADABLE)


READERS: Mapping[str, Callable[[MCodeDevice], Value]] = {
    **{word: partial(_read_trip, word) for word in ("TI", "TP", "TT", "TR", "TA")},
    "LS": _unreadable,
    "PI": lambda device: PI,
    "P": lambda device: device.axis.counter(device.axis.source, device.now),
    "C1": lambda device: device.axis.counter("C1", device.now),
    "C2": lambda device: device.axis.counter("C2", device.now),
    "V": lambda device: device.axis.speed(device.now),
    "AV": lambda device: device.axis.rotor_speed(device.now),
    "AF": lambda device: device.motor.hmt.status(device.now),
    "CB": lambda device: device.motor.hmt.bounds,
    "LL": lambda device: device.motor.hmt.lag(device.now),
    "MV": lambda device: int(device.axis.reported(device.now)),
    "MP": lambda device: int(device.axis.positioning(device.now)),
    "VC": lambda device: int(device.axis.changing(device.now)),
    "BY": lambda device: int(device.interpreter.running),
    "IN": lambda device: device.inputs.levels((*device.model.points.low, *device.model.points.high)),
    "IL": lambda device: device.inputs.levels(device.model.points.low),
    "IH": lambda device: device.inputs.levels(device.model.points.high),
    "I5": lambda device: device.inputs.analog(device.now),
    "I6": lambda device: int(device.axis.at_index(device.now)),
    **{f"I{n}": partial(lambda n, device: int(device.inputs.active(n)), n) for n in POINTS},
    "IT": lambda device: round(device.motor.heat.bridge(device.now)),
}


def value_of(device: MCodeDevice, argument: Argument | None, floating: bool = False) -> Read:
    """A closure that gives an argument's value. Raises Fault (21, 24) for what has none."""
    if isinstance(argument, Text):
        raise Fault(WRONG)
    if argument is None or isinstance(argument, Compare):
        raise Fault(ILLEGAL)
    if not device.model.floating:
        return compile_whole(argument, lambda word: reader(device, word))
    return compile_value(argument, lambda word: reader(device, word), floating)
