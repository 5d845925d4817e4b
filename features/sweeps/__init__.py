"""Sweeps: a program test in many worlds, on all cores or on a cluster; what failed, and the simplest such world."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from multidrop.base.feature import Feature
from multidrop.shell.operations import arguments
from multidrop.shell.operations.argument_types import ProgramFile, ProgramLanguage, RunLabel, Yes
from multidrop.shell.operations.operation import Operation
from multidrop.shell.operations.parameter import Argument, Listed, OneOf
from multidrop.shell.sections import Section, text_list

CASES, WHERE = OneOf("cases"), OneOf("where")
FILE = (Listed.FILE,)


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """What is swept, where it runs, and what is written."""

    language: ProgramLanguage = ""
    cell: Annotated[
        str | None,
        Argument(
            "the drive that runs the program, and its world: CELL, CELL#BUS or CELL#BUS:NAME (default: the only drive, "
            "or the one that --vary names)",
            listed=FILE,
        ),
    ] = None
    vary: Annotated[
        tuple[tuple[str, str], ...],
        Argument(
            "KEY: DRIVE.KEY, KEY with one drive (of its world, else a parameter), or seed; VALUES: a,b,c or A..B or "
            "A..B:STEP; may be repeated",
            metavar="KEY=VALUES",
            read=arguments.key_and_values,
        ),
    ] = ()
    expect: Annotated[
        tuple[str, ...],
        Argument(
            "a comparison with position, errors, prints, virtual_s or ended; all must hold; may be repeated (default: "
            "errors == [])",
            metavar="CONDITION",
        ),
    ] = ()
    random: Annotated[
        int | None, Argument("draw N cases, in place of all", metavar="N", read=arguments.count, one_of=CASES)
    ] = None
    search: Annotated[
        str,
        Argument(
            "find where KEY begins to fail by halving its range, for the values of the others",
            metavar="KEY",
            one_of=CASES,
        ),
    ] = ""
    seed: Annotated[int, Argument("the seed of these draws (default: 1)", metavar="N")] = 1
    run: RunLabel = ""
    until: Annotated[
        float | None,
        Argument(
            "virtual seconds of a case at most; without it, a case that still runs after 60 s has failed",
            metavar="SECONDS",
            read=arguments.duration,
        ),
    ] = None
    jobs: Annotated[
        int | None,
        Argument("processes (default: as many as there are cores)", metavar="N", read=arguments.count, one_of=WHERE),
    ] = None
    cluster: Annotated[
        str,
        Argument("the scheduler of a Dask cluster, which runs the cases", metavar="tcp://HOST:PORT", one_of=WHERE),
    ] = ""
    yes: Yes = False
    json: Annotated[bool, Argument("print one JSON object a case, and a summary")] = False
    junit: Annotated[str, Argument("write the cases to a JUnit XML file", metavar="FILE", listed=FILE)] = ""
    csv: Annotated[
        str,
        Argument("write a table with a row for each case: values, result, seed, versions", metavar="FILE", listed=FILE),
    ] = ""
    parquet: Annotated[str, Argument("write the same table as Parquet", metavar="FILE", listed=FILE)] = ""
    resume: Annotated[
        str,
        Argument(
            "take the results in such a table, run the other cases, and keep all in it", metavar="FILE", listed=FILE
        ),
    ] = ""
    svg: Annotated[str, Argument("draw what passed at the values of two keys", metavar="FILE", listed=FILE)] = ""


def _sweep(file: ProgramFile, *, sweep: Sweep) -> int:
    from multidrop.features.sweeps.command import run

    return run(file, sweep)


FEATURE = Feature(
    "sweeps",
    "a program test in many simulated worlds",
    adds=(
        Operation(
            _sweep,
            command="program sweep",
            meaning="run a program file in many simulated worlds, and show those in which a condition does not hold",
            examples=(
                'program sweep shuttle.mxt --cell press.toml --vary "b.load=0..1.2:0.1" --expect "errors == []"',
                'program sweep shuttle.mxt --cell press.toml --vary "b.stall_at=1..90000" --random 500 '
                "--junit sweep.xml",
                'program sweep shuttle.mxt --vary "load=0..2:0.001" --vary RC=25,50,75 --search load --csv sweep.csv',
                'program sweep shuttle.mxt --vary VM=20000..80000:5000 --expect "virtual_s < 2" --cluster tcp://pc:8786',
            ),
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
