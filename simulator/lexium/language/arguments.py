"""The forms of arguments that several instructions share."""

from __future__ import annotations

from collections.abc import Callable

from multidrop.dialects.mcode.manual.errors import ErrorNumber as E
from multidrop.dialects.mcode.manual.grammar import Argument, Name, Number, Statement
from multidrop.simulator.lexium.language.program_mode import Action
from multidrop.simulator.lexium.language.variable_access import VariableAccess
from multidrop.simulator.lexium.state.errors import Fault
from multidrop.simulator.lexium.state.expressions import whole

Compile = Callable[[Statement], Action]
"""Compiles the statement of one instruction. Raises Fault for a wrong form."""


def is_place(argument: Argument | None) -> bool:
    """Whether an argument can be a label or an address."""
    return isinstance(argument, (Name, Number))


def only(statement: Statement) -> Argument | None:
    """The one argument. Raises Fault (24) for none or several."""
    if len(statement.arguments) != 1:
        raise Fault(E.ILLEGAL_DATA)
    return statement.arguments[0]


def pair(statement: Statement) -> tuple[Argument | None, Argument | None]:
    """One or two arguments. Raises Fault (24)."""
    if not 1 <= len(statement.arguments) <= 2:
        raise Fault(E.ILLEGAL_DATA)
    first, second = (*statement.arguments, None)[:2]
    return first, second


def bare(action: Action) -> Compile:
    """An instruction without arguments."""

    def compiler(statement: Statement) -> Action:
        if statement.arguments or statement.equals:
            raise Fault(E.INSTRUCTION_NOT_SETTABLE if statement.equals else E.ILLEGAL_DATA)
        return action

    return compiler


def missing(statement: Statement) -> Fault:
    """The error of an instruction that lacks its arguments."""
    return Fault(E.ILLEGAL_DATA if statement.equals else E.NOT_EXECUTABLE)


def numbers(variables: VariableAccess, statement: Statement, least: int, most: int) -> Callable[[], list[int]]:
    """A closure that gives all arguments as whole numbers. Raises Fault (24, 34, 38)."""
    count = len(statement.arguments)
    if not count:
        raise missing(statement)
    if count < least:
        raise Fault(E.NO_SEPARATOR)
    if count > most:
        raise Fault(E.ILLEGAL_DATA)
    reads = [variables.value(each) for each in statement.arguments]
    return lambda: [whole(read()) for read in reads]
