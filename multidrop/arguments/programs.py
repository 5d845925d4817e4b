"""The arguments of `multidrop program`. Languages and drives come from the tables of families."""

from __future__ import annotations

import argparse

from multidrop.arguments import parts


def check(parser: argparse.ArgumentParser) -> None:
    """Add files, their language, and the drive that they are for."""
    parts.files(parser)
    parts.personality(parser, "the drive that the program is for")
    parser.add_argument(
        "--format", action="store_true", help="rewrite files without errors in canonical spelling; remarks stay"
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object a line")


def test(parser: argparse.ArgumentParser) -> None:
    """Add files, their language, the simulated drive, and the limits of the run."""
    from multidrop.commands.languages import DEFAULT_PERSONALITY, TESTED

    parts.files(parser)
    parser.add_argument(
        "--personality",
        metavar="P",
        type=str.upper,
        choices=TESTED,
        help=f"%(choices)s (default: the cell's, or {DEFAULT_PERSONALITY})",
    )
    parser.add_argument(
        "--cell", metavar="CELL", help="a drive of a cell file and its world: CELL, CELL#BUS or CELL#BUS:NAME"
    )
    parser.add_argument(
        "--until", metavar="SECONDS", type=parts.duration, help="virtual seconds at most, for a program without an end"
    )
    parts.run_label(parser)
    parser.add_argument(
        "--trace", action="store_true", help="print each line that is executed, with its time and what it changed"
    )
    parser.add_argument(
        "--break",
        dest="breaks",
        metavar="LINE|LABEL[,PASSES]",
        action="append",
        default=[],
        help="end the run before this line; may be repeated",
    )
    parser.add_argument(
        "--watch",
        metavar="NAME",
        action="append",
        default=[],
        help="print a variable whenever a line has changed it; may be repeated",
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object a line")


def drive(parser: argparse.ArgumentParser, several: str = "") -> None:
    """Add a URL and a drive. `several`: what is different for several drives."""
    parts.url(parser)
    parts.drives(parser, f"the drive (default: the first), or all{several}")


def upload(parser: argparse.ArgumentParser) -> None:
    """Add a drive and the new file."""
    drive(parser, "; all or several: FILE is a new folder of files")
    parser.add_argument("file", metavar="FILE", help="the new file; it can be downloaded again; -: standard output")
    parser.add_argument("--raw", action="store_true", help="save the lines as they are stored, without remarks")


def download(parser: argparse.ArgumentParser) -> None:
    """Add a drive and the file."""
    from multidrop.commands.languages import titles

    drive(parser)
    parser.add_argument("file", metavar="FILE", help=titles())
    parser.add_argument("--save", action="store_true", help="save it with S, so that power-off does not lose it")
    parser.add_argument("--run", metavar="LABEL", default="", help="execute the program at this label at the end")
    parser.add_argument("--only-changed", action="store_true", help="send nothing where the drive holds it already")
    parser.add_argument("--no-verify", action="store_true", help="do not read the program back")
    parts.yes(parser)


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
    parts.run_label(parser)
    parser.add_argument(
        "--until",
        metavar="SECONDS",
        type=parts.duration,
        help="virtual seconds of a case at most; without it, a case that still runs after 60 s has failed",
    )
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--jobs", metavar="N", type=_count, help="processes (default: as many as there are cores)")
    where.add_argument(
        "--cluster", metavar="tcp://HOST:PORT", default="", help="the scheduler of a Dask cluster, which runs the cases"
    )
    parts.yes(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object a case, and a summary")
    parser.add_argument("--junit", metavar="FILE", default="", help="write the cases to a JUnit XML file")


def _key_and_values(text: str) -> tuple[str, str]:
    key, sign, values = text.partition("=")
    if not (sign and key.strip()):
        raise argparse.ArgumentTypeError(f"{text} is not KEY=VALUES")
    return key.strip(), values


def _count(text: str) -> int:
    return parts.number(text, 1, 100_000)
