"""`multidrop program sweep`: a program test in many worlds, and a report of those in which a condition does not hold.

A signal ends the sweep: what is done is reported, with exit code 130. Cases are reported in their order.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections import deque
from collections.abc import Iterator, Sequence
from datetime import datetime
from functools import partial
from pathlib import Path

from multidrop.base.atomic import write_atomically
from multidrop.base.errors import Diagnostic, TransportLost
from multidrop.base.files import why
from multidrop.base.text import counted
from multidrop.features.sweeps import Sweep, workers
from multidrop.features.sweeps import plan as planning
from multidrop.features.sweeps.answers import SweepAnswer
from multidrop.features.sweeps.failures import FailureGroup, command, grouped, rows
from multidrop.features.sweeps.plan import SweepArguments, SweepPlan
from multidrop.features.sweeps.results import ResultTable
from multidrop.features.sweeps.trial import Case, TrialResult, bench
from multidrop.features.sweeps.variation import SEED, spelled
from multidrop.shell import configuration
from multidrop.shell.batch.report import Case as JUnitCase
from multidrop.shell.batch.report import JUnitFile, check_place
from multidrop.shell.exit_codes import INTERRUPTED
from multidrop.shell.signals import Interruption
from multidrop.shell.streams.stdout import StatusLine, fail, write


def run(file: str, sweep: Sweep) -> int:
    asked = SweepArguments(
        file,
        sweep.cell,
        sweep.language,
        sweep.vary,
        sweep.expect,
        sweep.run,
        sweep.until,
        sweep.random,
        sweep.seed,
        sweep.search,
    )
    plan = planning.make(asked)
    if sweep.svg:
        if sweep.search or sum(value.count > 1 for value in plan.values) < 2:
            raise Diagnostic("shows two keys with several values each", f"--svg {sweep.svg}", "vary a second key")
        check_place(sweep.svg, "--svg", b"<svg", "picture")
    if sweep.junit:  # before the tables are made
        check_place(sweep.junit, "--junit", b"<testsuite", "JUnit report")
    table = ResultTable(plan, sweep.csv, sweep.parquet, sweep.resume)
    report = SweepReport(plan, table, as_json=sweep.json, junit=sweep.junit, svg=sweep.svg)
    with Interruption() as interruption:
        try:
            if sweep.cluster:
                agree = partial(_agree, sweep.cluster, sweep.yes, workers.TRUST, interruption)
                rounds = (map(plan.case, todo) for todo in report.rounds())
                report.take_all(workers.cluster_results(plan.job, rounds, sweep.cluster, interruption, agree))
            else:
                jobs = sweep.jobs or workers.cores()
                for todo in report.rounds():
                    cases = map(plan.case, todo)
                    report.take_all(workers.results(plan.job, cases, len(todo), jobs, interruption, say=report.say))
        except KeyboardInterrupt:
            return report.finish(interruption, INTERRUPTED)
        except (Diagnostic, TransportLost) as problem:
            report.erase()
            return report.finish(interruption, fail(problem))
        return report.finish(interruption, 0)


def _agree(address: str, yes: bool, what: str, interruption: Interruption) -> None:
    """Return once a person has agreed to a cluster: by `--yes`, now, or before. Raises Diagnostic."""
    known = configuration.load().section("sweep")
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
PROGRESS_PERIOD = 0.1
"""The shortest time between two reports of progress, s."""
SEARCH, LATE_SEARCH = 10.0, 1.0
"""The time in which simpler worlds are looked for, s; and after an early end."""


class SweepReport:
    """The reports of one sweep. Raises Diagnostic for a JUnit file that cannot be written."""

    def __init__(self, plan: SweepPlan, table: ResultTable, *, as_json: bool, junit: str, svg: str) -> None:
        self._plan, self._table, self._json, self._svg = plan, table, as_json, svg
        self._begun, self._began = datetime.now().astimezone(), time.perf_counter()
        self._junit = JUnitFile(junit, plan.asked.file, self._begun)
        self._junit.begin()
        self._status = StatusLine()
        self._shown_at = 0.0
        self._results = dict(table.known)
        self._awaited: deque[int] = deque()
        """The cases of the round that are not reported yet."""
        self._cut: bool
        """The sweep ended early; `finish` knows."""
        self._said: set[str] = set()
        self._reported: list[int] = []
        self._failed: dict[int, TrialResult] = {}
        if table.known:
            write(sys.stderr, f"{counted(len(table.known), 'case')} of {plan.count} are in the file already")
        if not as_json:
            asked = plan.asked
            if asked.draws is not None:
                write(sys.stderr, f"{asked.draws} draws with --seed {asked.seed}")
            if any(key.part == SEED for key in plan.job.keys):
                write(sys.stderr, "seed changes the faults of a wire only, and a program test has no wire")

    def rounds(self) -> Iterator[list[int]]:
        """Yield the cases to run, in rounds: without those whose results are known."""
        for numbers in self._plan.rounds(self._results):
            self._awaited.extend(numbers)
            self._report_ready()
            yield [number for number in numbers if number not in self._results]

    def take_all(self, results: Iterator[list[TrialResult]]) -> None:
        """Take results as they come; report each once all before it are done."""
        for chunk in results:
            for result in chunk:
                self._results[result.number] = result
                self._table.take(result)
            self._report_ready()
            self._table.save()
            self._progress()

    def _report_ready(self) -> None:
        while self._awaited and self._awaited[0] in self._results:
            self._take(self._results[self._awaited.popleft()])

    def _take(self, result: TrialResult) -> None:
        self._reported.append(result.number)
        if not result.ok:
            self._failed[result.number] = result
        if self._json:
            settings = self._plan.settings(self._plan.case(result.number))
            fact = {"case": result.number, "set": settings, "ok": result.ok, "why": result.why}
            write(sys.stdout, json.dumps(fact))

    def _progress(self) -> None:
        now = time.perf_counter()
        done, count, new = len(self._results), self._plan.runs, len(self._results) - len(self._table.known)
        if now - self._shown_at < PROGRESS_PERIOD or done >= count:
            return
        self._shown_at = now
        left = (now - self._began) / max(new, 1) * (count - done)
        failed = sum(not result.ok for result in self._results.values())
        self._status.show(f"{done} of {counted(count, 'case')}, {failed} failed, {_time(left)} left")

    def erase(self) -> None:
        self._status.erase()

    def say(self, text: str) -> None:
        """Print a line about the whole sweep, once."""
        if text not in self._said:
            self._said.add(text)
            self.erase()
            write(sys.stderr, text)

    def finish(self, interruption: Interruption, code: int) -> int:
        """Report the rest; return the exit code, `code` unless that is 0 and a case failed."""
        for number in [each for each in self._awaited if each in self._results]:
            self._take(self._results[number])
        seconds = time.perf_counter() - self._began
        interruption.came = False  # the next signal ends the search
        groups = self._groups(interruption, LATE_SEARCH if code else SEARCH)
        interrupted = interruption.came  # later the reader of the output may leave
        self.erase()
        self._cut = bool(code)
        answer = None if self._json and not self._svg else self._answer()
        code = self._kept(answer, code)
        if code not in (0, INTERRUPTED) and not self._reported:
            return self._finish_junit(groups, seconds, code)
        if self._json:
            summary = {"cases": len(self._reported), "failed": len(self._failed), "seconds": round(seconds, 3)}
            write(sys.stdout, json.dumps({"summary": summary}))
        elif answer is not None:
            write(sys.stdout, *answer.rows(), *answer.map() if not (colours := _colours()) else ())
            write(sys.stdout, *answer.map(colours=True) if colours else (), styled=True)
            write(sys.stdout, *answer.boundary())
            if groups:
                write(sys.stdout, *rows(self._plan, groups, len(self._failed)))
            write(sys.stdout, f"{self._counted}, {len(self._failed)} failed, {seconds:.1f} s")
        if self._cut:
            write(sys.stderr, f"ended after {self._counted} of {self._plan.runs}; the others were not run")
        elif interrupted:
            write(sys.stderr, "interrupted while simpler worlds were looked for")
        return self._finish_junit(groups, seconds, code or (FAILED if self._failed else 0))

    def _answer(self) -> SweepAnswer:
        reported = {number: self._results[number] for number in self._reported}
        return SweepAnswer(self._plan, reported, self._plan.asked.search)

    def _kept(self, answer: SweepAnswer | None, code: int) -> int:
        """Write the table and the picture; return the exit code."""
        try:
            self._table.save(now=True)
            if answer is not None and self._svg:
                if not (picture := answer.svg()):
                    raise Diagnostic("too few cases ran for a picture", self._svg)
                write_atomically(Path(self._svg), picture.encode())
        except OSError as problem:
            return code or fail(Diagnostic(f"cannot be written: {why(problem)}", self._svg))
        except Diagnostic as problem:
            wrong = fail(problem)
            return code or wrong
        return code

    @property
    def _counted(self) -> str:
        return counted(len(self._reported), "case")

    def _groups(self, interruption: Interruption, seconds: float) -> list[FailureGroup]:
        """Put failures into groups; look for simpler worlds in this time, until there is a signal."""
        ready, until = bench(self._plan.job), time.perf_counter() + seconds

        def run(case: Case) -> TrialResult | None:
            if time.perf_counter() > until:
                return None
            self._status.show(f"{len(self._failed)} of {self._counted} failed; looking for the simplest worlds")
            try:
                with interruption.open():
                    return ready.tried(case)
            except KeyboardInterrupt:
                return None

        return grouped(self._plan, self._failed.values(), run)

    def _finish_junit(self, groups: Sequence[FailureGroup], seconds: float, code: int) -> int:
        if not self._junit.wanted:
            return code
        commands = {
            number: command(self._plan, group.world, group.failed) for group in groups for number in group.numbers
        }
        cases = [self._junit_case(number, commands) for number in self._reported]
        if self._cut:
            file = self._plan.asked.file
            cases.append(JUnitCase(file, file, error=f"ended after {self._counted} of {self._plan.runs}"))
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


def _colours() -> bool:
    """Whether standard output shows colours."""
    plain = "NO_COLOR" in os.environ or os.environ.get("TERM") == "dumb" or sys.platform == "win32"
    return sys.stdout.isatty() and not plain


def _time(seconds: float) -> str:
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    return f"{whole // 60} min {whole % 60} s" if whole < 3600 else f"{whole // 3600} h {whole % 3600 // 60} min"
