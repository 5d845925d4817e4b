"""Shared by the tests of transfers: a cell, a program file, and a download that shows what was narrated."""

from __future__ import annotations

import os
from pathlib import Path

from tests.support.cell_session import CellSession, bus, party

LINE = bus("line", party("a"), party("b"), baud=0)
FILE = "VA Q1=7   ' times\n' the main program\nPG 1\nLB G1\n  MR 100  ' there\n  H\nE\nPG\n"
LISTED = ["1  LB G1", "6  MR 100", "10  H", "12  E"]


def shop_with(folder: Path, text: str = FILE, *buses: str, reconnect: bool = False, usb: bool = False) -> CellSession:
    (folder / "p.mxt").write_text(text)
    return CellSession(folder, *(buses or (LINE,)), reconnect=reconnect, usb=usb)


def kept(folder: Path) -> list[Path]:
    return sorted((folder / "data" / "backups").glob("*.*"), key=lambda each: each.stat().st_mtime_ns)


async def load(shop: CellSession, folder: Path, *options: str, drive: str = "a") -> list[str]:
    """Download the file; return what was narrated, with the file's name for its path."""
    shop.events.clear()
    await shop.session.run(" ".join((f"/download {folder / 'p.mxt'} {drive}", *options)))
    return [text.replace(f"{folder}{os.sep}", "") for text in shop.told()]


SLOW = bus("line", party("a"), party("b"))
LONG = "PG 1\nLB G1\n" + "R1=R1+1\n" * 80 + "E\nPG\n"
RUNNING = "PG 1\nLB G1\n  MR 2000000\n  H\n  BR G1\nE\nPG\nPG 200\nLB G2\n  R1=R1+1\n  BR G2\nE\nPG\n"
