"""`multidrop program sweep`: a program test in many worlds, and a report of those in which a condition does not hold.

A signal ends the sweep: what is done is reported, with exit code 130. Cases are reported in their order.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator, Sequence
from datetime import datetime
from functools import partial

from multidrop.commands import fail
from multidrop.dialects import Diagnostic
from multidrop.dialects.text import counted
from multidrop.shell import configuration
from multidrop.shell.batch.report import Case as JUnitCase
from multidrop.shell.batch.report import JUnitFile
from multidrop.shell.exit_codes import INTERRUPTED
from multidrop.shell.signals import Interruption
from multidrop.shell.streams.stdout import StatusLine, write
from multidrop.shell.sweeps import plan as planning
from multidrop.shell.sweeps import workers
from multidrop.shell.sweeps.failures import Group, command, grouped, rows
from multidrop.shell.sweeps.plan import Asked, Plan
from multidrop.shell.sweeps.trial import Case, Result, bench
from multidrop.shell.sweeps.variation import SEED, spelled
from multidrop.transports import TransportLost


def run(chosen: argparse.Namespace) -> int:
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
    plan = planning.make(asked)
    report = Report(plan, as_json=chosen.json, junit=chosen.junit)
    with Interruption() as interruption:
        try:
            cases = (plan.case(number) for number in range(1, plan.count + 1))
            if chosen.cluster:
                agree = partial(_agree, chosen.cluster, chosen.yes, workers.TRUST, interruption)
                results = workers.cluster_results(plan.job, cases, chosen.cluster, interruption, agree)
            else:
                jobs = chosen.jobs or workers.cores()
                results = workers.results(plan.job, cases, plan.count, jobs, interruption)
            report.take_all(results)
        except KeyboardInterrupt:
            return report.finish(interruption, INTERRUPTED)
        except (Diagnostic, TransportLost) as problem:
            report.erase()
            return report.finish(interruption, fail(problem))
        return report.finish(interruption, 0)


def _agree(address: str, yes: bool, what: str, interruption: Interruption) -> None:
    """Return once a person has agreed to a cluster: by `--yes`, now, or before. Raises Diagnostic."""
    known = configuration.load().clusters
    if yes or address in known:
        return
    import asyncio

    from multidrop.shell.prompt.terminal_input import ask_outside_a_session

    where = f"--cluster {address}"
    with interruption.open():
        answer = asyncio.run(ask_outside_a_session(f"{where}: {what}"))
    if answer is None:
        raise Diagnostic(f"{what}; nothing was connected", where, "--yes agrees to it")
    if not answer:
        raise Diagnostic("the answer was no, so nothing was connected", where)
    path = configuration.keep("sweep", "clusters", [*known, address])
    write(sys.stderr, f"{path}: sweep.clusters has {address} from now on")


FAILED = 1
PERIOD = 0.1
"""The shortest time between two reports of progress, s."""
SEARCH, LATE_SEARCH = 10.0, 1.0
"""The time in which simpler worlds are looked for, s; and after an early end."""


class Report:
    """The reports of one sweep. Raises Diagnostic for a JUnit file that cannot be written."""

    def __init__(self, plan: Plan, *, as_json: bool, junit: str) -> None:
        self._plan, self._json = plan, as_json
        self._begun, self._began = datetime.now().astimezone(), time.perf_counter()
        self._junit = JUnitFile(junit, plan.asked.file, self._begun)
        self._junit.begin()
        self._status = StatusLine()
        self._shown_at = 0.0
        self._early: dict[int, Result] = {}
        """Results of which a case before them is not done."""
        self._next = 1
        self._reported: list[int] = []
        self._failed: dict[int, Result] = {}
        if not as_json:
            asked = plan.asked
            if asked.draws is not None:
                write(sys.stderr, f"{asked.draws} draws with --seed {asked.seed}")
            if any(key.part == SEED for key in plan.job.keys):
                write(sys.stderr, "seed changes the faults of a wire only, and a program test has no wire")

    def take_all(self, results: Iterator[list[Result]]) -> None:
        """Take results as they come; report each once all before it are done."""
        for chunk in results:
            self._early.update((each.number, each) for each in chunk)
            while self._next in self._early:
                self._take(self._early.pop(self._next))
                self._next += 1
            self._progress()

    def _take(self, result: Result) -> None:
        self._reported.append(result.number)
        if not result.ok:
            self._failed[result.number] = result
        if self._json:
            settings = self._plan.settings(self._plan.case(result.number))
            fact = {"case": result.number, "set": settings, "ok": result.ok, "why": result.why}
            write(sys.stdout, json.dumps(fact))

    def _progress(self) -> None:
        now = time.perf_counter()
        done, count = len(self._reported) + len(self._early), self._plan.count
        if now - self._shown_at < PERIOD or done == count:
            return
        self._shown_at = now
        left = (now - self._began) / done * (count - done)
        failed = sum(not each.ok for each in self._early.values()) + len(self._failed)
        self._status.show(f"{done} of {counted(count, 'case')}, {failed} failed, {_time(left)} left")

    def erase(self) -> None:
        self._status.erase()

    def finish(self, interruption: Interruption, code: int) -> int:
        """Report the rest; return the exit code, `code` unless that is 0 and a case failed."""
        for number in sorted(self._early):
            self._take(self._early.pop(number))
        seconds = time.perf_counter() - self._began
        interruption.came = False  # the next signal ends the search
        groups = self._groups(interruption, LATE_SEARCH if code else SEARCH)
        self.erase()
        if code not in (0, INTERRUPTED) and not self._reported:
            return self._finish_junit(groups, seconds, code)
        if self._json:
            summary = {"cases": len(self._reported), "failed": len(self._failed), "seconds": round(seconds, 3)}
            write(sys.stdout, json.dumps({"summary": summary}))
        else:
            if groups:
                write(sys.stdout, *rows(self._plan, groups, len(self._failed)))
            write(sys.stdout, f"{self._counted}, {len(self._failed)} failed, {seconds:.1f} s")
        if code:
            write(sys.stderr, f"ended after {self._counted} of {self._plan.count}; the others were not run")
        elif interruption.came:
            write(sys.stderr, "interrupted while simpler worlds were looked for")
        return self._finish_junit(groups, seconds, code or (FAILED if self._failed else 0))

    @property
    def _counted(self) -> str:
        return counted(len(self._reported), "case")

    def _groups(self, interruption: Interruption, seconds: float) -> list[Group]:
        """Put failures into groups; look for simpler worlds in this time, until there is a signal."""
        ready, until = bench(self._plan.job), time.perf_counter() + seconds

        def run(case: Case) -> Result | None:
            if time.perf_counter() > until:
                return None
            self._status.show(f"{len(self._failed)} of {self._counted} failed; looking for the simplest worlds")
            try:
                with interruption.open():
                    return ready.tried(case)
            except KeyboardInterrupt:
                return None

        return grouped(self._plan, self._failed.values(), run)

    def _finish_junit(self, groups: Sequence[Group], seconds: float, code: int) -> int:
        if not self._junit.wanted:
            return code
        commands = {
            number: command(self._plan, group.world, group.failed) for group in groups for number in group.numbers
        }
        cases = [self._junit_case(number, commands) for number in self._reported]
        if len(cases) < self._plan.count:
            file = self._plan.asked.file
            cases.append(JUnitCase(file, file, error=f"ended after {self._counted} of {self._plan.count}"))
        try:
            self._junit.write(cases, seconds)
        except Diagnostic as problem:
            wrong = fail(problem)
            return code or wrong
        return code

    def _junit_case(self, number: int, commands: dict[int, str]) -> JUnitCase:
        case = self._plan.case(number)
        values = " ".join(f"{name}={spelled(value)}" for name, value in self._plan.settings(case).items())
        name = f"case {number}: {values}".removesuffix(": ")
        result = self._failed.get(number)
        if result is None:
            return JUnitCase(name, self._plan.asked.file)
        repeat = commands.get(number) or command(self._plan, tuple(case[1]), result.failed)
        failure, error = (result.why, "") if result.failed >= 0 else ("", result.why)
        return JUnitCase(name, self._plan.asked.file, failure=failure, error=error, printed=(repeat,))


def _time(seconds: float) -> str:
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    return f"{whole // 60} min {whole % 60} s" if whole < 3600 else f"{whole // 3600} h {whole % 3600 // 60} min"
