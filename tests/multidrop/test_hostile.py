"""The text of a drive or of another person's file is shown at every front door, and acts on no terminal."""

import contextlib
import io
import json
import sys
import time

import pyte
import pytest

from tests.multidrop.hostile_drive import ACTING, HOSTILE, OVERRIDE, hostile_url  # noqa: F401
from tests.support.front_door import read_to_end
from tests.support.posix import pexpect
from tests.support.processes import environment
from tests.support.until import PATIENCE

BAD = HOSTILE.decode("latin-1") + OVERRIDE
QUOTED = json.dumps(BAD)


def acts(text):
    data = text.encode("utf-8", "surrogateescape")
    return [each for each in (*ACTING, b"\x1b", b"\x07") if each in data]


LINES = ("/log a.log", "PR P", "/drives", "/status", "PR PN")


@pytest.mark.parametrize("door", ["send", "run"])
def test_a_drive_is_shown_and_not_obeyed(multidrop, hostile_url, tmp_path, door):  # noqa: F811
    (tmp_path / "go.txt").write_text("\n".join(LINES))
    done = multidrop(*(("send", hostile_url, *LINES) if door == "send" else ("run", "go.txt", "--on", hostile_url)))
    log = (tmp_path / "a.log").read_text()
    assert "51200" in done.stdout and r"\x1b]52" in done.stdout and r"\u001b]52" in log
    assert acts(done.stdout + done.stderr + log) == []


@pytest.mark.process
@pytest.mark.parametrize("door", ["tui", "shell"])
def test_a_drive_is_shown_on_a_terminal_and_not_obeyed(hostile_url, tmp_path, door):  # noqa: F811
    """The log says when a line was done: what this drive prints soon scrolls every line off a screen."""
    seen, log, screen = io.BytesIO(), tmp_path / "a.log", pyte.Screen(200, 40)
    terminal = pyte.ByteStream(screen)
    command = ["-m", "multidrop", door, hostile_url]
    child = pexpect.spawn(sys.executable, command, env=environment(tmp_path), dimensions=(40, 200), timeout=PATIENCE)
    child.logfile_read = seen

    def read_until(done):
        deadline = time.monotonic() + PATIENCE
        while not done():
            assert time.monotonic() < deadline, "\n".join(screen.display)
            with contextlib.suppress(pexpect.TIMEOUT):
                terminal.feed(child.read_nonblocking(65536, 0.1))

    words, rows = ("at rest", 1) if door == "tui" else ("LMDCM", 24)
    read_until(lambda: any(words in row for row in screen.display[:rows]))
    child.send(f"/log {log}\r/drives\r/status\r")
    read_until(lambda: log.exists() and "at rest: P=51200" in log.read_text())
    child.send("/quit\r")
    assert read_to_end(child) == 0
    assert rb"\x1b]52" in seen.getvalue()
    assert [each for each in ACTING if each in seen.getvalue()] == []


FILES = {
    "cell.toml": (f"[[bus]]\nname = {QUOTED}\n", ("send", "sim:{}", "PR VR")),
    "cell2.toml": (f'[[bus]]\nname = "a"\n{QUOTED} = 1\n', ("sim", "{}")),
    "cell3.toml": (f'[[bus]]\nname = "a"\n[[bus.drive]]\npersonality = {QUOTED}\n', ("sim", "{}")),
    "go.txt": (f"PR {BAD}\n".replace("\n", "", BAD.count("\n")), ("run", "{}", "--on", "sim:#press")),
    "p.mxt": (f"PG 100\n{BAD}\nPG\n", ("program", "check", "{}")),
    "p.prg": (f"{BAD}\nEND\n", ("program", "check", "{}")),
    f"x{BAD.replace(chr(0), '')[:40]}.mxt": ("PG 100\nFOO\nPG\n", ("program", "check", "{}")),
}


@pytest.mark.parametrize("name", FILES, ids=range(len(FILES)))
def test_a_file_is_shown_and_not_obeyed(multidrop, tmp_path, name):
    text, command = FILES[name]
    (tmp_path / name).write_text(text, encoding="utf-8")
    done = multidrop(*(each.format(name) for each in command))
    assert done.returncode in (1, 2) and done.stderr.count("\n") >= 1
    assert acts(done.stdout + done.stderr) == []


@pytest.mark.parametrize(
    "arguments",
    [
        ("send", "sim:#press", f"PR {BAD}"),
        ("send", "sim:#press", f"/{BAD}"),
        ("send", f"tcp://{BAD}:1", "PR P"),
        ("send", f"/dev/{BAD}", "PR P"),
        ("macro", "show", BAD),
        (BAD,),
        ("plot", "sim:#press", "--to", BAD),
    ],
    ids=range(7),
)
def test_what_is_typed_is_quoted_and_not_obeyed(multidrop, arguments):
    done = multidrop(*arguments)
    assert done.returncode in (1, 2, 3) and acts(done.stdout + done.stderr) == []


def test_a_macro_and_a_configuration_are_shown_and_not_obeyed(home):
    home.file("conf/macros/go.toml", f'name = "go"\n{QUOTED} = 1\n')
    home.file("conf/macros/on.toml", f'name = "on"\ndescription = {QUOTED}\n[[step]]\nline = {QUOTED}\n')
    home.settings(f'[connections.a]\nurl = "sim:"\nnames = {{ a = {QUOTED} }}\n')
    for arguments in (
        ("macro", "list"),
        ("macro", "show", "on"),
        ("macro", "play", "on", "--on", "sim:"),
        ("send", "a", "PR P"),
    ):
        done = home.run(*arguments)
        assert acts(done.stdout + done.stderr) == []
    assert done.returncode == 2
