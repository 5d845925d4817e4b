"""For mkdocs: a link that leaves the folder of the pages leads to a file of the repository, which the site lacks."""

from __future__ import annotations

import re
from typing import Any

_OUTSIDE = re.compile(r"\[([^]]+)\]\(\.\./[^)]*\)")


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Leave the words of such a link."""
    return _OUTSIDE.sub(r"\1", markdown)
