"""Program files made into ones for other drives, and both run beside each other."""

from __future__ import annotations

import argparse

from multidrop.base.feature import Feature
from multidrop.shell.operations import arguments
from multidrop.shell.operations.operation import Operation


def _convert(chosen: argparse.Namespace) -> int:
    from multidrop.features.convert.command import run

    return run(chosen)


FEATURE = Feature(
    "convert",
    "a program file for other drives",
    adds=(
        Operation(
            command="program convert",
            meaning="make a program file into one for other drives, name each change, and run both beside each other",
            run=_convert,
            arguments={
                "FILE": arguments.titles,
                "--to DRIVES": arguments.converted,
                "--personality P": {
                    "help": "the product of these drives (default: the usual one)",
                    "type": str.upper,
                },
                "-o|--output FILE2": {
                    "help": "the new file; -: standard output",
                    "required": True,
                },
                "--until SECONDS": {
                    "help": "virtual seconds of each run (default: 5)",
                    "type": arguments.duration,
                    "default": 5.0,
                },
            },
            after="program sweep",
        ),
    ),
)
