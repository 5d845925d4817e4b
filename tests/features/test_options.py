"""Options that features add to commands, and what `relay` lends: they run, or one line says which is missing."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import pytest

from multidrop.base import registry
from multidrop.base.errors import Diagnostic
from multidrop.base.feature import Feature
from multidrop.shell import hooks
from multidrop.shell.configuration import Settings
from multidrop.shell.hooks import Options
from multidrop.shell.operations.parameter import Argument
from multidrop.shell.relaying import Lent, lender, ports
from multidrop.shell.session import Session
from multidrop.tui import launch
from tests.support.front_door import Called, Command, Done, at_terminal
from tests.support.own_features import load


@dataclass(frozen=True, kw_only=True)
class Other:
    other: Annotated[bool, Argument("do something else")] = False


@dataclass(frozen=True, kw_only=True)
class One:
    one: bool = False


@dataclass(frozen=True, kw_only=True)
class Two:
    two: bool = False


@pytest.fixture
def add(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., None]]:
    monkeypatch.setattr(registry, "IN_WHEEL", {})

    def added(*adds: object) -> None:
        load(monkeypatch, Feature("x", "adds options", adds=adds))

    yield added


@pytest.fixture
def gone(monkeypatch: pytest.MonkeyPatch) -> None:
    words = ("tui --ghost", "shell --ghost", "relay ghost:", "[ghost]")
    monkeypatch.setattr(registry, "IN_WHEEL", {"gone_away": words})


MISSING = "the feature gone_away is not there; install multidrop again, whole\n"


@pytest.mark.usefixtures("gone")
def test_an_option_whose_feature_is_gone_is_one_line(multidrop: Command) -> None:
    for words in (["tui", "--ghost"], ["tui", "sim:", "--ghost=5", "--help"], ["shell", "--ghost"]):
        assert multidrop(*words) == Done(2, "", f"{words[0]} --ghost: {MISSING}")
    assert "--ghost" not in multidrop("tui", "--help").stdout
    done = multidrop("send", "--ghost")
    assert done.returncode == 2 and "gone_away" not in done.stderr
    hooks.check("tui", ["--", "--ghost"])


@pytest.mark.usefixtures("gone")
def test_what_relay_lends_of_a_feature_that_is_gone_is_one_line(multidrop: Command) -> None:
    for port in ("ghost:", "ghost:5"):
        assert multidrop("relay", port) == Done(2, "", f"relay ghost: {MISSING}")


@pytest.mark.parametrize("word", ["[mqtt]", "/twin", "--share"])
def test_a_word_of_a_feature_that_is_no_command_is_none(word: str, multidrop: Command) -> None:
    for words in ([word], ["log", word]):
        done = multidrop(*words)
        assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)


def test_an_option_runs_something_in_place_of_its_command(tmp_path: Path, add: Callable[..., None]) -> None:
    def instead(asked: Other, more: bool) -> int | None:
        return 3 + more if asked.other else None

    add(Options("tui", Other, instead=instead, examples=("tui a --other",)))
    assert at_terminal(tmp_path, "tui", "--other") == Done(3, "", "")
    assert at_terminal(tmp_path, "tui", "a", "b", "c", "--other") == Done(4, "", "")
    helped = at_terminal(tmp_path, "tui", "--help").stdout
    assert "  --other         do something else\n" in helped and "  multidrop tui a --other\n" in helped


def test_options_put_something_around_the_screen(
    tmp_path: Path, add: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    said = list[Any]()

    def around(word: str) -> Callable[[Any, Any], Any]:
        @contextmanager
        def entered(app: Any, asked: Any) -> Iterator[None]:
            said.append((word, app, asked))
            yield
            said.append(word)

        return entered

    add(Options("tui", One, around=around("a")), Options("tui", Two, around=around("b")))
    screen = Called(0)
    monkeypatch.setattr("multidrop.tui.launch.run", screen)
    assert at_terminal(tmp_path, "tui", "--one") == Done(0, "", "")
    with screen.calls[0][-1]("app"):
        assert said == [("a", "app", One(one=True)), ("b", "app", Two())]
    assert said[2:] == ["b", "a"]


def test_relay_lends_what_a_feature_adds(monkeypatch: pytest.MonkeyPatch, add: Callable[..., None]) -> None:
    lend = Called()
    lent = Lent("bell:", "the bell", lend)  # type: ignore[arg-type]
    add(lent)
    assert ports() == "a serial port of this machine; bell: is the bell"
    assert lender("bell:x:y") is lent
    for port in ("/dev/bell:", "COM3", "bell", "bell://x", "door:", "Bell:"):
        assert lender(port) is None, port
    if sys.platform != "win32":
        from multidrop.__main__ import main

        monkeypatch.setattr(sys, "stdin", io.StringIO())
        assert main(["relay", "bell:x:y"]) == 0 and lend.calls == [("x:y",)]


async def test_a_screen_whose_option_fails_closes_its_session(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("MULTIDROP_STATE_DIR", str(tmp_path))
    background = []

    def prepare(session: Session) -> None:
        background.append(session.start("/sleep 60"))
        raise Diagnostic("cannot be done")

    with pytest.raises(Diagnostic, match="^cannot be done$"):
        await launch._run([], Settings(), False, False, prepare, nullcontext)
    assert background[0].done()
