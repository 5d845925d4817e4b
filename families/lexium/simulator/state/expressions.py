"""Expressions and conditions compiled to closures.

Whole numbers are 32 bits wide: results wrap around, division drops the fraction (toward zero). An expression is
carried out in double precision if it holds an F register, a number with a point or a function, or if its result goes
to an F register. Operators have no precedence; the parser reads conditions. Manual 5.1.43, 5.2.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from multidrop.families.lexium.manual.errors import ErrorNumber as E
from multidrop.families.lexium.manual.grammar import BinaryTerm, Compare, Expression, NameTerm, Number, UnaryTerm
from multidrop.families.lexium.manual.groups import FUNCTIONS
from multidrop.families.lexium.manual.statements import compares
from multidrop.families.lexium.simulator.state.errors import DriveFault

Value = int | float
Read = Callable[[], Value]
Lookup = Callable[[str], Read]
"""Gives the reader of a word."""

PI = 3.141592654
FLOATS = frozenset({*(f"F{n}" for n in range(1, 9)), "PI"})


def wrap(value: int) -> int:
    """A whole number as 32 bits hold it."""
    return ((value + 0x80000000) & 0xFFFFFFFF) - 0x80000000


def whole(value: Value) -> int:
    """A value without its fraction. Raises DriveFault for a value that is not finite."""
    if isinstance(value, int):
        return value
    if not math.isfinite(value):
        raise DriveFault(E.ILLEGAL_DATA)
    return int(value)


def _divide(left: Value, right: Value) -> int:
    if right == 0:
        raise DriveFault(E.ILLEGAL_DATA)
    quotient = abs(whole(left)) // abs(whole(right))
    return wrap(-quotient if (left < 0) != (right < 0) else quotient)


_WHOLE: Mapping[str, Callable[[Value, Value], Value]] = {
    "+": lambda left, right: wrap(whole(left) + whole(right)),
    "-": lambda left, right: wrap(whole(left) - whole(right)),
    "*": lambda left, right: wrap(whole(left) * whole(right)),
    "/": _divide,
    "&": lambda left, right: wrap(whole(left) & whole(right)),
    "|": lambda left, right: wrap(whole(left) | whole(right)),
    "^": lambda left, right: wrap(whole(left) ^ whole(right)),
}
_FLOATING: Mapping[str, Callable[[Value, Value], Value]] = {
    **_WHOLE,
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
}
_COMPARE: Mapping[str, Callable[[Value, Value], bool]] = {
    "=": operator.eq,
    "<>": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
_ANGLE_IN: Mapping[str, Callable[[float], float]] = {"CS": math.cos, "SI": math.sin, "TG": math.tan}
_ANGLE_OUT: Mapping[str, Callable[[float], float]] = {"C_": math.acos, "S_": math.asin, "T_": math.atan}
_PLAIN: Mapping[str, Callable[[float], float]] = {"AB": abs, "LO": math.log2, "L_": math.log10, "SQ": math.sqrt}


def is_floating(expression: Expression) -> bool:
    """Return whether an expression needs double precision by itself."""
    if isinstance(expression, Number):
        return isinstance(expression.value, float)
    if isinstance(expression, NameTerm):
        return expression.word in FLOATS
    if isinstance(expression, UnaryTerm):
        return expression.op in FUNCTIONS or is_floating(expression.operand)
    if isinstance(expression, Compare):  # 0 or 1, whatever it compares
        return False
    return is_floating(expression.left) or is_floating(expression.right)


def _calls(expression: Expression) -> bool:
    """Return whether a function is in it."""
    if isinstance(expression, UnaryTerm):
        return expression.op in FUNCTIONS or _calls(expression.operand)
    return isinstance(expression, BinaryTerm | Compare) and (_calls(expression.left) or _calls(expression.right))


@dataclass(frozen=True)
class Compiler:
    """Expressions of one drive as closures, or DriveFault; without `floating_point` it has none, and `F1` is a name.

    Each side of a comparison is carried out by itself, in double precision or not.
    """

    lookup: Lookup
    floating_point: bool = True

    def expression(self, expression: Expression, floating: bool = False) -> Read:
        """Return a closure that reads an expression. `floating`: the result goes to an F register.

        Raises DriveFault (24) where a comparison is in it: only conditions hold one.
        """
        if compares(expression):
            raise DriveFault(E.ILLEGAL_DATA)
        return self.value(expression, floating)

    def value(self, expression: Expression, floating: bool = False) -> Read:
        if not self.floating_point and _calls(expression):
            raise DriveFault(E.ILLEGAL_DATA)
        return self.compile(expression, self.floating_point and (floating or is_floating(expression)))

    def condition(self, condition: Expression) -> Callable[[], bool]:
        """Return a closure that evaluates a condition; one without a comparison holds while its value is not 0."""
        if not isinstance(condition, Compare):
            condition = Compare("<>", condition, Number(0))
        left, right = self.value(condition.left), self.value(condition.right)
        compare = _COMPARE[condition.op]
        if isinstance(condition.right, Number):
            constant = condition.right.value
            if condition.op == "=":  # what programs ask most
                return lambda: left() == constant
            return lambda: compare(left(), constant)
        return lambda: compare(left(), right())

    def compile(self, expression: Expression, floating: bool) -> Read:
        if isinstance(expression, Number):
            constant = expression.value
            return lambda: constant
        if isinstance(expression, NameTerm):
            return self.lookup(expression.word)
        if isinstance(expression, UnaryTerm):
            return self.unary(expression, floating)
        if isinstance(expression, Compare):
            holds = self.condition(expression)
            return lambda: int(holds())
        left, right = (self.compile(side, floating) for side in (expression.left, expression.right))
        return _binary(expression.op, left, right, floating)

    def unary(self, expression: UnaryTerm, floating: bool) -> Read:
        operand = self.compile(expression.operand, floating)
        if expression.op == "!":
            return lambda: ~whole(operand())
        if expression.op == "-":
            return (lambda: -operand()) if floating else (lambda: wrap(-whole(operand())))
        return _compile_function(expression.op, operand, self.lookup("RA"))


def _compile_function(word: str, operand: Read, radians: Read) -> Read:
    def read() -> float:
        value = float(operand())
        try:
            if word in _ANGLE_IN:
                return _ANGLE_IN[word](value if radians() else math.radians(value))
            if word in _ANGLE_OUT:
                angle = _ANGLE_OUT[word](value)
                return angle if radians() else math.degrees(angle)
            return _PLAIN[word](value)
        except (ValueError, OverflowError):
            raise DriveFault(E.ILLEGAL_DATA) from None

    return read


def _binary(op: str, left: Read, right: Read, floating: bool) -> Read:
    if op == "+" and not floating:
        return lambda: ((whole(left()) + whole(right()) + 0x80000000) & 0xFFFFFFFF) - 0x80000000
    apply = (_FLOATING if floating else _WHOLE)[op]
    if not floating:
        return lambda: apply(left(), right())

    def read() -> Value:
        try:
            value = apply(left(), right())
        except (OverflowError, ZeroDivisionError):
            raise DriveFault(E.ILLEGAL_DATA) from None
        if not math.isfinite(value):
            raise DriveFault(E.ILLEGAL_DATA)
        return value

    return read
