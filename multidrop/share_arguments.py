"""The arguments of `multidrop share`."""

from __future__ import annotations

import argparse


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
