"""The cases of a sweep: on the cores of this machine, or on an existing Dask cluster, without a scheduler of our own.

The first cases run in this process: they say how long one takes. Further processes begin only where that is worth it.

A worker of a cluster that dies takes results along; the cluster runs those chunks again. The cases of a chunk whose
workers died four times run alone, so that the one that kills them is named.
"""

from __future__ import annotations

import os
import re
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import islice
from typing import TYPE_CHECKING, Any

from multidrop.base.errors import Diagnostic, TransportLost
from multidrop.features.sweeps import trial
from multidrop.features.sweeps.trial import DIED, Case, TrialJob, TrialResult
from multidrop.shell.secrets import url_without_secrets
from multidrop.shell.signals import Interruption
from multidrop.transports import Unreachable

if TYPE_CHECKING:
    from distributed import Client, Future, as_completed


CHUNK = 0.075
"""The work of one chunk, s of processor time."""
WORTH = 0.1
"""The work that is worth further processes, s of processor time."""
FIRST_CASES = 3
"""The cases that run in this process first; the last of them is the measure."""
Run = Callable[[TrialJob, Sequence[Case]], list[TrialResult]]


def cores() -> int:
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def results(
    job: TrialJob,
    cases: Iterator[Case],
    count: int,
    jobs: int,
    interruption: Interruption,
    run: Run = trial.chunk,
    say: Callable[[str], None] = lambda text: None,
) -> Iterator[list[TrialResult]]:
    """Run `count` cases in `jobs` processes; yield the results of each chunk as it ends.

    `say` takes one line for a person where no process can be started, and this one runs all cases.
    """
    seconds = 0.0
    for case in islice(cases, FIRST_CASES):
        begin = time.process_time()
        with interruption.open():
            results = run(job, [case])
        seconds = time.process_time() - begin
        yield results
    work = seconds * (count - FIRST_CASES)
    if jobs > 1 and work > WORTH:
        size = max(1, round(min(CHUNK, work / jobs / 8) / max(seconds, 1e-6)))
        from multidrop.features.sweeps.pools import Pools  # 20 ms, which a small sweep is spared

        yield from Pools(job, jobs, interruption, run, say).results(chunks(cases, size))
    for case in cases:
        with interruption.open():
            results = run(job, [case])
        yield results


def chunks(cases: Iterator[Case], size: int) -> Iterator[list[Case]]:
    while cases_of_chunk := list(islice(cases, size)):
        yield cases_of_chunk


SCHEDULER_TIMEOUT = 3.0
"""Time for the scheduler to reply, s."""
WORKER_TIMEOUT = 30.0
"""The time without a sign of life of any worker after which a cluster is lost, s."""
STUCK = 600.0
"""The time without a result after which it is, s."""
CHECK_PERIOD = 3.0
"""The time between two looks for signs of life, s."""
WAIT = 0.1
TRUST = (
    "the scheduler, its workers and, without TLS, all computers on the network between can run any code on this "
    "computer with your rights, because Dask unpickles what they send"
)
INSTALL = "pip install 'multidrop[cluster]'"


def cluster_results(
    job: TrialJob, rounds: Iterable[Iterator[Case]], address: str, interruption: Interruption, agree: Callable[[], None]
) -> Iterator[list[TrialResult]]:
    """Run rounds of cases on the cluster of a scheduler; yield the results of each chunk as it ends.

    `agree` is called before anything is connected; it raises Diagnostic where a person has not agreed to the address.
    Raises Unreachable, TransportLost, and Diagnostic for workers that have another multidrop or none.
    """
    with _client(address, interruption, agree) as client, _reached(address):
        with interruption.open():
            _check_workers(client, address)
        size = 0
        for cases in rounds:
            if not size and (first := next(cases, None)) is not None:
                with interruption.open():
                    begin = time.process_time()
                    first_results = trial.chunk(job, [first])
                size = max(1, round(CHUNK / max(time.process_time() - begin, 1e-6)))
                yield first_results
            if todo := list(chunks(cases, max(1, size))):
                yield from _Work(client, job, address, interruption).results(todo)


@contextmanager
def _client(address: str, interruption: Interruption, agree: Callable[[], None]) -> Iterator[Client]:
    if not re.fullmatch(r"(?:tcp|tls|ws|wss)://[^@]+:[0-9]+", address):  # no user: Dask takes none
        raise Diagnostic(
            "is not the address of a scheduler", f"--cluster {url_without_secrets(address)}", "as in tcp://HOST:8786"
        )
    try:
        from distributed import Client
    except ImportError:
        raise Diagnostic("--cluster needs distributed, which is not installed", hint=INSTALL) from None
    agree()
    import logging  # with Dask

    for name in [each for each in logging.root.manager.loggerDict if each.startswith("distributed")]:
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        with interruption.open():
            client = Client(address, timeout=SCHEDULER_TIMEOUT, set_as_default=False)
    except (OSError, ValueError) as problem:
        raise Unreachable(f"{address}: no scheduler replies: {' '.join(str(problem).split())}") from None
    try:
        yield client
    finally:
        with suppress(OSError, TimeoutError):
            client.close(timeout=SCHEDULER_TIMEOUT)


