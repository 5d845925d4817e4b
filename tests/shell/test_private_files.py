"""Files of others: what is in the place of a file of the state folder, and who else can change the configuration."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from multidrop.base.atomic import open_private, private_folder, read_private, write_atomically
from multidrop.base.errors import Diagnostic
from multidrop.base.file_owners import other_writer
from multidrop.base.store import Store
from multidrop.shell import configuration
from multidrop.shell.configuration import Settings
from multidrop.shell.connect.urls import parse
from multidrop.shell.log import files
from multidrop.shell.prompt.line_queue import History
from multidrop.shell.state import crash_marks
from multidrop.shell.state.backups import Copy, Drafts
from multidrop.shell.state.opened import lately, note
from multidrop.shell.state.port_state import PortState
from tests.support.front_door import Command, Home

pytestmark = pytest.mark.fork
PORT = "/dev/ttyUSB0"


def in_place(kind: str, path: Path) -> Path:
    """Put something else in the place of a file; return the file of another that a link leads to."""
    victim = path.parent.parent / f"victim of {path.name}"
    path.parent.mkdir(parents=True, exist_ok=True)
    victim.write_text("precious")
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "link":
        path.symlink_to(victim)
    else:
        path.mkdir()
    return victim


@pytest.mark.parametrize("kind", ["pipe", "link", "folder"])
def test_what_is_not_a_regular_file_is_neither_waited_for_nor_followed(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "state" / "x.json"
    victim = in_place(kind, path)
    for attempt in (lambda: read_private(path), lambda: open_private(path, os.O_RDWR | os.O_CREAT)):
        with pytest.raises(OSError):
            attempt()
    assert Store(path.parent).find("x.json", lambda found: found) is None
    if kind != "folder":
        Store(path.parent).write("x.json", {"a": 1})
        assert Store(path.parent).load("x.json", lambda found: found) == {"a": 1}
        assert stat.S_ISREG(path.lstat().st_mode) and stat.S_IMODE(path.lstat().st_mode) == 0o600
    assert victim.read_text() == "precious"


@pytest.mark.parametrize("kind", ["pipe", "link"])
@pytest.mark.parametrize("ending", ["line", "json", "drives"])
async def test_a_port_with_a_strange_file_opens_and_says_so(tmp_path: Path, kind: str, ending: str) -> None:
    usual = PortState(tmp_path, PORT)
    usual.close()
    [line] = [each for each in (tmp_path / "ports").iterdir() if each.suffix == ".line"]
    path = line.with_suffix(f".{ending}")
    path.unlink(missing_ok=True)
    victim = in_place(kind, path)
    port = PortState(tmp_path, PORT)
    port.begun("MR 51200")
    port.ended()
    port.close()
    if ending != "drives":
        assert any("it is not a regular file; remove it" in each for each in port.remarks), port.remarks
    assert victim.read_text() == "precious"


@pytest.mark.parametrize("kind", ["pipe", "link"])
def test_history_urls_drafts_marks_and_the_list_of_logs(tmp_path: Path, kind: str) -> None:
    state = tmp_path / "state"
    victims = [in_place(kind, state / name) for name in ("history", "opened.json", "logs/elsewhere")]
    history = History(state / "history")
    history.append("PR P")
    assert history.lines() == []
    assert lately(state) == []
    note(state, "sim:")
    assert [each.url for each in lately(state)] == ["sim:"]
    (tmp_path / "my.jsonl").write_text("x")
    files.note(Settings(state=state), tmp_path / "my.jsonl")
    assert files.newest(Settings(state=state)) == tmp_path / "my.jsonl"
    drafts = Drafts(state)
    Drafts(tmp_path / "own").keep(Copy("go.mxt", "MR 1", "now"))
    [own] = (tmp_path / "own" / "drafts").iterdir()
    victims.append(in_place(kind, state / "drafts" / own.name))
    assert drafts.find("go.mxt") is None
    drafts.keep(Copy("go.mxt", "MR 1", "now"))
    assert drafts.find("go.mxt") == Copy("go.mxt", "MR 1", "now")
    with crash_marks.playing(state, [PORT], "m", files.datetime.now()):
        [mark] = (state / "unfinished").rglob("*.json")
    victims.append(in_place(kind, mark))
    assert crash_marks.left(state, PORT) == []
    assert {each.read_text() for each in victims} == {"precious"}


def test_folders_of_the_state_are_private_and_become_so(tmp_path: Path) -> None:
    folder = tmp_path / "home" / "state"
    private_folder(folder / "ports")
    assert [stat.S_IMODE(each.stat().st_mode) for each in (folder, folder / "ports")] == [0o700, 0o700]
    (folder / "ports").chmod(0o755)
    PortState(folder, PORT).close()
    assert stat.S_IMODE((folder / "ports").stat().st_mode) == 0o700
    assert stat.S_IMODE(next((folder / "ports").glob("*.line")).stat().st_mode) == 0o600


def test_a_file_of_the_user_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "real.toml").write_text("a")
    (tmp_path / "link.toml").symlink_to("real.toml")
    write_atomically(tmp_path / "link.toml", b"b")
    assert (tmp_path / "real.toml").read_text() == "b" and (tmp_path / "link.toml").is_symlink()


@pytest.fixture
def config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "config"
    folder.mkdir(mode=0o755)
    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(folder))
    file = folder / "multidrop.toml"
    file.write_text('[connections.press]\nurl = "sim:cells/press.toml#line?em=1"\n')
    file.chmod(0o644)
    return file


@pytest.mark.parametrize("mode", [0o666, 0o646, 0o602])
def test_a_configuration_that_everyone_can_write_is_not_used(config: Path, mode: int) -> None:
    assert other_writer(config) == "" and "press" in configuration.load().connections
    config.chmod(mode)
    with pytest.raises(Diagnostic, match="can be changed by every account.*so it is not used; chmod go-w"):
        configuration.load()
    found = configuration.load(lenient=True)
    assert found.connections == {} and "can be changed by" in str(found.problems[0]) and "" in found.in_doubt
    config.chmod(0o644)
    config.parent.chmod(0o777)
    with pytest.raises(Diagnostic, match="every account"):
        configuration.load()


def test_a_configuration_that_is_a_link_into_a_folder_of_everyone_is_not_used(config: Path, tmp_path: Path) -> None:
    shared = tmp_path / "shared"
    shared.mkdir()
    config.rename(shared / "real.toml")
    config.symlink_to(shared / "real.toml")
    assert "press" in configuration.load().connections
    shared.chmod(0o777)
    with pytest.raises(Diagnostic, match=f"every account.* chmod go-w {config} .*{shared}"):
        configuration.load()


@pytest.mark.skipif(getattr(os, "geteuid", lambda: 1)() != 0, reason="only root can give files away")
def test_a_configuration_of_another_account_or_a_shared_group_is_not_used(config: Path) -> None:
    os.chown(config, 65534, -1)
    with pytest.raises(Diagnostic, match="can be changed by account nobody, who owns"):
        configuration.load()
    os.chown(config, 0, 65534)
    config.chmod(0o664)
    with pytest.raises(Diagnostic, match="can be changed by group nogroup"):
        configuration.load()


@pytest.mark.process
def test_the_command_line_says_so_in_one_line_and_sends_nothing(home: Home, multidrop: Command) -> None:
    file = home.file("conf/multidrop.toml", '[connections.press]\nurl = "sim:#press"\n')
    Path(home.folder, file).chmod(0o666)
    ended = multidrop("send", "press", "@a MR 100")
    assert (ended.returncode, ended.stdout) == (2, "") and "so it is not used" in ended.stderr
    assert ended.stderr.count("\n") == 1
    assert multidrop("--no-config", "send", "sim:#press", "@a PR P").stdout == "0\n"


def test_a_relative_path_of_a_saved_connection_starts_at_the_configuration(
    config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    saved = configuration.load().connections
    found = parse("press", saved)
    path = str(config.parent / "cells" / "press.toml")
    assert (found.target, found.bus) == (path, "line")
    assert found.scheme.lasting(found, "line") == f"sim:{path}#line?em=1"
    typed = parse("sim:cells/press.toml?em=1")
    assert typed.scheme.lasting(typed, "line") == f"sim:{tmp_path}/cells/press.toml#line"
    config.write_text('[connections.tty]\nurl = "serial:./press.tty?baud=9600"\n[connections.com]\nurl = "COM3"\n')
    saved = configuration.load().connections
    assert parse("tty", saved).target == str(config.parent / "press.tty")
    assert parse("com", saved).target == "COM3"  # a name of Windows, not a path
    assert parse("sim:cells/press.toml").target == "cells/press.toml"  # typed: the current folder
