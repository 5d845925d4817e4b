"""Sweeps: a program test in many worlds, on all cores or on a cluster; what failed, and the simplest such world."""

from __future__ import annotations

import argparse

from multidrop.base.feature import Feature
from multidrop.shell.operations import arguments
from multidrop.shell.operations.operation import Operation
from multidrop.shell.sections import Section, text_list


def _sweep(chosen: argparse.Namespace) -> int:
    from multidrop.features.sweeps.command import run

    return run(chosen)


FEATURE = Feature(
    "sweeps",
    "a program test in many simulated worlds",
    adds=(
        Operation(
            command="program sweep",
            meaning="run a program file in many simulated worlds, and show those in which a condition does not hold",
            run=_sweep,
            examples=(
                'program sweep shuttle.mxt --cell press.toml --vary "b.load=0..1.2:0.1" --expect "errors == []"',
                'program sweep shuttle.mxt --cell press.toml --vary "b.stall_at=1..90000" --random 500 '
                "--junit sweep.xml",
                'program sweep shuttle.mxt --vary "load=0..2:0.001" --vary RC=25,50,75 --search load --csv sweep.csv',
                'program sweep shuttle.mxt --vary VM=20000..80000:5000 --expect "virtual_s < 2" --cluster tcp://pc:8786',
            ),
            arguments={
                "FILE": arguments.titles,
                "--language": arguments.language,
                "--cell CELL": {
                    "help": (
                        "the drive that runs the program, and its world: CELL, CELL#BUS or CELL#BUS:NAME (default: "
                        "the only drive, or the one that --vary names)"
                    ),
                    "default": None,
                },
                "--vary KEY=VALUES ...": {
                    "help": (
                        "KEY: DRIVE.KEY, KEY with one drive (of its world, else a parameter), or seed; VALUES: a,b,c "
                        "or A..B or A..B:STEP; may be repeated"
                    ),
                    "type": arguments.key_and_values,
                },
                "--expect CONDITION ...": (
                    "a comparison with position, errors, prints, virtual_s or ended; all must hold; may be repeated "
                    "(default: errors == [])"
                ),
                "[--random | --search]": {
                    "--random N": {
                        "help": "draw N cases, in place of all",
                        "type": arguments.count,
                    },
                    "--search KEY": {
                        "help": "find where KEY begins to fail by halving its range, for the values of the others",
                        "default": "",
                    },
                },
                "--seed N": {
                    "help": "the seed of these draws (default: 1)",
                    "default": 1,
                    "type": int,
                },
                "--run LABEL": "the label or program to execute (default: its own start)",
                "--until SECONDS": {
                    "help": (
                        "virtual seconds of a case at most; without it, a case that still runs after 60 s has failed"
                    ),
                    "type": arguments.duration,
                },
                "[--jobs | --cluster]": {
                    "--jobs N": {
                        "help": "processes (default: as many as there are cores)",
                        "type": arguments.count,
                    },
                    "--cluster tcp://HOST:PORT": "the scheduler of a Dask cluster, which runs the cases",
                },
                "--yes": "answer every question with yes beforehand",
                "--json": "print one JSON object a case, and a summary",
                "--junit FILE": "write the cases to a JUnit XML file",
                "--csv FILE": {
                    "help": "write a table with a row for each case: values, result, seed, versions",
                    "default": "",
                },
                "--parquet FILE": {
                    "help": "write the same table as Parquet",
                    "default": "",
                },
                "--resume FILE": {
                    "help": "take the results in such a table, run the other cases, and keep all in it",
                    "default": "",
                },
                "--svg FILE": {
                    "help": "draw what passed at the values of two keys",
                    "default": "",
                },
            },
            after="program test",
        ),
        Section(
            "sweep",
            ("clusters",),
            "[sweep] with clusters = [...]",
            lambda table, where: text_list(table, "sweep", "clusters", where),
            lambda clusters: {"clusters": list(clusters)},
        ),
    ),
    extras={"cluster": "distributed"},
)
