"""An option that a feature by others adds to a command of multidrop."""

from __future__ import annotations

from pathlib import Path

import pytest

from multidrop.base import registry
from tests.support.front_door import Command

TEXT = """
from dataclasses import dataclass
from typing import Annotated

from multidrop.base.feature import Feature
from multidrop.shell.hooks import Options
from multidrop.shell.operations.parameter import Argument

@dataclass(frozen=True, kw_only=True)
class Greeting:
    greet: Annotated[bool, Argument("say hello")] = False

async def opened(session, asked):
    if asked.greet:
        session.output("hello")

FEATURE = Feature("greeting", "greets", adds=(Options("shell", Greeting, opened=opened),))
"""


@pytest.fixture(autouse=True)
def greeting(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "conf" / "features").mkdir(parents=True)
    (tmp_path / "conf" / "features" / "greeting.py").write_text(TEXT)
    for name in ("_others", "_failed"):
        monkeypatch.setattr(registry, name, {})


def test_help_and_the_command_line_know_it(multidrop: Command) -> None:
    assert "--greet" in multidrop("shell", "--help").stdout
    assert "--greet" not in multidrop("send", "--help").stdout
    refused = multidrop("shell", "sim:", "--great")
    assert refused.returncode == 2 and "unrecognized arguments: --great" in refused.stderr


def test_without_the_configuration_there_is_no_such_option(multidrop: Command) -> None:
    assert "--greet" not in multidrop("shell", "--no-config", "--help").stdout
