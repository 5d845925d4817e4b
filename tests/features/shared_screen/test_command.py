"""The command lines of a shared screen: what `--share`, `--join` and `relay screen:` do, and what they refuse."""

from __future__ import annotations

import io
import sys
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from multidrop.__main__ import main
from tests.support.front_door import Called, Done, at_terminal
from tests.support.paths import THERE


def test_a_watcher_joins_one_screen_and_opens_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    join = Called(5)
    monkeypatch.setattr("multidrop.features.shared_screen.command.join", join)
    assert at_terminal(tmp_path, "tui", "--join").returncode == 5
    assert at_terminal(tmp_path, "tui", "--join", "ssh://pc").returncode == 5
    assert join.calls == [("",), ("ssh://pc",)]
    said = "tui --join: a watcher opens nothing itself; give --join alone, or with ssh://HOST\n"
    for more in ("sim:", "--share", "--raw", *("--twin",) * ("twins" in THERE)):
        assert at_terminal(tmp_path, "tui", more, "--join") == Done(2, "", said)
    assert len(join.calls) == 2


@pytest.mark.parametrize("shared", [False, True])
def test_a_screen_is_shared_while_it_runs_where_that_is_asked_for(
    shared: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    screen, said = Called(7), list[Any]()

    @contextmanager
    def sharing(app: object, folder: Path) -> Any:
        said.append((app, folder))
        yield
        said.append("over")

    monkeypatch.setattr("multidrop.features.shared_screen.feed.sharing", sharing)
    monkeypatch.setattr("multidrop.tui.launch.run", screen)
    assert at_terminal(tmp_path, "tui", "a", *["--share"] * shared) == Done(7, "", "")
    [(urls, reconnect, raw, _, around)] = screen.calls
    assert (urls, reconnect, raw) == (("a",), True, False)
    app = SimpleNamespace(session=SimpleNamespace(settings=SimpleNamespace(state=tmp_path)))
    with around(app):
        assert said == [(app, tmp_path / "screens")] * shared
    assert said[1:] == ["over"] * shared


@pytest.mark.fork
def test_a_relay_of_a_screen_joins_it_by_its_name(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    joined, spliced = Called(17), Called()
    monkeypatch.setattr("multidrop.features.shared_screen.join.connect", joined)
    monkeypatch.setattr("multidrop.features.shared_screen.join.splice", spliced)
    monkeypatch.setattr(sys, "stdin", io.StringIO())
    monkeypatch.setenv("MULTIDROP_STATE_DIR", str(tmp_path))
    assert main(["relay", "screen:press"]) == main(["relay", "screen:"]) == 0
    assert (
        joined.calls == [("press", tmp_path / "screens"), ("", tmp_path / "screens")] and spliced.calls == [(17,)] * 2
    )
