"""Certificates: what a drive answers to the questions that our rulings leave open."""

from __future__ import annotations

from typing import Annotated

from multidrop.base.feature import Feature
from multidrop.shell.operations import arguments
from multidrop.shell.operations.argument_types import Url
from multidrop.shell.operations.operation import Operation
from multidrop.shell.operations.parameter import Argument, Listed, OneOf

REPORT = OneOf("report", required=True)
Certified = Annotated[
    str,
    Argument(
        "the drive (default: the first); may be repeated",
        metavar="ADDR",
        listed=(Listed.DRIVE,),
        action=arguments.Several,
    ),
]
NewReport = Annotated[
    str,
    Argument("the new report; -: standard output", metavar="FILE", listed=(Listed.FILE,), short="-o", one_of=REPORT),
]
Compared = Annotated[
    str,
    Argument(
        "print where the answers differ from this report; exit code 0: nowhere, 1: somewhere",
        metavar="FILE",
        listed=(Listed.FILE,),
        one_of=REPORT,
    ),
]
SmallMoves = Annotated[bool, Argument("agree to small moves beforehand; without, a terminal is asked")]


def _certify(
    url: Url, *, drive: Certified = "", output: NewReport = "", compare: Compared = "", yes: SmallMoves = False
) -> int:
    from multidrop.features.certify.command import run

    return run(url, drive, output, compare, yes)


FEATURE = Feature(
    "certify",
    "a report of what a drive answers, and two drives compared by it",
    adds=(
        Operation(
            _certify,
            command="certify",
            meaning=(
                "ask a drive the questions that our rulings leave open, for a report; or compare a drive with a report"
            ),
            examples=(
                "certify press --drive a -o report.toml",
                "certify 'sim:#press' --drive a -o report.toml --yes",
                "certify --compare report.toml 'sim:#press' --drive a",
            ),
            after="snapshot",
        ),
    ),
)
