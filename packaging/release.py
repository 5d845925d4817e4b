"""Check and build a release: one version in all places, a clean tree, wheel and source distribution that install where
nothing else is and work, and their checksums. Nothing is published.

Run: python packaging/release.py        (make release)
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
DIST = ROOT / "dist"
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
"""The versions to try; one that this machine lacks is named as not tried."""
PLACES = {
    "multidrop/__init__.py": r'^__version__ = "(.+)"$',
    "CHANGELOG.md": r"^## (\d[\w.]*)",
    "CITATION.cff": r"^version: (\S+)$",
    "multidrop/shipped/multidrop.1": r'^\.TH .*"multidrop (\S+)"',
}
"""The places of the version, each with the form in which it is there."""
PROGRAM = """\
import multidrop
with multidrop.connect("sim:#press") as session:
    a = session.drive("a")
    a.move(512)
    a.wait()
    print(a.position)
"""
SMOKE: Mapping[tuple[str, ...], str] = {
    ("multidrop", "--version"): r"multidrop {version}, Python .*",
    ("multidrop", "send", "sim:#press", "PR VR", "MR 512", "/wait stopped", "PR P"): r"LMDCM 6.002, Hw: 3.2\n512",
    ("multidrop", "help", "86"): r"error 86: stall\n.*",
    ("multidrop", "program", "test", "turn.mxt"): r".*at 5120\n.*no errors.*",
    ("python", "program.py"): "512",
}
"""Commands, each with a pattern of what it prints."""


class Wrong(Exception):
    """A check that fails: the release is not made."""


def versions(root: Path = ROOT) -> dict[str, str]:
    """The version in each of its places; empty where it is missing."""
    found = {name: re.search(form, _text(root / name), re.M) for name, form in PLACES.items()}
    return {name: match[1] if match else "" for name, match in found.items()}


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8") if path.exists() else ""


def checked_version() -> str:
    """The one version. Raises Wrong where places differ, or the tree has changes."""
    found = versions()
    version = found["multidrop/__init__.py"]
    differ = [f"{name} has {each or 'no version'}" for name, each in found.items() if each != version]
    if differ:
        raise Wrong(f"multidrop/__init__.py has {version}, {', '.join(differ)}")
    if changes := _run("git", "-C", ROOT, "status", "--porcelain"):
        raise Wrong(f"the tree has changes, commit them first:\n{changes}")
    return version


def build(version: str) -> list[Path]:
    """Build both distributions in dist, in place of older ones."""
    shutil.rmtree(DIST, ignore_errors=True)
    _run(sys.executable, "-m", "build", "--outdir", DIST, ROOT)
    found = [DIST / f"multidrop-{version}-py3-none-any.whl", DIST / f"multidrop-{version}.tar.gz"]
    if missing := [path.name for path in found if not path.exists()]:
        raise Wrong(f"not built: {', '.join(missing)}")
    sums = "".join(f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in found)
    (DIST / "SHA256SUMS").write_text(sums)
    return found


def interpreters() -> Iterator[tuple[str, str]]:
    """Yield each version with its program; empty where this machine has none that starts."""
    for version in PYTHONS:
        program = shutil.which(f"python{version}") or ""
        started = program and subprocess.run([program, "--version"], capture_output=True).returncode == 0
        yield version, program if started else ""


def smoke(program: str, distribution: Path, version: str) -> None:
    """Install it in a bare environment and an empty home, and use it. Raises Wrong."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _run(program, "-m", "venv", folder / "venv")
        bin_ = folder / "venv" / "bin"
        quiet = ("-q", "--disable-pip-version-check")
        _run(bin_ / "python", "-m", "pip", "install", *quiet, "-c", ROOT / "constraints.txt", distribution)
        (folder / "program.py").write_text(PROGRAM)
        (folder / "turn.mxt").write_text('PG 1\nLB SU\nMR 5120\nH\nPR "at ",P\nE\nPG\n')
        env = {"HOME": name, "PATH": f"{bin_}{os.pathsep}/usr/bin:/bin", "LANG": "C.UTF-8"}
        for command, pattern in SMOKE.items():
            printed = _run(bin_ / command[0], *command[1:], cwd=folder, env=env)
            if not re.fullmatch(pattern.format(version=re.escape(version)), printed, re.S):
                raise Wrong(f"{' '.join(command)} with {program}, {distribution.name}: printed {printed!r}")


def _run(*command: object, cwd: Path | None = None, env: Mapping[str, str] | None = None) -> str:
    done = subprocess.run([str(each) for each in command], cwd=cwd, env=env, capture_output=True, text=True)
    if done.returncode:
        raise Wrong(f"{' '.join(map(str, command))}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout.strip()


def main() -> int:
    """Make a release; return the exit code."""
    try:
        version = checked_version()
        print(f"multidrop {version}: building", flush=True)
        found = build(version)
        tried, missing = list[str](), list[str]()
        for python, program in interpreters():
            if not program:
                missing.append(python)
                continue
            for distribution in found:
                print(f"Python {python}: {distribution.name}", flush=True)
                smoke(program, distribution, version)
            tried.append(python)
    except Wrong as wrong:
        print(f"no release: {wrong}", file=sys.stderr)
        return 1
    if not tried:
        print(f"no release: none of Python {', '.join(PYTHONS)} is here", file=sys.stderr)
        return 1
    print(f"dist has multidrop {version}; works with Python {', '.join(tried)}", end="")
    print(f"; not tried: {', '.join(missing)} (not on this machine)" if missing else "")
    print(f"next: git tag v{version}; the workflow packaging/release.yml builds the same from the tag")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
