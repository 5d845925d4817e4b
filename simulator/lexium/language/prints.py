"""What PR prints, and how: numbers, texts, and the lists of parameters, variables and set-ups.

Manual 5.1.4, 5.1.64, 5.1.93, 5.1.97, 5.1.101, 5.1.102, 5.1.119, 5.1.134, 5.1.141, 5.1.142.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING

from dialects.mcode.manual.grammar import Argument, Name, Number, Statement, Text
from dialects.mcode.manual.table import MNEMONICS
from simulator.lexium.language.interpreter import Action
from simulator.lexium.motion.trips import BITS
from simulator.lexium.state.errors import Fault
from simulator.lexium.state.expressions import FLOATS as _FLOATS
from simulator.lexium.state.expressions import Value
from simulator.lexium.state.memory import slot
from simulator.lexium.state.variables import UNREADABLE, reader, row_of

if TYPE_CHECKING:
    from simulator.lexium.device import MCodeDevice

Item = Callable[[], str]

WRONG, ILLEGAL, NOT_HERE = 21, 24, 37
CRLF = "\r\n"
FLOATS = _FLOATS - {"PI"}
VOLTS = 24
AUXILIARY_VOLTS = 12
PRINTED_INPUTS = (1, 2, 3, 4, 6)
_ESCAPES = {"b": "\b", "c": "\x03", "e": "\x1b", "g": "\a", "n": "\n", "r": "\r", "t": "\t"}


def compile_print(device: MCodeDevice, statement: Statement) -> Action:
    """PR. Raises Fault (35) for what cannot be printed."""
    items = list(_items(device, statement))
    ending = "" if statement.quiet else CRLF
    return lambda: device.emit("".join(item() for item in items) + ending)


def _items(device: MCodeDevice, statement: Statement) -> Iterator[Item]:
    rest = [each for each in statement.arguments if each is not None]
    while rest:
        argument = rest.pop(0)
        if isinstance(argument, Name) and argument.word in WITH_OPTION and row_of(device, argument.word):
            option = rest.pop(0) if rest and isinstance(rest[0], Number) else None
            yield _optional(device, argument.word, option)
        else:
            yield _item(device, argument)


def _item(device: MCodeDevice, argument: Argument) -> Item:
    if isinstance(argument, Text):
        text = unescape(argument.value)
        return lambda: text
    if isinstance(argument, Number):
        if isinstance(argument.value, float):
            raise Fault(UNREADABLE)
        constant = str(argument.value)
        return lambda: constant
    if not isinstance(argument, Name):
        raise Fault(UNREADABLE)
    word, row = argument.word, row_of(device, argument.word)
    if row is not None and row.access in ("-", "WO"):
        raise Fault(UNREADABLE)
    if row is not None and word in SHAPES:
        shape = SHAPES[word]
        return lambda: shape(device)
    if row is not None and word in BITS:
        return lambda: _trip(device, word)
    read = reader(device, word)
    if row is None:
        return lambda: _user(device, word)
    if word in FLOATS:
        return lambda: floating(device, read())
    return lambda: str(read())


def _optional(device: MCodeDevice, word: str, option: Argument | None) -> Item:
    number = option.value if isinstance(option, Number) else 0
    if number not in (0, 1, 2):
        raise Fault(WRONG)
    if word == "VT" and number == 1 and not device.model.auxiliary:
        raise Fault(NOT_HERE)
    return lambda: WITH_OPTION[word](device, int(number))


def unescape(text: str) -> str:
    """A text with its backslash codes carried out."""
    return re.sub(r"\\(.)", lambda found: _ESCAPES.get(found[1], found[0]), text, flags=re.DOTALL)


def floating(device: MCodeDevice, value: Value) -> str:
    """An F register as PF says; unpadded with six decimals until PF has been set."""
    setting = device.memory.texts["PF"]
    if not setting:
        return f"{value:.6f}"
    width, decimals, scientific, left = (int(each) for each in setting.split(","))
    text = f"{value:.{decimals}E}" if scientific else f"{value:.{decimals}f}"
    return text.ljust(width) if left else text.rjust(width)


def _user(device: MCodeDevice, word: str) -> str:
    if word not in device.memory.scopes:
        raise Fault(UNREADABLE)
    return str(device.memory.values[slot(word)])


def _error(device: MCodeDevice) -> str:
    """Printing ER clears EF, and ER with it (manual 5.1.40), which a program keeps: its samples test it after that."""
    code = device.memory.values["ER"]
    device.clear_error()
    if not device.immediate:
        device.memory.values["ER"] = code
    return str(code)


def _trip(device: MCodeDevice, word: str) -> str:
    trip = device.trips.defined.get(BITS[word])
    if trip is None:
        return "0"
    target = trip.target
    name = target.word if isinstance(target, Name) else str(target.value if isinstance(target, Number) else 0)
    if word in ("TC", "TM"):
        return name
    return f"{trip.value}, {name}" + (f", {trip.repeats}" if word == "TR" else "")


def fields(values: tuple[int, ...]) -> str:
    """Numbers as set-ups print them."""
    return ", ".join(str(each) for each in values)


def setup_lines(device: MCodeDevice, word: str) -> list[str]:
    """The lines of PR IS, PR OS or PR LS."""
    if word == "IS":
        return [f"IS = {n}, {fields(device.inputs.types[n])}" for n in PRINTED_INPUTS]
    if word == "OS":
        return [f"OS = {n}, {fields(each)}" for n, each in device.output_lines.types.items()]
    return [f"LS = {n}, {fields(each)}" for n, each in device.limits.items()]


def user_lines(device: MCodeDevice) -> list[str]:
    """The lines of PR UV: variables with their scope, labels with their address."""
    memory = device.memory
    rows = {name: f"{scope} {memory.values[slot(name)]}" for name, scope in memory.scopes.items()}
    rows.update({name: str(address) for name, address in device.program.labels.items()})
    return [f"{name} = {rows[name]}" for name in sorted(rows)]


def parameter_lines(device: MCodeDevice) -> list[str]:
    """The lines of PR AL: every variable and flag of this drive, in alphabetical order. Nothing is cleared."""
    rows: list[str] = []
    for name, row in device.memory.words.items():
        if row.kind not in ("variable", "flag") or row.access == "WO" or not device.memory.knows(row):
            continue
        if name in ("IS", "OS", "LS"):
            rows += setup_lines(device, name)
        else:
            rows.append(f"{name} = {_parameter(device, name)}")
    return rows


def _parameter(device: MCodeDevice, name: str) -> str:
    if name == "DN":
        return f'"{device.name}"'
    if name == "ER":
        return str(device.memory.values["ER"])
    if name in WITH_OPTION:
        return WITH_OPTION[name](device, 0)
    return _item(device, Name(name))()


def _listed(lines: Callable[[MCodeDevice], list[str]]) -> Callable[[MCodeDevice], str]:
    """Lines, and then an empty one."""
    return lambda device: "".join(line + CRLF for line in lines(device))


def _voltage(device: MCodeDevice, option: int) -> str:
    """Status, then the volts (manual 5.1.142; status 0 both good, 1 no auxiliary, 2 no +V, 3 neither)."""
    auxiliary = device.model.auxiliary
    status = (0 if auxiliary else 1) + (0 if device.axis.supply else 2)
    bridge = VOLTS if device.axis.supply else 0
    volts = {1: (AUXILIARY_VOLTS,), 2: (bridge,)}.get(option, (AUXILIARY_VOLTS, bridge) if auxiliary else (bridge,))
    return fields((status, *volts))


def _temperature(device: MCodeDevice, option: int) -> str:
    """The bridge, the controller, or both (manual 5.1.67)."""
    both = tuple(round(each(device.now)) for each in (device.motor.heat.bridge, device.motor.heat.controller))
    return fields(both if not option else both[option - 1 : option])


def _point(n: int) -> Callable[[MCodeDevice], str]:
    return lambda device: fields(device.inputs.types[n])


SHAPES: Mapping[str, Callable[[MCodeDevice], str]] = {
    "ER": _error,
    "AL": _listed(parameter_lines),
    "UV": _listed(user_lines),
    "IS": lambda device: CRLF.join(setup_lines(device, "IS")),
    "OS": lambda device: CRLF.join(setup_lines(device, "OS")),
    "LS": lambda device: CRLF.join(setup_lines(device, "LS")),
    "DN": lambda device: f'"{device.name}"',
    "MD": lambda device: device.memory.texts["MD"],
    "PF": lambda device: device.memory.texts["PF"] or str(MNEMONICS["PF"].default),
    "PW": lambda device: device.memory.texts.get("PW", "0,0,0,0"),
    "PN": lambda device: device.model.part,
    "SA": lambda device: f"{device.memory.values['SA']:.6f}",
    "SN": lambda device: f"0401{ord(device.spec.name[:1] or '!'):05d}",
    "VR": lambda device: device.model.version,
    "CR": lambda device: f"{device.memory.values['CR']:.3f}",
    **{f"S{n}": _point(n) for n in (*range(1, 6), *range(7, 14))},
}

WITH_OPTION: Mapping[str, Callable[[MCodeDevice, int], str]] = {
    "IT": _temperature,
    "VT": _voltage,
}
"""Words that may be followed by a number that chooses."""
