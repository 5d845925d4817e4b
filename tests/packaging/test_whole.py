"""What is shipped is whole: every feature that the registry names, and every extra of theirs."""

from __future__ import annotations

import tomllib

from multidrop import cli
from multidrop.base.registry import IN_WHEEL
from tests.support.paths import ROOT, THERE


def test_every_feature_of_the_table_is_in_the_tree() -> None:
    assert tuple(IN_WHEEL) == THERE


def test_each_extra_of_the_distribution_is_named_by_the_version() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert set(cli.extras()) == set(project["optional-dependencies"])
