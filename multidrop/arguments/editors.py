"""The arguments of `multidrop lsp`."""

from __future__ import annotations

import argparse

from multidrop.arguments import parts
from multidrop.dialects.text import whole

HOST = "127.0.0.1"


def add(parser: argparse.ArgumentParser) -> None:
    """Add the drive that programs are for, and the port."""
    parts.personality(parser, "the drive that programs are for, unless the editor names one")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--tcp", metavar="[HOST:]PORT", type=_address, help="serve one client there")
    where.add_argument("--stdio", action="store_true", help="serve standard input and output, as without it")


def _address(text: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    number = whole(port, 0, 65535)
    if number is None:
        raise argparse.ArgumentTypeError(f"no port {text!r}; valid: PORT or HOST:PORT")
    return host.removeprefix("[").removesuffix("]") or HOST, number
