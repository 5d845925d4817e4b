r"""Text from elsewhere made visible: control and direction characters are written out (`\x1b`).

A drive, a file, a name or a typed line may hold such characters: to a terminal they are commands (OSC 52 sets the
clipboard, C1 codes are escape sequences in one character), and direction characters show text in another order.
"""

from __future__ import annotations

_ESCAPES = {
    code: f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"
    for code in (
        *range(0x20),  # C0
        *range(0x7F, 0xA0),  # DEL and C1
        0xAD,  # the soft hyphen, which is not shown
        0x61C,
        *range(0x200B, 0x2010),  # without width, and marks of direction
        *range(0x2028, 0x202F),  # separators of lines and paragraphs, embeddings and overrides of direction
        *range(0x2060, 0x2070),  # isolates of direction, and more without width
        *range(0xD800, 0xE000),  # halves of characters, which no output can encode
        0xFEFF,
        *range(0xFFF9, 0xFFFC),
    )
}
_WITH_TABS = {code: text for code, text in _ESCAPES.items() if code != 0x09}


def visible(text: str, tabs: bool = False) -> str:
    r"""Write out control and direction characters; with `tabs`, a TAB stays."""
    if text.isascii() and text.isprintable():
        return text
    return text.translate(_WITH_TABS if tabs else _ESCAPES)
