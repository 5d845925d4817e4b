"""The arguments of `multidrop params` and `multidrop snapshot`."""

from __future__ import annotations

import argparse

from multidrop.arguments import parts


def _settings_of(parser: argparse.ArgumentParser) -> None:
    parts.url(parser)
    parts.drives(parser, "the drive (default: the first); all or several: FILE is a folder of files")


def params_backup(parser: argparse.ArgumentParser) -> None:
    """Add a drive and the new file."""
    _settings_of(parser)
    parser.add_argument("file", metavar="FILE", help="the new file; -: standard output")


def params_diff(parser: argparse.ArgumentParser) -> None:
    """Add a drive, and the file or the drive to compare it with."""
    _settings_of(parser)
    parser.add_argument("file", metavar="FILE", nargs="?", default="", help="a file of `params backup`")
    parser.add_argument("--against", metavar="URL2", default="", help="compare with a drive there")
    parser.add_argument(
        "--other", metavar="ADDR", default="", help="the drive to compare with (default: the first of URL2)"
    )
    parser.add_argument("--defaults", action="store_true", help="compare with the defaults")
    parser.add_argument("--json", action="store_true", help="print one JSON object a line")


def params_restore(parser: argparse.ArgumentParser) -> None:
    """Add a drive, the file, and what the restore may do."""
    _settings_of(parser)
    parser.add_argument("file", metavar="FILE", help="a file of `params backup`")
    parser.add_argument("--dry-run", action="store_true", help="show the steps, and send nothing")
    parser.add_argument("--save", action="store_true", help="keep the settings over power-off (S, STORE, STAP)")
    parser.add_argument("--communication", action="store_true", help="restore communication settings too")
    parser.add_argument(
        "--with",
        dest="named",
        metavar="NAME,...",
        action="append",
        default=[],
        help="restore these settings too, which can move the motor or belong to the unit",
    )
    parser.add_argument(
        "--other-product", action="store_true", help="restore what the drive has of another product's file"
    )
    parts.yes(parser)


def snapshot(parser: argparse.ArgumentParser) -> None:
    """Add what to open, and the new file."""
    parser.add_argument("urls", metavar="URL", nargs="+", help="what to open")
    parser.add_argument("-o", "--output", metavar="CELL.toml", required=True, help="the new file; -: standard output")


def snapshot_apply(parser: argparse.ArgumentParser) -> None:
    """Add the cell file, the replacement drive, and what may be done to it."""
    parser.add_argument("file", metavar="CELL.toml", help="a cell file, as snapshot writes it")
    parts.url(parser)
    parts.drives(parser, "the replacement (default: the only drive); all or several: each from its own name")
    parser.add_argument(
        "--from", dest="source", metavar="NAME", default="", help="the drive in the file (default: of the same name)"
    )
    parser.add_argument(
        "--with",
        dest="named",
        metavar="NAME,...",
        action="append",
        default=[],
        help="write these settings too, which can move the motor or lock the drive",
    )
    parser.add_argument("--other-product", action="store_true", help="the replacement may be another product")
    parser.add_argument("--dry-run", action="store_true", help="show what would be done, and do nothing")
    parts.yes(parser)
