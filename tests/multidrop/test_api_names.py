"""The names that Tab shows are the public ones, each on the page; an error is one line after a short traceback."""

from __future__ import annotations

import ast
import inspect
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import multidrop
from multidrop import Session, connect
from multidrop.api import threads
from multidrop.api.programs import AsyncParameters, AsyncPrograms
from multidrop.shell.operations.table import COMMANDS
from tests.support.behind_api import awaited
from tests.support.cases import for_each
from tests.support.cell_session import bus, party
from tests.support.paths import ROOT
from tests.support.virtual import VirtualLoop

PAGE = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")


@pytest.fixture
def session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Session]:
    """An open session with the drives a and b."""
    monkeypatch.setattr(threads, "new_loop", VirtualLoop)
    (tmp_path / "cell.toml").write_text(bus("press", party("a"), party("b"), baud=0))
    with connect(f"sim:{tmp_path / 'cell.toml'}") as opened:
        yield opened


def public(thing: object) -> set[str]:
    return {name for name in dir(thing) if not name.startswith("_")}


def test_the_module_shows_its_public_names_only() -> None:
    assert public(multidrop) == set(multidrop.__all__)
    assert not {"os", "importlib", "TYPE_CHECKING", "annotations", "api", "dialects", "shell"} & set(dir(multidrop))


def test_what_tab_shows_is_on_the_page_and_awaited_by_the_same_name(session: Session) -> None:
    a = session.drive("a")
    for each in (session, a, a.programs, a.parameters, session.telemetry(), session.events()):
        assert {name for name in public(each) if name not in PAGE} == set()
    assert public(a) == public(awaited(a)) and public(session) - {"live"} == public(awaited(session))


def test_a_session_and_a_drive_say_what_they_are(session: Session) -> None:
    assert repr(session) == "<multidrop: press: a, b>"
    assert repr(session.drive("b")) == "<drive b: LMDCM 6.002, Hw: 3.2>"
    session.close()
    assert repr(session) == "<multidrop: a closed session>"


@pytest.mark.parametrize("name", [each for each in multidrop.__all__ if each[0].isupper()])
def test_an_error_has_its_public_name(name: str) -> None:
    kind = getattr(multidrop, name)
    if issubclass(kind, Exception):
        assert traceback.format_exception_only(kind("text")) == [f"multidrop.{name}: text\n"]


def test_a_wrong_url_is_one_line_after_a_short_traceback(session: Session) -> None:
    for call in (lambda: connect("nope"), lambda: session.drive("a").write("VM", 5), lambda: session.send("/nope")):
        with pytest.raises((multidrop.Diagnostic, multidrop.Refused)) as failed:
            call()
        frames = traceback.extract_tb(failed.value.__traceback__)
        assert len(frames) <= 5 and all("multidrop/api/blocking" in each.filename for each in frames[2:])
        assert "\n" not in str(failed.value) and failed.value.__suppress_context__


SETTABLE = ("axis", "programs", "parameters")


def test_a_name_that_is_set_by_mistake_is_refused_and_hides_nothing(session: Session) -> None:
    a = session.drive("a")
    for each in (a, awaited(a), session, awaited(session), a.programs, a.parameters):
        for name in sorted({*public(each), "postion", "VM"}):
            with pytest.raises(AttributeError, match=f"^{name} of a [A-Za-z]+ .*cannot be set"):
                setattr(each, name, 0)
            assert name in SETTABLE or name not in vars(each)
    with pytest.raises(AttributeError, match=r"^position of a Drive cannot be set; write\(\) gives the drive a value"):
        setattr(a, "position", 7)  # noqa: B010
    with pytest.raises(AttributeError, match=r"^VM of a Drive does not exist, and cannot be set; write\(\)"):
        setattr(a, "VM", 7)  # noqa: B010
    assert a.position == 0 and a.axis == ""


def test_a_class_that_a_program_derives_has_names_of_its_own(session: Session) -> None:
    class Stage(multidrop.Drive):
        pitch = 5.0

        def __init__(self, session: Session, drive: multidrop.Drive) -> None:
            super().__init__(session, awaited(drive))
            self.offset = 3

    stage = Stage(session, session.drive("a"))
    stage.offset = 4
    assert (stage.offset, stage.position) == (4, 0)
    with pytest.raises(AttributeError, match="position of a Stage cannot be set"):
        setattr(stage, "position", 7)  # noqa: B010


@pytest.mark.parametrize("room", ["multidrop", "dialects", "drives", "families", "shell", "macros", "simulator", "tui"])
def test_a_checker_of_types_sees_no_module_that_has_every_name(room: str) -> None:
    for path in (ROOT / room).rglob("*.py"):
        found = [each.name for each in ast.parse(path.read_bytes()).body if isinstance(each, ast.FunctionDef)]
        assert "__getattr__" not in found, f"{path}: belongs under `if not TYPE_CHECKING`"


@for_each(
    "method, command",
    [
        (AsyncPrograms.download, "program download"),
        (AsyncPrograms.upload, "program upload"),
        (AsyncParameters.restore, "params restore"),
        (AsyncParameters.backup, "params backup"),
    ],
)
def test_a_call_has_the_arguments_of_its_operation(method: Callable[..., object], command: str) -> None:
    """Under the same names, with the same defaults; `text` is what a file holds, `verify` is the other way round."""
    declared = {each.name: each for each in COMMANDS[command].command_arguments}
    for name, given in list(inspect.signature(method).parameters.items())[1:]:
        if name == "text":
            continue
        operation = declared["no_verify" if name == "verify" else name]
        if given.default is not inspect.Parameter.empty and name != "file":
            expected = not operation.default if name == "verify" else operation.default
            assert given.default == expected or not given.default and not expected, name
