"""`multidrop program sweep`: a program test in many worlds, and a report of those in which a condition does not hold.

A signal ends the sweep: what is done is reported, with exit code 130.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from functools import partial

from multidrop.commands.failure import fail
from multidrop.commands.sweep_report import Report
from multidrop.dialects import Diagnostic
from multidrop.shell.connect import settings
from multidrop.shell.output import INTERRUPTED, write
from multidrop.shell.sweeps import plan as planning
from multidrop.shell.sweeps import workers
from multidrop.shell.sweeps.interruption import Interruption
from multidrop.shell.sweeps.plan import Asked, Plan
from multidrop.shell.sweeps.trial import Result
from multidrop.transports import TransportLost


def run(chosen: argparse.Namespace) -> int:
    """Check everything, run the cases, report; return the exit code."""
    asked = Asked(
        chosen.file,
        chosen.cell,
        chosen.language or "",
        chosen.vary,
        chosen.expect,
        chosen.run,
        chosen.until,
        chosen.random,
        chosen.seed,
    )
    try:
        plan = planning.make(asked)
        report = Report(plan, as_json=chosen.json, junit=chosen.junit)
    except Diagnostic as problem:
        return fail(problem)
    with Interruption() as interruption:
        try:
            report.take_all(_results(plan, chosen, interruption))
        except KeyboardInterrupt:
            return report.finish(interruption, INTERRUPTED)
        except (Diagnostic, TransportLost) as problem:
            report.erase()
            return report.finish(interruption, fail(problem))
        return report.finish(interruption, 0)


def _results(plan: Plan, chosen: argparse.Namespace, interruption: Interruption) -> Iterator[list[Result]]:
    cases = (plan.case(number) for number in range(1, plan.count + 1))
    if chosen.cluster:
        from multidrop.shell.sweeps import cluster

        agree = partial(_agree, chosen.cluster, chosen.yes, cluster.TRUST, interruption)
        return cluster.results(plan.job, cases, chosen.cluster, interruption, agree)
    jobs = chosen.jobs or workers.cores()
    return workers.results(plan.job, cases, plan.count, jobs, interruption)


def _agree(address: str, yes: bool, what: str, interruption: Interruption) -> None:
    """Return once a person has agreed to a cluster: by `--yes`, now, or before. Raises Diagnostic."""
    known = settings.load().clusters
    if yes or address in known:
        return
    import asyncio

    from multidrop.shell.front.terminal_input import ask_outside_a_session

    where = f"--cluster {address}"
    with interruption.open():
        answer = asyncio.run(ask_outside_a_session(f"{where}: {what}"))
    if answer is None:
        raise Diagnostic(f"{what}; nothing was connected", where, "--yes agrees to it")
    if not answer:
        raise Diagnostic("the answer was no, so nothing was connected", where)
    path = settings.keep("sweep", "clusters", [*known, address])
    write(sys.stderr, f"{path}: sweep.clusters has {address} from now on")
