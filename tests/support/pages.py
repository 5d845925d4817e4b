"""The pages and their blocks of code. `<!-- not run: REASON -->` above a block keeps it from being run."""

from __future__ import annotations

import re
from typing import NamedTuple

from tests.support.paths import ROOT

EXAMPLES = ROOT / "examples"
PAGES = {
    str(path.relative_to(ROOT)): path.read_text(encoding="utf-8")
    for path in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")), *sorted(EXAMPLES.glob("*/README.md")))
}
_BLOCK = re.compile(r"(?:^<!-- not run: (.+?) -->\n)?^```(\w*)\n(.*?)^```\n(?:\n```text\n(.*?)^```)?", re.S | re.M)
_FILE = re.compile(r"(?:[#';]|//) ([\w-]+\.\w+)\n")


class Block(NamedTuple):
    """A block: the reason why it is not run, its language, its text, and the block of text that follows it."""

    mark: str
    language: str
    text: str
    output: str

    @property
    def file(self) -> str:
        """The name in its first remark; empty if it is not a file."""
        found = _FILE.match(self.text)
        return found[1] if found else ""


def blocks(page: str, *languages: str) -> list[Block]:
    """The blocks of a page in order; of some languages where they are named."""
    found = [Block(*each.groups(default="")) for each in _BLOCK.finditer(PAGES[page])]
    return [each for each in found if not languages or each.language in languages]
