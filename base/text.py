r"""Text from elsewhere: numbers in it, and control and direction characters made visible (`\x1b`).

A drive, a file, a name or a typed line may hold such characters. To a terminal they are commands: OSC 52 sets the
clipboard, and a C1 code is an escape sequence in one character. Direction characters show text in another order.
"""

from __future__ import annotations

DECIMAL = r"[+-]?(?:\d{1,16}(?:\.\d{0,24})?|\.\d{1,24})"
"""The number of a quantity, in a pattern; also with all the places of a Python number: 0.30000000000000004."""
ACTING = (
    (0x00, 0x1F),  # C0
    (0x7F, 0x9F),  # DEL and C1
    (0xAD, 0xAD),  # the soft hyphen, which is not shown
    (0x61C, 0x61C),
    (0x200B, 0x200F),  # without width, and marks of direction
    (0x2028, 0x202E),  # separators of lines and paragraphs, embeddings and overrides of direction
    (0x2060, 0x206F),  # isolates of direction, and more without width
    (0xD800, 0xDFFF),  # halves of characters, which no output can encode
    (0xFEFF, 0xFEFF),
    (0xFFF9, 0xFFFB),
)
"""The first and the last code of each range of characters that act."""


class _Escapes(dict[int, str]):
    """The shown form of each character, worked out when it is first met."""

    def __missing__(self, code: int) -> str:
        acts = any(low <= code <= high for low, high in ACTING)
        shown = chr(code) if not acts else f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"
        self[code] = shown
        return shown


_ESCAPES = _Escapes()
_WITH_TABS = _Escapes({0x09: "\t"})


def visible(text: str, tabs: bool = False) -> str:
    r"""Write out control and direction characters; with `tabs`, a TAB stays."""
    if text.isascii() and text.isprintable():
        return text
    return text.translate(_WITH_TABS if tabs else _ESCAPES)


_MOST_DIGITS = 24
"""Leading zeros included; no value needs more."""


def whole(text: str, low: int, high: int) -> int | None:
    """Return the number in a text of digits (0-9) with an optional sign; None unless it is from `low` to `high`."""
    digits = text[1:] if text[:1] in ("+", "-") else text
    if not (digits.isascii() and digits.isdigit()) or len(digits) > _MOST_DIGITS:
        return None
    number = int(text)
    return number if low <= number <= high else None


def real(text: str) -> float | None:
    """Return the number in a text; None where it is none."""
    try:
        return float(text)
    except ValueError:
        return None


def counted(number: int, one: str, many: str = "") -> str:
    """Format a number of things, as `1 line` or `3 lines`. `many`: a plural that is not made by an s."""
    return f"{number} {one if number == 1 else many or f'{one}s'}"


# Names and texts of others in command lines and tables.

_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")
"""A spreadsheet takes a cell that begins so for a formula, and a shell a word that begins with `-` for an option."""
NOT_FIRST = "not -, =, + or @ first"


def acts_first(name: str) -> bool:
    """Whether a name would act by its first character in a command line or in a table."""
    return name[:1] in _FORMULA


def cell(text: str) -> str:
    """Return a text as a cell of a CSV file: with `'` before what a spreadsheet would take for a formula."""
    acts = acts_first(text.lstrip("'")) and real(text) is None
    return f"'{text}" if acts else text


def of_cell(text: str) -> str:
    """Return the text of such a cell."""
    return text[1:] if text.startswith("'") and acts_first(text.lstrip("'")) else text
