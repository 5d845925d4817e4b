"""The ASCII commands of the simulated PMX-2ED-SA (manual 9): tables of words, what they read and what they do.

A command is a word, an axis or an index, and maybe `=` and a value. `REGISTERS` has the values that are only kept and
given back; the tables below have the rest. The reply to any other text is `?` and the text itself (table 9.1).
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from decimal import ROUND_HALF_UP, Decimal

from multidrop.simulator.pmx import motions
from multidrop.simulator.pmx.axis import Axis
from multidrop.simulator.pmx.controller import PmxController
from multidrop.simulator.pmx.settings import AXES, INT32, REGISTERS, SCALE, Refusal

MODEL = "2ED"
OK, MOVING, INVALID, INDEX = "OK", "?Moving", "?Invalid Answer", "?Index out of Range"
_INTEGER = re.compile(r"[+-]?\d{1,10}", re.ASCII)
_RATIO = re.compile(r"\d{1,3}(\.\d+)?", re.ASCII)
_INDEXED = re.compile(r"([A-Z]{1,2})(\d{1,6})", re.ASCII)


# -- words of the whole controller --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Word:
    """A word without axis: what it reads, what it sets, what it does."""

    get: Callable[[PmxController, float], object] | None = None
    set: Callable[[PmxController, str, float], None] | None = None
    do: Callable[[PmxController, float], None] | None = None


@dataclass(frozen=True)
class AxisWord:
    """A word with an axis, `PX`."""

    get: Callable[[PmxController, Axis, float], object] | None = None
    set: Callable[[PmxController, Axis, str, float], None] | None = None
    do: Callable[[PmxController, Axis, float], None] | None = None


@dataclass(frozen=True)
class BitWord:
    """A word with an index from 1 on, `DO3`: how many there are, what it reads and what it sets."""

    count: int
    get: Callable[[PmxController, int, float], object]
    set: Callable[[PmxController, int, int, float], None] | None = None


def number(text: str, low: int = -INT32, high: int = INT32 - 1, error: str = INVALID) -> int:
    """Read a whole number in a range. Raises Refusal."""
    if not _INTEGER.fullmatch(text) or not low <= int(text) <= high:
        raise Refusal(error)
    return int(text)


def _pair(read: Callable[[PmxController, Axis, float], int]) -> Callable[[PmxController, float], str]:
    return lambda pmx, t: ":".join(str(read(pmx, axis, t)) for axis in pmx.axes)


def _each(do: Callable[[PmxController, Axis, float], None]) -> Callable[[PmxController, float], None]:
    def all_of_them(pmx: PmxController, t: float) -> None:
        for axis in pmx.axes:
            do(pmx, axis, t)

    return all_of_them


def _status(pmx: PmxController, axis: Axis, t: float) -> int:
    return pmx.status(axis, t)


def _speed(pmx: PmxController, axis: Axis, t: float) -> int:
    return axis.speed(t)


def _stop(pmx: PmxController, axis: Axis, t: float) -> None:
    pmx.stop(axis, t)


def _abort(pmx: PmxController, axis: Axis, t: float) -> None:
    pmx.abort(axis, t)


def _clear(pmx: PmxController, axis: Axis, t: float) -> None:
    pmx.clear(axis, t)


def _set_name(pmx: PmxController, text: str, t: float) -> None:
    if not re.fullmatch(MODEL + r"\d\d", text, re.ASCII):
        raise Refusal(INVALID)
    pmx.settings.wanted = text[-2:]


def _set_mode(incremental: bool) -> Callable[[PmxController, float], None]:
    def do(pmx: PmxController, t: float) -> None:
        pmx.incremental = incremental

    return do


def _set_outputs(pmx: PmxController, text: str, t: float) -> None:
    pmx.outputs = number(text, 0, 255)


def _set_enabled(pmx: PmxController, text: str, t: float) -> None:
    pmx.enabled = number(text, 0, 3)


def _set_sticks(pmx: PmxController, text: str, t: float) -> None:
    _steer(pmx, number(text, 0, 3), t)


def _steer(pmx: PmxController, mask: int, t: float) -> None:
    added = mask & ~pmx.settings["JO"]
    if any(axis.pulses.moving(t) for n, axis in enumerate(pmx.axes) if added >> n & 1):
        raise Refusal(MOVING)
    pmx.set_joystick(mask, t)


WORDS: dict[str, Word] = {
    "ABORT": Word(do=_each(_abort)),
    "ABS": Word(do=_set_mode(False)),
    "CLR": Word(do=_each(_clear)),
    "CLRS": Word(do=_each(_clear)),
    "DI": Word(get=lambda pmx, t: pmx.inputs(t)),
    "DN": Word(get=lambda pmx, t: MODEL + pmx.settings.wanted, set=_set_name),
    "DO": Word(get=lambda pmx, t: pmx.outputs, set=_set_outputs),
    "EO": Word(get=lambda pmx, t: pmx.enabled, set=_set_enabled),
    "ID": Word(get=lambda pmx, t: pmx.product),
    "INC": Word(do=_set_mode(True)),
    "JF": Word(do=lambda pmx, t: _steer(pmx, 0, t)),
    "JO": Word(do=lambda pmx, t: _steer(pmx, 3, t), set=_set_sticks),
    "JOYENA": Word(set=_set_sticks),
    "MM": Word(get=lambda pmx, t: int(pmx.incremental)),
    "MST": Word(get=_pair(_status)),
    "PS": Word(get=_pair(_speed)),
    "STOP": Word(do=_each(_stop)),
    "STORE": Word(do=lambda pmx, t: pmx.settings.store()),
    "VER": Word(get=lambda pmx, t: pmx.version),
}

_DELTA = AxisWord(get=lambda pmx, axis, t: round(axis.loop.delta(t)))

AXIS_WORDS: dict[str, AxisWord] = {
    "ABORT": AxisWord(do=_abort),
    "CLR": AxisWord(do=_clear),
    "CLRS": AxisWord(do=_clear),
    "D": _DELTA,
    "DX": _DELTA,
    "E": AxisWord(
        get=lambda pmx, axis, t: axis.encoder(t),
        set=lambda pmx, axis, text, t: axis.set_encoder(number(text), t),
    ),
    "MST": AxisWord(get=_status),
    "P": AxisWord(
        get=lambda pmx, axis, t: axis.position(t),
        set=lambda pmx, axis, text, t: axis.set_position(number(text), t),
    ),
    "PS": AxisWord(get=_speed),
    "SLS": AxisWord(get=lambda pmx, axis, t: axis.loop.status),
    "SSPD": AxisWord(set=lambda pmx, axis, text, t: motions.respeed(axis, number(text), t)),
    "STOP": AxisWord(do=_stop),
}


def _set_output(pmx: PmxController, bit: int, value: int, t: float) -> None:
    pmx.outputs = pmx.outputs & ~(1 << bit) | value << bit


def _set_driver(pmx: PmxController, bit: int, value: int, t: float) -> None:
    pmx.enabled = pmx.enabled & ~(1 << bit) | value << bit


BIT_WORDS: dict[str, BitWord] = {
    "AI": BitWord(2, lambda pmx, n, t: pmx.analog(n + 1, t)),
    "DI": BitWord(8, lambda pmx, n, t: pmx.inputs(t) >> n & 1),
    "DO": BitWord(8, lambda pmx, n, t: pmx.outputs >> n & 1, _set_output),
    "EO": BitWord(2, lambda pmx, n, t: pmx.enabled >> n & 1, _set_driver),
}


# -- registers ----------------------------------------------------------------------------------------------------


def get_register(pmx: PmxController, name: str) -> str:
    """Give a register as the reply words it."""
    value = pmx.settings[name]
    return f"{value / SCALE:.3f}" if name[:-1] == "SLR" else str(value)


def _thousandths(text: str) -> str:
    """Convert a ratio to thousandths: clients send more decimals (`%f`). Empty for an invalid ratio."""
    if not _RATIO.fullmatch(text):
        return ""
    return str(int((Decimal(text) * SCALE).to_integral_value(ROUND_HALF_UP)))


def set_register(pmx: PmxController, name: str, text: str, t: float) -> None:
    """Set a register. Raises Refusal."""
    register = REGISTERS[name]
    error = "?Low speed out of range" if name.startswith("LSPD") else INVALID
    if name[:-1] == "SLR":
        text = _thousandths(text)
    value = number(text, error=INVALID)
    if not register.low <= value <= register.high:
        raise Refusal(error)
    axis = pmx.axis(name[-1]) if name[-1] in AXES else None
    if register.idle and axis is not None and (axis.pulses.moving(t) or axis.homing):
        raise Refusal(MOVING)
    before = pmx.settings[name]
    pmx.settings[name] = value
    try:
        _apply(pmx, name, axis, t)
    except Refusal:
        pmx.settings[name] = before
        raise


def _apply(pmx: PmxController, name: str, axis: Axis | None, t: float) -> None:
    """Apply what follows from a register at once."""
    if name == "TOC":
        pmx.heard(t)
    elif axis is not None and name[:-1] == "SL":
        if axis["SL"] and pmx.settings["JO"] >> AXES.index(axis.name) & 1:
            raise Refusal
        axis.loop.enable(bool(axis["SL"]), t)
    elif axis is not None and name[:-1] == "SLR":
        axis.loop.rebase(t)


# -- forms --------------------------------------------------------------------------------------------------------


def _direction(sign: str) -> float:
    return 1.0 if sign == "+" else -1.0


def _home(pmx: PmxController, t: float, word: str, axis: str, sign: str) -> None:
    motions.home(pmx.axis(axis), word, _direction(sign), t)


def _jog(pmx: PmxController, t: float, axis: str, sign: str) -> None:
    motions.jog(pmx.axis(axis), _direction(sign), t)


def _jog_both(pmx: PmxController, t: float, sign: str) -> None:
    for axis in pmx.axes:
        motions.check(axis, t)
        motions.check_pace(axis)
    for axis in pmx.axes:
        motions.jog(axis, _direction(sign), t)


def _move(pmx: PmxController, t: float, axis: str, target: str) -> None:
    pmx.go(pmx.axis(axis), number(target), t)


def _move_both(pmx: PmxController, t: float, x: str, y: str) -> None:
    pmx.go_both((number(x), number(y)), t)


def _retarget(pmx: PmxController, t: float, axis: str, target: str) -> None:
    motions.retarget(pmx.axis(axis), number(target), t)


_NUMBER = r"([+-]?\d{1,10})"
_FORMS: tuple[tuple[re.Pattern[str], Callable[..., None]], ...] = tuple(
    (re.compile(pattern, re.ASCII), run)
    for pattern, run in (
        (rf"([XY]){_NUMBER}", _move),
        (rf"X{_NUMBER}Y{_NUMBER}", _move_both),
        (rf"I{_NUMBER}: ?{_NUMBER}", _move_both),
        (rf"T([XY]){_NUMBER}", _retarget),
        (r"J([+-])", _jog_both),
        (r"J([XY])([+-])", _jog),
        (r"(HL|H|L|ZH|Z)([XY])([+-])", _home),
    )
)
"""Commands that are no word with a value; a function takes controller, time and the groups. Raises Refusal."""


# -- the path of a command ----------------------------------------------------------------------------------------


def answer(pmx: PmxController, text: str, t: float) -> str:
    """Carry out a command that is not about programs; give its reply."""
    try:
        reply = _answer(pmx, text, t)
    except Refusal as refusal:
        reply = str(refusal) or None
    return f"?{text}" if reply is None else reply


def _answer(pmx: PmxController, text: str, t: float) -> str | None:
    head, sign, value = text.partition("=")
    given = value if sign else None
    if head in WORDS:
        word = WORDS[head]
        return _use(
            given,
            word.get and (lambda: word.get(pmx, t)),
            word.set and (lambda: word.set(pmx, value, t)),
            word.do and (lambda: word.do(pmx, t)),
        )
    if head in REGISTERS and head != "JO":
        return _use(given, lambda: get_register(pmx, head), lambda: set_register(pmx, head, value, t), None)
    if head[:-1] in AXIS_WORDS and head[-1] in AXES:
        each, axis = AXIS_WORDS[head[:-1]], pmx.axis(head[-1])
        return _use(
            given,
            each.get and (lambda: each.get(pmx, axis, t)),
            each.set and (lambda: each.set(pmx, axis, value, t)),
            each.do and (lambda: each.do(pmx, axis, t)),
        )
    indexed = _INDEXED.fullmatch(head)
    if indexed and indexed[1] in (*BIT_WORDS, "JL", "JV"):
        return _answer_bit(pmx, indexed[1], int(indexed[2]), given, t)
    for pattern, run in _FORMS:
        if found := pattern.fullmatch(text):
            run(pmx, t, *found.groups())
            return OK
    return None


def _use(
    value: str | None,
    get: Callable[[], object] | None,
    put: Callable[[], None] | None,
    do: Callable[[], None] | None,
) -> str | None:
    """Read, set or execute a word; None if the word has no such use."""
    if value is not None:
        if put is None:
            return None
        put()
        return OK
    if do is not None:
        do()
        return OK
    return None if get is None else str(get())


def _answer_bit(pmx: PmxController, name: str, index: int, value: str | None, t: float) -> str | None:
    if name in ("JL", "JV"):
        raise Refusal(INDEX)
    word = BIT_WORDS.get(name)
    if word is None or (name == "EO" and not 1 <= index <= word.count):
        return None  # a third driver belongs to a larger model, and is not an index
    if not 1 <= index <= word.count:
        raise Refusal(INDEX)
    if value is None:
        return str(word.get(pmx, index - 1, t))
    if word.set is None:
        return None
    word.set(pmx, index - 1, number(value, 0, 1), t)
    return OK


class CommandedController:
    """A controller as its stored programs use it: see `programs.Controller`."""

    def __init__(self, controller: PmxController) -> None:
        self._controller = controller

    @property
    def deadline(self) -> float | None:
        """Time of the controller's next event."""
        return self._controller.deadline

    def settle(self, now: float) -> None:
        """Let the controller live up to `now`."""
        self._controller.settle(now)

    def ask(self, text: str, now: float) -> str:
        """Carry out one ASCII command that is not about programs; give its reply without CR."""
        reply = answer(self._controller, text, now)
        self._controller.look(now)
        return reply

    def moving(self, axis: str) -> bool:
        """Whether an axis moves: pulses, a homing that goes on, a correction."""
        each = self._controller.axis(axis)
        return each.pulses.moving(self._controller.now) or each.homing is not None

    def troubled(self, axis: str) -> bool:
        """Whether a limit error or a StepNLoop error is latched."""
        each = self._controller.axis(axis)
        return bool(each.trouble or each.loop.error)