@contextmanager
def _reached(address: str) -> Iterator[None]:
    """Raise TransportLost where a connection to the scheduler ends in the middle of a question."""
    from distributed.comm import CommClosedError

    try:
        yield
    except CommClosedError:
        raise TransportLost(f"{address}: the scheduler was lost") from None


def _check_workers(client: Client, address: str) -> None:
    """Refuse a cluster without workers, and workers with another multidrop or without a reply."""
    try:
        run = client._run  # `run` waits for a worker that hangs without an end
        versions: dict[str, Any] = client.sync(run, trial.version, on_error="return", callback_timeout=WORKER_TIMEOUT)
    except TimeoutError:
        raise TransportLost(f"{address}: a worker does not reply within {WORKER_TIMEOUT:g} s") from None
    except ImportError as problem:
        raise Diagnostic(
            f"a worker has no multidrop ({problem})", address, f"install {trial.version()} there"
        ) from None
    if not versions:
        raise Unreachable(f"{address}: the cluster has no workers")
    ours = trial.version()
    for worker, theirs in versions.items():
        if theirs != ours:
            what = "has no multidrop" if isinstance(theirs, BaseException) else f"has multidrop {theirs}"
            raise Diagnostic(f"{what}, and this is {ours}", f"worker {worker}", "install the same there")


class _Work:
    """The chunks of a sweep on a cluster, and what becomes of them."""

    def __init__(self, client: Client, job: TrialJob, address: str, interruption: Interruption) -> None:
        self._client, self._job, self._address, self._interruption = client, job, address, interruption
        self._again: list[list[Case]] = []
        """Chunks whose result was lost with a worker, and the rests of chunks that took long."""
        self._alone = False
        self._suspects: list[Case] = []
        """Cases of chunks whose workers died. The cluster counts against all that waited there, too."""

    def results(self, todo: list[list[Case]]) -> Iterator[list[TrialResult]]:
        """Run chunks; then alone each case whose workers died."""
        while todo:
            yield from self._run(todo)
            todo, self._again = self._again, []
            if not todo and self._suspects:
                self._alone, todo = True, [[self._suspects.pop()]]

    def _run(self, todo: list[list[Case]]) -> Iterator[list[TrialResult]]:
        """Submit chunks; yield the results of each as it ends."""
        from distributed import as_completed

        futures = self._client.map(trial.chunk, [self._job] * len(todo), todo, pure=False)
        of = dict(zip(futures, todo, strict=True))
        done = as_completed(futures, loop=self._client.loop)
        del futures  # the cluster drops results without a holder
        try:
            while of:
                with self._interruption.open():
                    self._wait(done)
                    future = next(done)
                    results = self._result(future, of[future])
                del of[future]
                yield results
        finally:
            if of:
                with suppress(OSError, TimeoutError):
                    self._client.cancel(list(of))

    def _wait(self, done: as_completed) -> None:
        """Wait until a chunk is at its end. Raises TransportLost for a cluster that is lost."""
        heard: dict[str, float] = {}
        looked = time.monotonic()
        begun = alive = looked
        while not done.has_ready():
            with done.thread_condition:
                done.thread_condition.wait(WAIT)
            if (now := time.monotonic()) - looked < CHECK_PERIOD:
                continue
            looked, last, heard = now, heard, self._heard()
            alive = now if heard and heard != last else alive
            if now - alive >= WORKER_TIMEOUT:
                raise TransportLost(f"{self._address}: no worker gave a sign of life for {WORKER_TIMEOUT:g} s")
            if now - begun >= STUCK:
                raise TransportLost(f"{self._address}: the workers gave no result for {STUCK:g} s")

    def _heard(self) -> dict[str, float]:
        """The time at which the scheduler last heard of each worker; none if the scheduler does not reply."""
        with suppress(OSError, TimeoutError):
            identity = self._client.sync(self._client.scheduler.identity, callback_timeout=SCHEDULER_TIMEOUT)
            return {name: worker["last_seen"] for name, worker in identity["workers"].items()}
        return {}

    def _result(self, future: Future, cases: list[Case]) -> list[TrialResult]:
        """The results of a chunk; none if it is to run again. Raises TransportLost."""
        from distributed import KilledWorker
        from distributed.client import FutureCancelledError

        try:
            problem = future.exception(timeout=WORKER_TIMEOUT) if future.status == "error" else None
            if problem is not None and not isinstance(problem, KilledWorker):
                raise TransportLost(f"{self._address}: a worker failed: {type(problem).__name__}: {problem}")
            results = future.result(timeout=WORKER_TIMEOUT)
            numbers = (
                [result.number for result in results if isinstance(result, TrialResult)]
                if isinstance(results, list)
                else []
            )
            if not numbers or numbers != [number for number, _ in cases[: len(results)]]:
                raise TransportLost(f"{self._address}: a worker replied with something else than results")
            if len(results) < len(cases):
                self._again.append(cases[len(results) :])
            return list(results)
        except TimeoutError:
            raise TransportLost(f"{self._address}: a result was not sent within {WORKER_TIMEOUT:g} s") from None
        except FutureCancelledError:
            if self._client.status != "running":
                raise TransportLost(f"{self._address}: the scheduler was lost") from None
            self._again.append(cases)
        except KilledWorker:
            if self._alone:
                return [TrialResult(cases[0][0], DIED, "the workers that ran it died: killed, or out of memory")]
            self._suspects += cases
        return []
