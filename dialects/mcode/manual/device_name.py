"""The names that DN accepts (MCode reference 5.1.33): one letter or digit, whose case counts.

A Lexium accepts a name in quotation marks only; anything else is error 21. An MDrivePlus also accepts a bare name (two
clients for units send `DN a`), and a character's code of two or three digits (`DN=65` and `DN="65"` are A).
"""

from __future__ import annotations

import re
from string import ascii_lowercase, ascii_uppercase, digits

from multidrop.dialects.mcode.manual.grammar import Argument, Number, Text

UNNAMED = "!"
"""The name of a drive without a name of its own."""
NAMES = (UNNAMED, *ascii_lowercase, *digits, *ascii_uppercase)
"""All names, the likelier first."""
_CODE = re.compile(r"\d{2,3}", re.ASCII)


def device_name(argument: Argument | None, quoted_only: bool) -> str:
    """Return the name in a DN line; empty where the drive refuses it. `quoted_only`: the drive is a Lexium."""
    if isinstance(argument, Text):
        bare, value = not argument.quoted, argument.value
    elif isinstance(argument, Number) and isinstance(argument.value, int):
        bare, value = True, str(argument.value)
    else:
        return ""
    if quoted_only:
        value = "" if bare else value
    elif _CODE.fullmatch(value):
        value = chr(int(value))
    return value if len(value) == 1 and value.isascii() and value.isalnum() else ""
