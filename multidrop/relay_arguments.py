"""The arguments of `multidrop relay`."""

from __future__ import annotations

import argparse


def relay(parser: argparse.ArgumentParser) -> None:
    """Add the port and its baud rate."""
    parser.add_argument("port", metavar="PORT", help="a serial port of this machine")
    parser.add_argument("--baud", metavar="N", type=_baud, default=9600, help="bits/s (default: 9600)")


def _baud(text: str) -> int:
    if not (text.isascii() and text.isdecimal() and len(text) < 9 and int(text)):
        raise argparse.ArgumentTypeError(f"no baud rate {text}; one such as 9600")
    return int(text)
