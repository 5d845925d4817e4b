"""What a session log tells: a moment, the first difference of two runs, breaches of rules, the same lines again."""

from __future__ import annotations

import argparse

from multidrop.base.feature import Feature
from multidrop.shell.operations.operation import Operation


def _at(chosen: argparse.Namespace) -> int:
    from multidrop.features.log_analysis import command

    return command.at(chosen)


def _bisect(chosen: argparse.Namespace) -> int:
    from multidrop.features.log_analysis import command

    return command.bisect(chosen)


def _judge(chosen: argparse.Namespace) -> int:
    from multidrop.features.log_analysis import command

    return command.judge(chosen)


def _replay(chosen: argparse.Namespace) -> int:
    from multidrop.features.log_analysis import command

    return command.replay(chosen)


FEATURE = Feature(
    "log_analysis",
    "a moment of a log, two runs compared, a log judged or replayed",
    adds=(
        Operation(
            command="log at",
            meaning="print what was known at a moment: states, and the last lines and samples of each drive",
            run=_at,
            examples=(
                "log at 11:37:05.2",
                "log at '2026-11-22 11:37:05' day.jsonl",
            ),
            arguments={
                "TIME": "a time of day (the last one in the log), or a date and a time",
                "[FILE]": "a session log (default: the newest)",
                "--json": "print one JSON object a line: the moment, then entries as they are in the file",
            },
            after="log grep",
        ),
        Operation(
            command="log bisect",
            meaning="find the first difference between two runs; exit code 0: there is none, 1: there is one",
            run=_bisect,
            examples=("log bisect monday.jsonl tuesday.jsonl",),
            arguments={
                "FILE1": "a session log; its last session counts",
                "FILE2": "the log of another run",
                "--json": "print one JSON object",
            },
            after="log at",
        ),
        Operation(
            command="log judge",
            meaning="check a session log by the rules of a session; exit code 0: all held, 1: one broke",
            run=_judge,
            examples=(
                "log judge day.jsonl",
                "log judge day.jsonl --json",
            ),
            arguments={
                "FILE": "a session log; its older parts belong to it",
                "--json": "print one JSON object a breach",
            },
            after="log bisect",
        ),
        Operation(
            command="log replay",
            meaning="send the lines of a session log to other drives and print where the answers differ; asks first",
            run=_replay,
            examples=(
                "log replay day.jsonl --against machine.toml --fast",
                "log replay day.jsonl --to sim:",
            ),
            arguments={
                "FILE": "a session log; its last session is replayed",
                "--to | --against": {
                    "--to URL": "what to open",
                    "--against CELL": "a cell file (TOML), in virtual time",
                },
                "--fast": "leave out the pauses between lines",
                "--json": "print one JSON object a difference, and a summary",
                "--yes": "answer every question with yes beforehand",
            },
            after="log judge",
        ),
    ),
)
