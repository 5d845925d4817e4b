"""The table of MCode instructions: each compiles its statement into a closure that carries it out.

`compile_statement` is the one way from a statement to an action, for immediate lines and program lines alike. What is
wrong with the form of a line is raised as Fault when it is compiled; what is wrong with a value, when it runs.
The instructions of programs are in `flow`, those with several settings in `setups`, PR in `prints`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf
from typing import TYPE_CHECKING

import simulator.lexium.language.flow as flow
import simulator.lexium.language.motor_commands as motor_commands
import simulator.lexium.language.prints as prints
import simulator.lexium.language.setups as setups
from dialects.mcode.manual.grammar import Argument, Name, Number, Statement
from simulator.lexium.language.interpreter import Action
from simulator.lexium.state.errors import Fault
from simulator.lexium.state.expressions import whole, wrap
from simulator.lexium.state.variables import READ_ONLY, reader, row_of, value_of, writer

if TYPE_CHECKING:
    from simulator.lexium.device import MCodeDevice

Compile = Callable[["MCodeDevice", Statement], Action]

UNKNOWN_VARIABLE, WRONG, ILLEGAL, SET_INSTRUCTION, EXECUTE_VARIABLE, NOT_PROGRAMMING, UNKNOWN = (
    20, 21, 24, 33, 34, 46, 60,
)  # fmt: skip


def compile_statement(device: MCodeDevice, statement: Statement, stored: bool) -> Action:
    """A closure that carries a line out; `stored`: it is a program's. Raises Fault for what cannot stand there."""
    word = statement.word
    if not word:
        return _counted(device, word, flow.number(device, statement))
    row = row_of(device, word)
    if row is None:
        return _user_variable(device, statement)
    if row.kind in ("math", "reserved"):
        raise Fault(ILLEGAL if row.kind == "reserved" and statement.arguments else UNKNOWN)
    if not (row.program if stored else row.immediate):
        raise Fault(ILLEGAL if stored else NOT_PROGRAMMING)
    if stored and word == "PR" and Name("AL") in statement.arguments:  # for immediate use only (manual 5.1.4)
        raise Fault(ILLEGAL)
    compiler = COMMANDS.get(word)
    if compiler is not None:
        action = compiler(device, statement)
        return _counted(device, word, action) if word in MOTIONS else action
    if row.kind == "instruction":
        return flow.nothing(device, statement)
    return _assignment(device, statement)


def _user_variable(device: MCodeDevice, statement: Statement) -> Action:
    word = statement.word
    mine = word in device.memory.scopes or word in device.program.declared or word in device.program.labels
    if not mine:
        raise Fault(UNKNOWN_VARIABLE if statement.equals else UNKNOWN)
    return _assignment(device, statement)


def _assignment(device: MCodeDevice, statement: Statement) -> Action:
    """`VM=5` or `VM 5`, and what is computed."""
    if not statement.arguments:
        raise Fault(ILLEGAL if statement.equals else EXECUTE_VARIABLE)
    write = writer(device, statement.word)
    floating = statement.word in prints.FLOATS
    read = value_of(device, only(statement), floating)
    return lambda: write(read())


def only(statement: Statement) -> Argument | None:
    """The one argument. Raises Fault (24) for none or several."""
    if len(statement.arguments) != 1:
        raise Fault(ILLEGAL)
    return statement.arguments[0]


def _move(device: MCodeDevice, statement: Statement) -> Action:
    """MA and MR (manual 5.1.80, 5.1.84)."""
    kind, arguments = statement.word, statement.arguments
    if not 1 <= len(arguments) <= 3:
        raise Fault(ILLEGAL)
    value = value_of(device, arguments[0])
    options = [value_of(device, each or Number(0)) for each in arguments[1:]]

    def go() -> None:
        chosen = [whole(each()) for each in options]
        if any(each not in (0, 1) for each in chosen):
            raise Fault(WRONG)
        announce, run_on = (*chosen, 0, 0)[:2]
        device.axis.go(kind, whole(value()), device.now, bool(announce), bool(run_on))
        device.memory.texts["MD"] = kind
        device.stale = True

    return go


