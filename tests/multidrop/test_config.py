"""`multidrop config`: path, show and check."""

import re
import signal

import pytest
import tomlkit

from multidrop.__main__ import main
from tests.support.front_door import read_to_end
from tests.support.leaving_cell import assert_allowed_by_configuration, write_leaving
from tests.support.paths import ROOT
from tests.support.processes import Running


@pytest.fixture
def file(tmp_path, monkeypatch):
    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(tmp_path / "config"))
    (tmp_path / "config").mkdir()
    return tmp_path / "config" / "multidrop.toml"


def test_the_path_is_printed_whether_the_file_exists_or_not(file, capsys):
    assert main(["config", "path"]) == 0
    assert capsys.readouterr().out == f"{file}\n"


def test_what_counts_is_shown_as_toml_with_its_origin(file, capsys):
    assert main(["config", "show"]) == 0
    assert "does not exist" in capsys.readouterr().out
    file.write_text('[connections.press]\nurl = "sim:"\nnames = { a = "left" }\n[keys]\npalette = "Alt+p"\n')
    assert main(["config", "show"]) == 0
    out = capsys.readouterr().out
    shown = tomlkit.parse(out)
    assert shown["connections"]["press"] == {"url": "sim:", "names": {"a": "left"}}
    assert shown["keys"]["palette"] == "Alt+p" and shown["keys"]["drive"] == "^O"
    assert 'palette = "Alt+p"\n' in out and 'drive = "^O"   # default\n' in out


def test_the_password_of_a_url_is_not_shown(file, capsys):
    file.write_text(
        '[connections.press]\nurl = "ssh://me:p/w@pc/dev/ttyUSB0"\n[connections.far]\nurl = "ssh://me@pc/dev/x"\n'
    )
    assert main(["config", "show"]) == 0
    shown = tomlkit.parse(capsys.readouterr().out)["connections"]
    assert [each["url"] for each in shown.values()] == ["ssh://***@pc/dev/ttyUSB0", "ssh://me@pc/dev/x"]


def test_what_does_not_count_is_shown_as_the_default(file, capsys):
    file.write_text('[screen]\ntheme = "pink"\n[keys]\npalette = "^G"\npalete = "F9"\n')
    assert main(["config", "show"]) == 0
    out = capsys.readouterr().out
    assert 'palette = "^P"   # default; the file\'s does not count\n' in out and "palete" not in out
    assert 'theme = "by the terminal"   # default; the file\'s does not count\n' in out


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[keys]\n\npalette = '^X'\n", ":3: keys.palette: ^X stops all drives"),
        ("[keys]\npalete = '^G'\n", ":2: keys.palete: no such function"),
        ("[screen]\ntheme = 'pink'\n", ":2: screen.theme: no theme pink"),
        ("[screen]\ncolour = 'pink'\n", ":2: no key screen.colour"),
        ("[connections.a]\nurl = '/dev/ttyX?bau=9600'\n", ":2: connections.a.url: /dev/ttyX?bau=9600: no key bau"),
        ("[connections.a]\nunits = {}\nurl = 'tcp://'\n", ":3: connections.a.url: tcp://: tcp: needs //HOST:PORT"),
        ("[screen\n", "multidrop.toml"),
    ],
)
def test_what_is_wrong_is_reported_with_its_line(file, capsys, text, said):
    file.write_text(text)
    assert main(["config", "check"]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1


def test_a_right_configuration_is_said_to_be_right(file, capsys):
    assert main(["config", "check"]) == 0
    file.write_text(
        "[screen]\ntheme = 'multidrop-light'\nsigns = 'ascii'\n[keys]\npalette = 'F9'\nplay-f9 = 'Ctrl+F9'\n"
    )
    assert main(["config", "check"]) == 0
    assert capsys.readouterr().out.endswith(f"{file} is right\n")


@pytest.mark.process
@pytest.mark.pty
@pytest.mark.parametrize("front", ["demo", "shell"])
def test_the_screen_and_the_prompt_start_and_tell_all_that_is_wrong(front, home):
    (home.folder / "conf").mkdir(exist_ok=True)
    (home.folder / "conf" / "multidrop.toml").write_text("[guards]\nalso = [\n[screen]\ntimes = 5\n[log]\nfiles = 0\n")
    child = home.terminal(*([front] if front == "demo" else [front, "sim:"]), columns=160)
    for told in ("not TOML", "screen.times", "log.files"):  # a row of the screen is narrow
        child.expect(told, timeout=20)
    child.send("/quit\r")
    assert read_to_end(child) == 0


def test_the_example_of_the_page_is_right(file, capsys):
    page = (ROOT / "docs" / "configuration.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    file.write_text(example, encoding="utf-8")
    assert main(["config", "check"]) == 0, capsys.readouterr().err


@pytest.fixture
def own_cell(tmp_path):
    """A folder with a cell whose paths leave the folder of the cell."""
    write_leaving(tmp_path)
    return tmp_path


def test_paths_of_a_cell_leave_its_folder_where_the_configuration_allows_it(own_cell):
    commands = (
        ("send", "sim:cell/own.toml", "PR P"),
        ("program", "test", "feed.mxt", "--cell", "cell/own.toml", "--run", "G1"),
    )
    for each in commands:
        assert_allowed_by_configuration(own_cell, *each)


@pytest.mark.process
@pytest.mark.pty
def test_paths_of_a_cell_leave_its_folder_where_its_server_is_given_allow(own_cell):
    running = Running("sim", "cell/own.toml", "--allow", "feed.mxt", "--allow", "p.tty", "--json", folder=own_cell)
    try:
        running.until('{"ready": true}')
        assert (own_cell / "p.tty").is_symlink()
        running.process.send_signal(signal.SIGINT)
        assert running.end() == 0
    finally:
        running.process.kill()


def test_a_list_of_the_configuration_that_is_none_is_one_line(file, capsys):
    for text in ('[simulator]\nallow = "x"\n', "simulator = 1\n"):
        file.write_text(text)
        assert main(["config", "check"]) == 2
        [line] = capsys.readouterr().err.splitlines()
        assert re.search(r"multidrop.toml:\d: .*simulator", line)


def test_a_command_goes_on_without_the_file_and_names_what_is_not_in_force(file, capsys):
    file.write_text(
        '[guards]\nalso = ["EX"]\n[connections.a]\nurl = "sim:"\nnames = { a = "left" }\n[log]\nfiles = 0\n'
    )
    assert main(["config", "show"]) == 2
    assert capsys.readouterr().err == (
        f"{file}:7: log.files is not a number from 1 to 1000; --no-config goes on without the file\n"
    )
    for given in (["config", "show", "--no-config"], ["--no-config", "config", "show"]):
        assert main(given) == 0
        shown = capsys.readouterr()
        assert '"left"' not in shown.out and len(shown.err.splitlines()) == 1
        assert "the guards on EX" in shown.err and "the names of a" in shown.err
    assert main(["config", "show"]) == 2
