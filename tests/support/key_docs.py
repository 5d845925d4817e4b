"""The keys in docs/screen.md, made from the table of keys. `python -m tests.support.key_docs` writes it anew."""

from __future__ import annotations

from pathlib import Path

from multidrop.tui.key_table import SHEETS, STOP, Key, shown_key

PAGE = Path(__file__).parents[2] / "docs" / "screen.md"
BEGIN, END = "<!-- keys: made by tests/support/key_docs.py -->\n", "<!-- end of the keys -->\n"
EVERYWHERE = {"app": "every page", "screen": "every page", "page": "pages", "box": "boxes"}
ORDER = ("ctrl", "f", "letter", "other")


def kind(key: Key) -> str:
    """`ctrl`: Ctrl and a letter; `f`: a function key; `letter`: a character; `other`: arrows, Enter and the like."""
    last = key.keys.split(",")[0].split(" / ")[0]
    *modifiers, name = last.split("+")
    if modifiers == ["ctrl"] and len(name) == 1 and name.isalpha():
        return "ctrl"
    if name[:1] == "f" and name[1:2].isdigit():
        return "f"
    return "letter" if len(name.split("..")[0]) == 1 and not modifiers else "other"


def spelled(key: Key) -> str:
    """`^B, Ins`, `← →`."""
    parts = [", ".join(map(shown_key, each.split(","))) for each in key.keys.split(" / ")]
    return " ".join(parts).replace("|", "\\|")


def rows() -> list[tuple[str, str, str, str]]:
    """(kind, keys, word, what it does on each page), by kind and key."""
    found: dict[str, tuple[str, list[str], dict[str, list[str]]]] = {
        spelled(STOP): ("ctrl", [STOP.word], {STOP.about: ["everywhere"]})
    }
    for name, sheet in SHEETS.items():
        for key in sheet.keys:
            if key.keys:
                _, words, what = found.setdefault(spelled(key), (kind(key), [], {}))
                words += [key.word] if key.word and key.word not in words else []
                about = key.about.replace("line {}", "a line by its number")
                what.setdefault(about, []).append(EVERYWHERE.get(name, sheet.title))
    made = [
        (of_kind, keys, ", ".join(words), "; ".join(f"{', '.join(pages)}: {about}" for about, pages in what.items()))
        for keys, (of_kind, words, what) in found.items()
    ]
    return sorted(made, key=lambda row: (ORDER.index(row[0]), row[1] if row[0] == "ctrl" else ""))


def table() -> str:
    lines = ["| key | word | what it does, by page |", "|---|---|---|"]
    return "\n".join([*lines, *(f"| {keys} | {word} | {what} |" for _, keys, word, what in rows())]) + "\n"


def written(page: str) -> str:
    """A page with the table as it is now."""
    head, _, rest = page.partition(BEGIN)
    return f"{head}{BEGIN}\n{table()}\n{END}{rest.partition(END)[2]}"


if __name__ == "__main__":
    PAGE.write_text(written(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