def _slew(device: MCodeDevice, statement: Statement) -> Action:
    """SL (manual 5.1.117)."""
    value = value_of(device, only(statement))

    def go() -> None:
        device.motor.slew(whole(value()), device.now)
        device.memory.texts["MD"] = "SL"
        device.stale = True

    return go


def _counted(device: MCodeDevice, word: str, action: Action) -> Action:
    """The same, with the motions counted that it begins; what only slows down is none. A bare number is as MD says."""

    def move() -> None:
        before, kind = device.axis.profile, word or device.memory.texts["MD"]
        action()
        profile = device.axis.profile
        device.moves += profile is not before and (kind != "SL" or profile.end == inf)

    return move


def _step(by: int) -> Compile:
    def compiler(device: MCodeDevice, statement: Statement) -> Action:
        target = only(statement)
        if not isinstance(target, Name):
            raise Fault(ILLEGAL)
        return _stepped(device, target.word, by)

    return compiler


def _stepped(device: MCodeDevice, word: str, by: int) -> Action:
    """A closure that adds to a variable (IC, DC). Raises Fault (25, 26) for one that may not be stepped."""
    row = row_of(device, word)
    if row is not None and row.step:
        raise Fault(ILLEGAL if row.kind == "reserved" else row.step)
    if row is None and word not in device.memory.scopes and word not in device.program.declared:
        raise Fault(READ_ONLY)
    read, write = reader(device, word), writer(device, word)
    if row is not None and isinstance(row.default, float):
        return lambda: write(read() + by)

    def add() -> None:
        if row is None and word not in device.memory.scopes:
            raise Fault(READ_ONLY)
        write(wrap(whole(read()) + by))

    return add


def _bare(action: Callable[[MCodeDevice], None]) -> Compile:
    """An instruction without arguments."""

    def compiler(device: MCodeDevice, statement: Statement) -> Action:
        if statement.arguments or statement.equals:
            raise Fault(SET_INSTRUCTION if statement.equals else ILLEGAL)
        return lambda: action(device)

    return compiler


def _refused(device: MCodeDevice, statement: Statement) -> Action:
    """UG: there is no firmware to replace."""
    raise Fault(ILLEGAL)


MOTIONS = frozenset({"MA", "MR", "SL", "HM", "HI", "HF", "SC"})

COMMANDS: Mapping[str, Compile] = {
    "MA": _move,
    "MR": _move,
    "SL": _slew,
    "HM": motor_commands.home,
    "HI": motor_commands.home,
    "HF": motor_commands.home,
    "CF": _bare(motor_commands.clear_locked),
    "MU": motor_commands.make_up,
    "SC": motor_commands.test,
    "IC": _step(1),
    "DC": _step(-1),
    "PR": prints.compile_print,
    "S": _bare(lambda device: device.save()),
    "IP": _bare(lambda device: device.initialise()),
    "FD": _bare(lambda device: device.factory()),
    "E": _bare(flow.end),
    "RT": _bare(lambda device: device.interpreter.give_back()),
    "PS": _bare(lambda device: device.interpreter.pause(device.now)),
    "RS": _bare(lambda device: device.interpreter.resume(device.now)),
    "UG": _refused,
    "EX": flow.execute,
    "CP": flow.clear,
    "L": flow.listing,
    "LB": flow.label,
    "BR": flow.branch,
    "CL": flow.call,
    "H": flow.hold,
    "IV": flow.input_variable,
    "OE": flow.on_error,
    "BP": flow.break_point,
    "PG": flow.program_mode,
    "VA": flow.declare,
    "DN": setups.device_name,
    "IS": setups.inputs,
    "OS": setups.outputs,
    "LS": setups.software_limits,
    "PF": setups.print_format,
    "PW": setups.settings(4),
    **{f"S{n}": setups.point(n) for n in (*range(1, 6), *range(7, 14))},
    **{word: setups.trip(word) for word in ("TI", "TP", "TC", "TT", "TR", "TA", "TM")},
}
