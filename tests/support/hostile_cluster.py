"""A Dask cluster whose scheduler or worker sends an object that leaves a file where it is unpickled: `PROOF.<pid>`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from distributed import LocalCluster
from distributed.protocol import ToPickle

from multidrop.features.sweeps import trial


class Hostile:
    """Runs code in the process that unpickles it."""

    def __init__(self, proof: str) -> None:
        self._proof = proof

    def __reduce__(self) -> tuple[Any, tuple[str]]:
        return eval, (f"open({self._proof!r} + '.' + str(__import__('os').getpid()), 'w').close()",)


def main(file: str, proof: str, who: str) -> None:
    """Serve until standard input ends; `who` is hostile."""
    with LocalCluster(  # type: ignore[no-untyped-call]
        n_workers=1, processes=False, protocol="tcp://", host="127.0.0.1", dashboard_address=None, silence_logs=50
    ) as cluster:
        scheduler = cluster.scheduler
        identity = scheduler.handlers["identity"]
        if who == "worker":
            trial.version = lambda: Hostile(proof)  # type: ignore[assignment, return-value]
        else:
            scheduler.handlers["identity"] = lambda *a, **k: {**identity(*a, **k), "more": ToPickle(Hostile(proof))}
        Path(file).write_text(cluster.scheduler_address)
        sys.stdin.read()


if __name__ == "__main__":
    main(*sys.argv[1:])
