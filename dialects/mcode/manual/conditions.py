"""The reading of a condition of BR or CL: the one rule of checker, simulator and help.

The manual shows one comparison without logic ("only one condition", 5.1.14, 5.1.22). Longer conditions are read from
left to right. `+ - * /` after a comparison belong to its right side: `P<R1+100` is P<(R1+100). `& | ^` after a
comparison take its result, 0 or 1: `R1=1&MV` is (R1=1)&MV. A second comparison takes everything to its left: `KF&12=12`
is (KF&12)=12, `I1=1&I2=1` is ((I1=1)&I2)=1. `grammar.parse` builds its trees by this rule.
"""

from __future__ import annotations

from collections.abc import Iterator

from multidrop.dialects.mcode.manual.grammar import (
    FUNCTIONS,
    LOGIC,
    Argument,
    Binary,
    Compare,
    Expression,
    Name,
    Number,
    Statement,
    Unary,
)

CONDITIONAL = frozenset({"BR", "CL"})
"""The words whose second argument is a condition."""


def condition_of(statement: Statement) -> Expression | None:
    """Return the condition of a BR or CL; None for any other statement."""
    if statement.word not in CONDITIONAL or len(statement.arguments) != 2:
        return None
    argument = statement.arguments[1]
    return argument if isinstance(argument, Expression) else None


def compares(expression: Argument) -> bool:
    """Whether it contains a comparison."""
    return any(isinstance(each, Compare) for each in _parts(expression))


def is_mixed(condition: Expression) -> bool:
    """Whether it exceeds the manual's form: several comparisons, or a comparison beside logic."""
    parts = list(_parts(condition))
    comparisons = sum(isinstance(each, Compare) for each in parts)
    logic = any(isinstance(each, Binary | Unary) and each.op in (*LOGIC, "!") for each in parts)
    return comparisons > 1 or (comparisons == 1 and logic)


def reading(condition: Expression) -> str:
    """Show the condition as it is read, with brackets around each operation but the last."""
    match condition:
        case Number(value):
            return str(value)
        case Name(word):
            return word
        case Unary(op, operand):
            return f"{op} {_inner(operand)}" if op in FUNCTIONS else op + _inner(operand)
        case Binary(op, left, right) | Compare(op, left, right):
            return _inner(left) + op + _inner(right)


def _inner(part: Expression) -> str:
    bracketed = isinstance(part, Binary | Compare) or (isinstance(part, Unary) and part.op == "!")
    return f"({reading(part)})" if bracketed else reading(part)


def _parts(expression: Argument) -> Iterator[Argument]:
    """Yield a condition and all its parts."""
    yield expression
    if isinstance(expression, Unary):
        yield from _parts(expression.operand)
    elif isinstance(expression, Binary | Compare):
        yield from _parts(expression.left)
        yield from _parts(expression.right)
