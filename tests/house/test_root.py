"""The root of the repository holds what CONTRIBUTING names, which names each target of the Makefile."""

import re
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


def test_contributing_names_every_target_of_the_makefile():
    named = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    (targets,) = re.findall(r"^\.PHONY: (.*)$", makefile, re.MULTILINE)
    assert set(re.findall(r"^([a-z][a-z-]*)(?: [a-z -]+)?:(?!=)", makefile, re.MULTILINE)) <= set(targets.split())
    assert [each for each in targets.split() if not re.search(rf"`make {each}[` ]", named)] == []


def test_the_wheel_has_one_package():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert project["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"] == ["multidrop"]
