"""The root of the repository holds what CONTRIBUTING names."""

import tomllib
from fnmatch import fnmatch

from tests.support.paths import ROOT

HIDDEN = [".git", ".gitignore", ".ci"]


def test_everything_in_the_root_is_named_in_contributing():
    named = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    ignored = [*HIDDEN, *(line.rstrip("/") for line in (ROOT / ".gitignore").read_text(encoding="utf-8").split())]
    root = sorted(each.name for each in ROOT.iterdir())
    others = [name for name in root if not any(fnmatch(name, pattern) for pattern in ignored)]
    assert [name for name in others if name not in named] == []


def test_the_wheel_has_one_package():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert project["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"] == ["multidrop"]
