"""Program files made into ones for other drives, and both run beside each other."""

from __future__ import annotations

from typing import Annotated

from multidrop.base.feature import Feature
from multidrop.shell.operations import arguments
from multidrop.shell.operations.argument_types import ProgramFile
from multidrop.shell.operations.operation import Operation
from multidrop.shell.operations.parameter import Argument, Listed

For = Annotated[
    str, Argument("what the new file is for: %(choices)s", metavar="DRIVES", choices=arguments.converter_names)
]
Product = Annotated[
    str | None, Argument("the product of these drives (default: the usual one)", metavar="P", read=str.upper)
]
NewFile = Annotated[
    str, Argument("the new file; -: standard output", metavar="FILE2", listed=(Listed.FILE,), short="-o")
]
Until = Annotated[
    float, Argument("virtual seconds of each run (default: 5)", metavar="SECONDS", read=arguments.duration)
]


def _convert(file: ProgramFile, *, to: For, personality: Product = None, output: NewFile, until: Until = 5.0) -> int:
    from multidrop.features.convert.command import run

    return run(file, to, personality, output, until)


FEATURE = Feature(
    "convert",
    "a program file for other drives",
    adds=(
        Operation(
            _convert,
            command="program convert",
            meaning="make a program file into one for other drives, name each change, and run both beside each other",
            after="program sweep",
        ),
    ),
)
