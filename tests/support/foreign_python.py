"""Other people's packages in a Python of their own, kept in `.venv/foreign` from one test run to the next."""

from __future__ import annotations

import subprocess
import sys
import venv
import zlib
from pathlib import Path

import pytest

from tests.support.paths import ROOT
from tests.support.posix import fcntl

TABLES_ONLY = ("pytrinamic==0.2.26", "typing_extensions", "pyserial==3.5")
"""What the tables of the maker's TMCL library need."""
QUICK = ("--quiet", "--retries=0", "--timeout=15", "--disable-pip-version-check", "--no-compile")


def foreign_python(*packages: str) -> Path:
    """Return a Python that has these packages, and none that they ask for; skip the test where PyPI has no answer."""
    wanted = "\n".join((sys.version, *packages))
    home = ROOT / ".venv" / "foreign" / f"{zlib.crc32(wanted.encode()):08x}"
    home.mkdir(parents=True, exist_ok=True)
    with (home / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # the test runner has several processes
        if not (home / "done").exists():
            _install(home, packages)
            (home / "done").touch()
    return home / "bin" / "python"


def _install(home: Path, packages: tuple[str, ...]) -> None:
    venv.create(home, with_pip=False)
    pip = [sys.executable, "-m", "pip", "--python", str(home / "bin" / "python"), "install", "--no-deps", *QUICK]
    try:
        done = subprocess.run([*pip, *packages], capture_output=True, text=True, timeout=150)
    except subprocess.TimeoutExpired:
        pytest.skip("PyPI is too slow for the packages")
    if done.returncode:
        pytest.skip(f"the packages cannot be had: {done.stderr.strip().splitlines()[-1:]}")
