"""Values of a Python program as a line has them."""

from __future__ import annotations

import math
import operator
from typing import Any

from multidrop.base.errors import Diagnostic
from multidrop.macros import model
from multidrop.shell.scripts.expression import written

VALID = "a number or a text"


def text_of(value: object, what: str) -> str:
    """Return the text of a value: a number without an exponent, True and False as 1 and 0. Raises Diagnostic."""
    if isinstance(value, str):
        return value
    number = number_of(value, what)
    return model.written(number) if isinstance(number, float) else str(number)


def short_text_of(value: object, what: str) -> str:
    """Return the text of a number with nine decimal places. Raises Diagnostic, also where these leave nothing of it."""
    number = number_of(value, what)
    text = written(number)
    if number and text == "0":
        raise Diagnostic(f"{number} is 0 with nine decimal places", what, "give it as a text")
    return text


def number_of(value: Any, what: str) -> int | float:
    """Return a number of Python, NumPy, Decimal or Fraction as Python's own. Raises Diagnostic."""
    try:
        return operator.index(value) if hasattr(value, "__index__") else _finite(value)
    except (TypeError, ValueError, OverflowError, AttributeError):
        raise Diagnostic(f"{value!r} is no value for a line", what, f"valid: {VALID}") from None


def seconds(value: Any, what: str) -> float:
    """Return a time limit: 0 or more, `math.inf` for none. Raises Diagnostic: a wait until NaN never ends."""
    if isinstance(value, (int, float)) and value >= 0:
        return value
    raise Diagnostic(f"{what}: no timeout {value!r}", "", "valid: 0 or more seconds; math.inf: no limit")


def _finite(value: Any) -> float:
    number: float = value.__float__()  # not float(): that takes texts and bytes, too
    if not math.isfinite(number):
        raise ValueError
    return number
