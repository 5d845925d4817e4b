"""For mkdocs: links that leave the folder of the pages lead to the files of the repository, which the site does not have."""

from __future__ import annotations

import re
from typing import Any

_OUTSIDE = re.compile(r"\[([^]]+)\]\(\.\./[^)]*\)")


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Leave the words of such a link."""
    return _OUTSIDE.sub(r"\1", markdown)
