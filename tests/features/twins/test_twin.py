"""Twins on the command line: `--twin`."""

from __future__ import annotations

from types import SimpleNamespace

from multidrop.cli import parse
from multidrop.shell.hooks import Added
from tests.support.cases import for_each
from tests.support.front_door import Command
from tests.support.front_door import multidrop as multidrop


def test_raw_bytes_have_no_twin(multidrop: Command) -> None:
    done = multidrop("shell", "sim:", "--raw", "--twin")
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1


@for_each("words, wanted", [(["shell", "a", "--twin"], True), (["tui", "a", "--twin"], True), (["tui", "a"], False)])
def test_the_option_wants_twins_of_the_session_that_is_opened(words: list[str], wanted: bool) -> None:
    chosen, twins = parse(words), SimpleNamespace(wanted=False)
    Added(chosen.command, chosen).prepare(SimpleNamespace(hooks=SimpleNamespace(part=lambda kind: twins)))
    assert twins.wanted is wanted
