"""What a session log tells: a moment, the first difference of two runs, breaches of rules, the same lines again."""

from __future__ import annotations

from typing import Annotated

from multidrop.base.feature import Feature
from multidrop.shell.operations.argument_types import Yes
from multidrop.shell.operations.operation import Operation
from multidrop.shell.operations.parameter import Argument, Listed, OneOf

AGAINST = OneOf("against", required=True)
FILE = (Listed.FILE,)
Moment = Annotated[str, Argument("a time of day (the last one in the log), or a date and a time", metavar="TIME")]
AnyLog = Annotated[str, Argument("a session log (default: the newest)", metavar="FILE", listed=FILE)]
MomentAsJson = Annotated[
    bool, Argument("print one JSON object a line: the moment, then entries as they are in the file")
]
Log1 = Annotated[str, Argument("a session log; its last session counts", listed=FILE)]
Log2 = Annotated[str, Argument("the log of another run", listed=FILE)]
AsJson = Annotated[bool, Argument("print one JSON object")]
Judged = Annotated[str, Argument("a session log; its older parts belong to it", metavar="FILE", listed=FILE)]
BreachesAsJson = Annotated[bool, Argument("print one JSON object a breach")]
Replayed = Annotated[str, Argument("a session log; its last session is replayed", metavar="FILE", listed=FILE)]
To = Annotated[str, Argument("what to open", metavar="URL", listed=(Listed.URL,), one_of=AGAINST)]
Cell = Annotated[str, Argument("a cell file (TOML), in virtual time", metavar="CELL", listed=FILE, one_of=AGAINST)]
Fast = Annotated[bool, Argument("leave out the pauses between lines")]
DifferencesAsJson = Annotated[bool, Argument("print one JSON object a difference, and a summary")]


def _at(time: Moment, file: AnyLog = "", *, json: MomentAsJson = False) -> int:
    from multidrop.features.log_analysis import command

    return command.at(time, file, json)


def _bisect(file1: Log1, file2: Log2, *, json: AsJson = False) -> int:
    from multidrop.features.log_analysis import command

    return command.bisect(file1, file2, json)


def _judge(file: Judged, *, json: BreachesAsJson = False) -> int:
    from multidrop.features.log_analysis import command

    return command.judge(file, json)


def _replay(
    file: Replayed,
    *,
    to: To = "",
    against: Cell = "",
    fast: Fast = False,
    json: DifferencesAsJson = False,
    yes: Yes = False,
) -> int:
    from multidrop.features.log_analysis import command

    return command.replay(file, to, against, fast, json, yes)


FEATURE = Feature(
    "log_analysis",
    "a moment of a log, two runs compared, a log judged or replayed",
    adds=(
        Operation(
            _at,
            command="log at",
            meaning="print what was known at a moment: states, and the last lines and samples of each drive",
            examples=(
                "log at 11:37:05.2",
                "log at '2026-11-22 11:37:05' day.jsonl",
            ),
            after="log grep",
        ),
        Operation(
            _bisect,
            command="log bisect",
            meaning="find the first difference between two runs; exit code 0: there is none, 1: there is one",
            examples=("log bisect monday.jsonl tuesday.jsonl",),
            after="log at",
        ),
        Operation(
            _judge,
            command="log judge",
            meaning="check a session log by the rules of a session; exit code 0: all held, 1: one broke",
            examples=(
                "log judge day.jsonl",
                "log judge day.jsonl --json",
            ),
            after="log bisect",
        ),
        Operation(
            _replay,
            command="log replay",
            meaning="send the lines of a session log to other drives and print where the answers differ; asks first",
            examples=(
                "log replay day.jsonl --against machine.toml --fast",
                "log replay day.jsonl --to sim:",
            ),
            after="log judge",
        ),
    ),
)
