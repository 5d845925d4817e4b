"""Every Python block of the pages runs on the simulator, and prints the text block that follows it.

A block that is a file (`# turn.py`) is run by a console block of its page.
"""

from __future__ import annotations

import asyncio
import contextlib
import io
from collections.abc import Coroutine
from pathlib import Path
from typing import Any

import pytest

from multidrop.api import threads
from tests.support.pages import PAGES, Block, blocks
from tests.support.virtual import VirtualLoop

OWN = [
    pytest.param(page, block, id=f"{page}: {block.text.partition(chr(10))[0][:40]}")
    for page in PAGES
    for block in blocks(page, "python")
    if not (block.mark or block.file)
]


def run(work: Coroutine[Any, Any, None]) -> None:
    """`asyncio.run` on a loop whose clock does not wait."""
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        runner.run(work)


@pytest.mark.parametrize("page, block", OWN)
def test_a_block_prints_what_the_page_says(
    page: str, block: Block, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(threads, "new_loop", VirtualLoop)
    monkeypatch.setattr(asyncio, "run", run)
    monkeypatch.chdir(tmp_path)
    for each in blocks(page):
        if each.file:
            Path(each.file).write_text(each.text, encoding="utf-8")
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(f"import multidrop\n{block.text}", {"__name__": "page"})
    assert printed.getvalue() == block.output


def test_blocks_that_are_files_are_run_by_a_console_block() -> None:
    files = [(page, each.file) for page in PAGES for each in blocks(page, "python") if each.file]
    assert files and all(any(file in each.text for each in blocks(page, "console")) for page, file in files)


def test_at_most_one_block_in_ten_is_not_run() -> None:
    every = [each for page in PAGES for each in blocks(page, "console", "python")]
    assert len(every) > 40 and sum(bool(each.mark) for each in every) <= len(every) / 10
