"""Load, friction, inertia and current margin of axes, found in a session log."""

from __future__ import annotations

import argparse

from multidrop.base.feature import Feature
from multidrop.shell.operations.operation import Operation


def _fit(chosen: argparse.Namespace) -> int:
    from multidrop.features.twin_fit.command import run

    return run(chosen)


FEATURE = Feature(
    "twin_fit",
    "load, friction and current margin of axes from a log",
    adds=(
        Operation(
            command="twin fit",
            meaning="find load, friction, inertia and current margin of drives in a session log; put them into a cell",
            run=_fit,
            examples=(
                "twin fit day.jsonl --cell machine.toml",
                "twin fit day.jsonl --cell machine.toml --json",
            ),
            arguments={
                "LOG": "a session log; its last session is used",
                "--cell CELL": {
                    "help": "the cell file (TOML) with the drives and their motors; the values go into it",
                    "required": True,
                },
                "--json": "print one JSON object a value",
            },
            after="twin",
        ),
        Operation(
            command="twin",
            meaning="fit the drives of a cell to a session log",
            after="snapshot",
        ),
    ),
    extras={"fit": "scipy"},
)
