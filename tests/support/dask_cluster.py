"""A Dask cluster of two processes, for tests: it writes the scheduler's address to a file, and ends with its input."""

from __future__ import annotations

import sys
from pathlib import Path

from distributed import LocalCluster


def main(file: str, workers: int) -> None:
    """Serve until standard input ends."""
    with LocalCluster(  # type: ignore[no-untyped-call]
        n_workers=workers,
        threads_per_worker=1,
        processes=True,
        host="127.0.0.1",
        dashboard_address=None,
        silence_logs=50,
    ) as cluster:
        Path(file).write_text(cluster.scheduler_address)
        sys.stdin.read()


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
