"""For mkdocs: the version in the title; words in place of links that leave the folder of the pages."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

VERSION = re.compile(r'^__version__ = "(.+)"$', re.M)
_OUTSIDE = re.compile(r"\[([^]]+)\]\(\.\./[^)]*\)")


def on_config(config: Any, **_: Any) -> Any:
    """Show the version that the command and the wheel have."""
    text = (Path(__file__).parent.parent / "multidrop" / "__init__.py").read_text(encoding="utf-8")
    found = VERSION.search(text)
    assert found is not None
    config["site_name"] = f"multidrop {found[1]}"
    return config


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Leave the words of such a link."""
    return _OUTSIDE.sub(r"\1", markdown)
