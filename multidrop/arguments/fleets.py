"""The arguments of `multidrop relay`, `share` and `publish`."""

from __future__ import annotations

import argparse

from multidrop.arguments import parts


def relay(parser: argparse.ArgumentParser) -> None:
    """Add the port and its baud rate."""
    parser.add_argument("port", metavar="PORT", help="a serial port of this machine")
    parser.add_argument("--baud", metavar="N", type=_any_baud, default=9600, help="bits/s (default: 9600)")


def _any_baud(text: str) -> int:
    return parts.number(text, 1, 99_999_999)


def share(parser: argparse.ArgumentParser) -> None:
    """Add a URL, where clients connect, and the form of the output."""
    parser.add_argument("url", metavar="URL", help="the port to lend")
    parser.add_argument(
        "--rfc2217",
        metavar="[HOST:]PORT",
        required=True,
        help="serve it here (host: 127.0.0.1 unless given; port 0: a free one)",
    )
    parser.add_argument(
        "--json", action="store_true", help="print the endpoint and the events as JSON objects, a line each"
    )


def publish(parser: argparse.ArgumentParser) -> None:
    """Add URLs, the broker, and how often it gets samples."""
    parser.add_argument("urls", metavar="URL", nargs="+", help="what to open")
    parser.add_argument(
        "--to",
        metavar="mqtt://[USER@]BROKER[:PORT]/PREFIX",
        required=True,
        help="the broker, and the topic above all others; mqtts:// is encrypted",
    )
    parser.add_argument("--rate", metavar="N", default="2", help="samples a second of each drive, at most (default: 2)")
    parts.no_reconnect(parser)
