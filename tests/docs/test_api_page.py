"""Every Python block of the page on the API runs on the simulator, and prints the text block that follows it."""

from __future__ import annotations

import asyncio
import contextlib
import io
import re
from collections.abc import Coroutine
from pathlib import Path
from typing import Any

import pytest

from multidrop.api import threads
from tests.support.paths import ROOT
from tests.support.virtual import VirtualLoop

PAGE = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```python\n(.*?)^```\n(?:\n```text\n(.*?)^```)?", PAGE, re.S | re.M)
ELSEWHERE = ("multidrop.script", "def test_")
"""Marks of blocks that run under another program; others test those."""
OWN = [block for block in BLOCKS if not any(mark in block[0] for mark in ELSEWHERE)]


def run(work: Coroutine[Any, Any, None]) -> None:
    """`asyncio.run` on a loop whose clock does not wait."""
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        runner.run(work)


def test_there_are_blocks() -> None:
    assert len(OWN) >= 5


@pytest.mark.parametrize("block", OWN, ids=lambda block: block[0].split("\n")[0][:40])
def test_a_block_prints_what_the_page_says(
    block: tuple[str, str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(threads, "new_loop", VirtualLoop)
    monkeypatch.setattr(asyncio, "run", run)
    monkeypatch.chdir(tmp_path)
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(f"import multidrop\n{block[0]}", {"__name__": "page"})
    assert printed.getvalue() == block[1]
