"""The arguments of `multidrop publish`."""

from __future__ import annotations

import argparse


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
    parser.add_argument("--no-reconnect", action="store_true", help="give up a lost line, and do not try again")
