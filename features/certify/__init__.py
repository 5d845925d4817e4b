"""Certificates: what a drive answers to the questions that our rulings leave open."""

from __future__ import annotations

import argparse

from multidrop.base.feature import Feature
from multidrop.shell.operations import arguments
from multidrop.shell.operations.operation import Operation


def _certify(chosen: argparse.Namespace) -> int:
    from multidrop.features.certify.command import run

    return run(chosen)


FEATURE = Feature(
    "certify",
    "a report of what a drive answers, and two drives compared by it",
    adds=(
        Operation(
            command="certify",
            meaning=(
                "ask a drive the questions that our rulings leave open, for a report; or compare a drive with a report"
            ),
            run=_certify,
            examples=(
                "certify press --drive a -o report.toml",
                "certify 'sim:#press' --drive a -o report.toml --yes",
                "certify --compare report.toml 'sim:#press' --drive a",
            ),
            arguments={
                "URL": "what to open",
                "--drive ADDR": {
                    "help": "the drive (default: the first); may be repeated",
                    "action": arguments.Several,
                },
                "-o | --compare": {
                    "-o|--output FILE": "the new report; -: standard output",
                    "--compare FILE": (
                        "print where the answers differ from this report; exit code 0: nowhere, 1: somewhere"
                    ),
                },
                "--yes": "agree to small moves beforehand; without, a terminal is asked",
            },
            after="snapshot",
        ),
    ),
)
