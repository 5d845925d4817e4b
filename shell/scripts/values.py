"""Values of expressions: numbers and text, what is calculated with them, and how they are written into a line."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Mapping

from multidrop.dialects import Diagnostic

Value = int | float | str
LARGEST = 10**15
"""The largest magnitude of a result. Whole numbers up to it are exact, and a loop cannot fill the memory with one."""
_NUMBER = re.compile(r"[+-]?(\d{1,16}(\.\d{0,16})?|\.\d{1,16})", re.ASCII)


def value_of(text: str) -> Value:
    """Read a value: a number where the text is one, else the text."""
    text = text.strip()
    if not _NUMBER.fullmatch(text):
        return text
    return float(text) if "." in text else int(text)


def written(value: Value) -> str:
    """Write a value as a line and a message have it; a fraction has up to nine places."""
    if isinstance(value, float):
        text = f"{value:.9f}".rstrip("0").rstrip(".")
        return "0" if text == "-0" else text
    return str(value)


def quoted(value: Value) -> str:
    """Write a value for a message, with text in quotation marks."""
    return f'"{value}"' if isinstance(value, str) else written(value)


def _quotient(left: float, right: float) -> float:
    """Divide; whole numbers that divide without a rest stay whole."""
    whole = isinstance(left, int) and isinstance(right, int) and left % right == 0
    return left // right if whole else left / right


ARITHMETIC: Mapping[str, Callable[[float, float], float]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": _quotient,
    "%": operator.mod,
}
ORDER: Mapping[str, Callable[[float, float], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
EQUAL = ("==", "!=")


def number(value: Value) -> int | float:
    """Return the value if it is a number. Raises Diagnostic."""
    if isinstance(value, str):
        raise Diagnostic(f"{quoted(value)} is not a number")
    return value


def calculated(sign: str, left: Value, right: Value) -> Value:
    """Calculate with two numbers. Raises Diagnostic for text, a division by 0, and a result that is too large."""
    first, second = number(left), number(right)
    if sign in "/%" and second == 0:
        raise Diagnostic(f"{written(first)} {sign} 0 has no result")
    result = ARITHMETIC[sign](first, second)
    if not abs(result) <= LARGEST:
        raise Diagnostic(f"{written(first)} {sign} {written(second)} is beyond {LARGEST:.0e}")
    return result


def compared(sign: str, left: Value, right: Value, within: Value = 0) -> bool:
    """Compare two values; `==` and `!=` with a tolerance. Text equals the same text only. Raises Diagnostic."""
    if sign not in EQUAL:
        return ORDER[sign](number(left), number(right))
    text = isinstance(left, str) or isinstance(right, str)
    equal = left == right if text else abs(number(left) - number(right)) <= number(within)
    return equal == (sign == "==")
