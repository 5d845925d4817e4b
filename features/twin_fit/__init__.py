"""Load, friction, inertia and current margin of axes, found in a session log."""

from __future__ import annotations

from typing import Annotated

from multidrop.base.feature import Feature
from multidrop.shell.operations.operation import Operation
from multidrop.shell.operations.parameter import Argument, Listed

Log = Annotated[str, Argument("a session log; its last session is used", listed=(Listed.FILE,))]
Cell = Annotated[
    str,
    Argument("the cell file (TOML) with the drives and their motors; the values go into it", listed=(Listed.FILE,)),
]
ValuesAsJson = Annotated[bool, Argument("print one JSON object a value")]


def _fit(log: Log, *, cell: Cell, json: ValuesAsJson = False) -> int:
    from multidrop.features.twin_fit.command import run

    return run(log, cell, json)


FEATURE = Feature(
    "twin_fit",
    "load, friction and current margin of axes from a log",
    adds=(
        Operation(
            _fit,
            command="twin fit",
            meaning="find load, friction, inertia and current margin of drives in a session log; put them into a cell",
            examples=(
                "twin fit day.jsonl --cell machine.toml",
                "twin fit day.jsonl --cell machine.toml --json",
            ),
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
