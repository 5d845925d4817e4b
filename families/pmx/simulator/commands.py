"""The ASCII commands of the simulated PMX-2ED-SA (manual 9): tables of words, what they read and what they do.

A command is a word, an axis or an index, and maybe `=` and a value. `REGISTERS` has the values that are only kept and
given back; the tables below have the rest. The reply to any other text is `?` and the text itself (table 9.1).
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from decimal import ROUND_HALF_UP, Decimal

from multidrop.families.pmx.simulator import motions
from multidrop.families.pmx.simulator.axis import PmxAxis
from multidrop.families.pmx.simulator.controller import PmxController
from multidrop.families.pmx.simulator.settings import AXES, INT32, REGISTERS, SCALE, PmxRefusal, wrapped

MODEL = "2ED"
OK, MOVING, INVALID, INDEX = "OK", "?Moving", "?Invalid Answer", "?Index out of Range"
_INTEGER = re.compile(r"[+-]?\d{1,10}", re.ASCII)
_RATIO = re.compile(r"\d{1,3}(\.\d+)?", re.ASCII)
_INDEXED = re.compile(r"([A-Z]{1,2})(\d{1,6})", re.ASCII)


@dataclass(frozen=True)
class PmxWord:
    """A word: what it reads, what it sets, what it does; None: it has no such use.

    All are called with the controller, in `AXIS_WORDS` with the axis too, and the time last; `set` with the text of the
    value before that.
    """

    get: Callable[..., object] | None = None
    set: Callable[..., None] | None = None
    do: Callable[..., None] | None = None


@dataclass(frozen=True)
class BitWord:
    """A word with an index from 1 on, `DO3`: how many there are, what it reads and what it sets."""

    count: int
    get: Callable[[PmxController, int, float], object]
    set: Callable[[PmxController, int, int, float], None] | None = None


def number(text: str, low: int = -INT32, high: int = INT32 - 1, error: str = INVALID) -> int:
    """Read a whole number in a range. Raises PmxRefusal."""
    if not _INTEGER.fullmatch(text) or not low <= int(text) <= high:
        raise PmxRefusal(error)
    return int(text)


def _both(read: Callable[[PmxController, PmxAxis, float], int]) -> Callable[[PmxController, float], str]:
    return lambda pmx, t: ":".join(str(read(pmx, axis, t)) for axis in pmx.axes)


def _each(do: Callable[[PmxController, PmxAxis, float], None]) -> Callable[[PmxController, float], None]:
    def all_of_them(pmx: PmxController, t: float) -> None:
        for axis in pmx.axes:
            do(pmx, axis, t)

    return all_of_them


def _speed(pmx: PmxController, axis: PmxAxis, t: float) -> int:
    return axis.speed(t)


def _delta(pmx: PmxController, axis: PmxAxis, t: float) -> int:
    return round(axis.loop.delta(t))


def _set_name(pmx: PmxController, text: str, t: float) -> None:
    if not re.fullmatch(MODEL + r"\d\d", text, re.ASCII):
        raise PmxRefusal(INVALID)
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
    if any(axis.pulses.profile.moving(t) for n, axis in enumerate(pmx.axes) if added >> n & 1):
        raise PmxRefusal(MOVING)
    pmx.set_joystick(mask, t)


WORDS: dict[str, PmxWord] = {
    "ABORT": PmxWord(do=_each(PmxController.abort)),
    "ABS": PmxWord(do=_set_mode(False)),
    "CLR": PmxWord(do=_each(PmxController.clear)),
    "CLRS": PmxWord(do=_each(PmxController.clear)),
    "DI": PmxWord(get=lambda pmx, t: pmx.inputs(t)),
    "DN": PmxWord(get=lambda pmx, t: MODEL + pmx.settings.wanted, set=_set_name),
    "DO": PmxWord(get=lambda pmx, t: pmx.outputs, set=_set_outputs),
    "EO": PmxWord(get=lambda pmx, t: pmx.enabled, set=_set_enabled),
    "ID": PmxWord(get=lambda pmx, t: pmx.product),
    "INC": PmxWord(do=_set_mode(True)),
    "JF": PmxWord(do=lambda pmx, t: _steer(pmx, 0, t)),
    "JO": PmxWord(do=lambda pmx, t: _steer(pmx, 3, t), set=_set_sticks),
    "JOYENA": PmxWord(set=_set_sticks),
    "MM": PmxWord(get=lambda pmx, t: int(pmx.incremental)),
    "MST": PmxWord(get=_both(PmxController.status)),
    "PS": PmxWord(get=_both(_speed)),
    "STOP": PmxWord(do=_each(PmxController.stop)),
    "STORE": PmxWord(do=lambda pmx, t: pmx.settings.store()),
    "VER": PmxWord(get=lambda pmx, t: pmx.version),
}

AXIS_WORDS: dict[str, PmxWord] = {
    "ABORT": PmxWord(do=PmxController.abort),
    "CLR": PmxWord(do=PmxController.clear),
    "CLRS": PmxWord(do=PmxController.clear),
    "D": PmxWord(get=_delta),
    "DX": PmxWord(get=_delta),
    "E": PmxWord(
        get=lambda pmx, axis, t: wrapped(axis.rotor.encoder(t)),
        set=lambda pmx, axis, text, t: axis.set_encoder(number(text), t),
    ),
    "MST": PmxWord(get=PmxController.status),
    "P": PmxWord(
        get=lambda pmx, axis, t: axis.position(t), set=lambda pmx, axis, text, t: axis.set_position(number(text), t)
    ),
    "PS": PmxWord(get=_speed),
    "SLS": PmxWord(get=lambda pmx, axis, t: axis.loop.status),
    "SSPD": PmxWord(set=lambda pmx, axis, text, t: motions.respeed(axis, number(text), t)),
    "STOP": PmxWord(do=PmxController.stop),
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


def set_register(pmx: PmxController, name: str, text: str, t: float) -> None:
    """Set a register, and apply at once what follows from it. Raises PmxRefusal."""
    register, kind = REGISTERS[name], name[:-1]
    if kind == "SLR":  # kept in thousandths; clients send more decimals (`%f`)
        ratio = Decimal(text) * SCALE if _RATIO.fullmatch(text) else None
        text = "" if ratio is None else str(int(ratio.to_integral_value(ROUND_HALF_UP)))
    value = number(text)
    if not register.low <= value <= register.high:
        raise PmxRefusal("?Low speed out of range" if name.startswith("LSPD") else INVALID)
    axis = pmx.axis(name[-1]) if name[-1] in AXES else None
    if register.idle and axis is not None and (axis.pulses.profile.moving(t) or axis.homing):
        raise PmxRefusal(MOVING)
    if axis is not None and kind == "SL" and value and pmx.settings["JO"] >> AXES.index(axis.name) & 1:
        raise PmxRefusal
    pmx.settings[name] = value
    if name == "TOC":
        pmx.heard(t)
    elif axis is not None and kind == "SL":
        axis.loop.enable(bool(value), t)
    elif axis is not None and kind == "SLR":
        axis.loop.rebase(t)


# -- forms --------------------------------------------------------------------------------------------------------


_NUMBER = r"([+-]?\d{1,10})"
_FORMS: tuple[tuple[re.Pattern[str], str], ...] = tuple(
    (re.compile(pattern, re.ASCII), form)
    for pattern, form in (
        (rf"([XY]){_NUMBER}", "move"),
        (rf"X{_NUMBER}Y{_NUMBER}", "line"),
        (rf"I{_NUMBER}: ?{_NUMBER}", "line"),
        (rf"T([XY]){_NUMBER}", "retarget"),
        (r"J()([+-])", "jog"),
        (r"J([XY])([+-])", "jog"),
        (r"(HL|H|L|ZH|Z)([XY])([+-])", "home"),
    )
)
"""Commands that are no word with a value."""


def _move(pmx: PmxController, form: str, given: tuple[str, ...], t: float) -> None:
    """Carry out a command of one of the forms, with what is given in it. Raises PmxRefusal."""
    *_, named, last = given
    match form:
        case "move":
            pmx.go(pmx.axis(named), number(last), t)
        case "line":
            pmx.go_both((number(named), number(last)), t)
        case "retarget":
            motions.retarget(pmx.axis(named), number(last), t)
        case "home":
            motions.home(pmx.axis(named), given[0], 1.0 if last == "+" else -1.0, t)
        case "jog":
            axes = (pmx.axis(named),) if named else pmx.axes
            for axis in axes:
                motions.check(axis, t)
                axis.own_pace()
            for axis in axes:
                motions.jog(axis, 1.0 if last == "+" else -1.0, t)


# -- the path of a command ----------------------------------------------------------------------------------------


class CommandedController(PmxController):
    """A controller that understands ASCII commands, but those about programs."""

    def ask(self, text: str, now: float) -> str:
        """Carry out one ASCII command; give its reply without CR."""
        try:
            reply = _answer(self, text, now)
        except PmxRefusal as refusal:
            reply = str(refusal) or None
        self.look(now)
        return f"?{text}" if reply is None else reply


def _answer(pmx: PmxController, text: str, t: float) -> str | None:
    head, sign, value = text.partition("=")
    given = value if sign else None
    if head in WORDS:
        return _use(WORDS[head], given, (pmx,), t)
    if head in REGISTERS and head != "JO":
        if given is None:
            return get_register(pmx, head)
        set_register(pmx, head, given, t)
        return OK
    if head[:-1] in AXIS_WORDS and head[-1] in AXES:
        return _use(AXIS_WORDS[head[:-1]], given, (pmx, pmx.axis(head[-1])), t)
    indexed = _INDEXED.fullmatch(head)
    if indexed and indexed[1] in (*BIT_WORDS, "JL", "JV"):
        return _answer_bit(pmx, indexed[1], int(indexed[2]), given, t)
    for pattern, form in _FORMS:
        if match := pattern.fullmatch(text):
            _move(pmx, form, match.groups(), t)
            return OK
    return None


def _use(word: PmxWord, value: str | None, whose: tuple[object, ...], t: float) -> str | None:
    """Read, set or execute a word; None if the word has no such use."""
    if value is not None and word.set is not None:
        word.set(*whose, value, t)
    elif value is None and word.do is not None:
        word.do(*whose, t)
    else:
        return None if value is not None or word.get is None else str(word.get(*whose, t))
    return OK


def _answer_bit(pmx: PmxController, name: str, index: int, value: str | None, t: float) -> str | None:
    if name in ("JL", "JV"):
        raise PmxRefusal(INDEX)
    word = BIT_WORDS.get(name)
    if word is None or (name == "EO" and not 1 <= index <= word.count):
        return None  # a third driver belongs to a larger model, and is not an index
    if not 1 <= index <= word.count:
        raise PmxRefusal(INDEX)
    if value is None:
        return str(word.get(pmx, index - 1, t))
    if word.set is None:
        return None
    word.set(pmx, index - 1, number(value, 0, 1), t)
    return OK
