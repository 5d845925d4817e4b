"""The arguments of `multidrop program sweep`."""

from __future__ import annotations

import argparse

from multidrop import arguments


def sweep(parser: argparse.ArgumentParser) -> None:
    """Add the program, its worlds, the conditions, the workers and the reports."""
    from multidrop.commands.languages import endings, names, titles

    parser.add_argument("file", metavar="FILE", help=titles())
    parser.add_argument("--language", choices=names(), help=f"default: {endings()}")
    parser.add_argument(
        "--cell",
        metavar="CELL",
        help="the drive that runs the program, and its world: CELL, CELL#BUS or CELL#BUS:NAME (default: the only "
        "drive, or the one that --vary names)",
    )
    parser.add_argument(
        "--vary",
        metavar="KEY=VALUES",
        action="append",
        default=[],
        type=_key_and_values,
        help="KEY: DRIVE.KEY, KEY with one drive (of its world, else a parameter), or seed; "
        "VALUES: a,b,c or A..B or A..B:STEP; may be repeated",
    )
    parser.add_argument(
        "--expect",
        metavar="CONDITION",
        action="append",
        default=[],
        help="a comparison with position, errors, prints, virtual_s or ended; all must hold; may be repeated "
        "(default: errors == [])",
    )
    parser.add_argument("--random", metavar="N", type=_count, help="draw N cases, in place of all")
    parser.add_argument("--seed", metavar="N", type=int, default=1, help="the seed of these draws (default: 1)")
    parser.add_argument(
        "--run", metavar="LABEL", default="", help="the label or program to execute (default: its own start)"
    )
    parser.add_argument(
        "--until",
        metavar="SECONDS",
        type=arguments.duration,
        help="virtual seconds of a case at most; without it, a case that still runs after 60 s has failed",
    )
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--jobs", metavar="N", type=_count, help="processes (default: as many as there are cores)")
    where.add_argument(
        "--cluster", metavar="tcp://HOST:PORT", default="", help="the scheduler of a Dask cluster, which runs the cases"
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object a case, and a summary")
    parser.add_argument("--junit", metavar="FILE", default="", help="write the cases to a JUnit XML file")


def _key_and_values(text: str) -> tuple[str, str]:
    key, sign, values = text.partition("=")
    if not (sign and key.strip()):
        raise argparse.ArgumentTypeError(f"{text} is not KEY=VALUES")
    return key.strip(), values


def _count(text: str) -> int:
    if not (text.isascii() and text.isdecimal() and 1 <= int(text[:9]) <= 100_000):
        raise argparse.ArgumentTypeError(f"{text} is not a number from 1 to 100000")
    return int(text)
