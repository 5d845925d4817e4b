"""The configuration: read as a whole; a connection saved in it, where remarks stay and nothing is replaced."""

import json
from pathlib import Path

import pytest

from multidrop.dialects import Diagnostic
from multidrop.shell import configuration


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(tmp_path / "config"))
    monkeypatch.setenv("MULTIDROP_STATE_DIR", str(tmp_path / "state"))
    (tmp_path / "config").mkdir()
    return tmp_path / "config"


def test_no_file_is_an_empty_configuration(folder):
    found = configuration.load()
    assert found.connections == {}
    assert (found.macros, found.history) == (folder / "macros", folder.parent / "state" / "history")


def test_connections_have_a_url_and_names_for_their_drives(folder):
    text = '[connections.press]\nurl = "/dev/ttyUSB0?drives=a"\nnames = { a = "gantry" }\n'
    (folder / "multidrop.toml").write_text(text)
    found = configuration.load().connections["press"]
    assert (found.name, found.url, found.names) == ("press", "/dev/ttyUSB0?drives=a", {"a": "gantry"})


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("connection = 1", "no key connection"),
        ("connections = 1", "connections"),
        ("[connections.press]\nurl = 5", "connections.press.url"),
        ("[connections.press]\n", "connections.press.url"),
        ('[connections.press]\nurl = "sim:"\nbaud = 9600', "connections.press.baud"),
        ('[connections.press]\nurl = "sim:"\nnames = ["a"]', "connections.press.names"),
        ('[connections.press]\nurl = "sim:"\nnames = { a = "the press" }', "connections.press.names"),
        ('[connections."a b"]\nurl = "sim:"', "a b"),
        ("[connections.press\nurl = 1", "multidrop.toml:1: not TOML"),
    ],
)
def test_a_mistake_is_told_with_the_file_and_the_key(folder, text, named):
    (folder / "multidrop.toml").write_text(text)
    with pytest.raises(Diagnostic) as caught:
        configuration.load()
    assert str(caught.value).startswith(str(folder / "multidrop.toml"))
    assert named in str(caught.value)


def test_a_file_that_cannot_be_read_is_named(folder):
    (folder / "multidrop.toml").mkdir()
    with pytest.raises(Diagnostic, match="multidrop.toml: cannot be read"):
        configuration.load()


def test_without_the_variables_the_platform_says_where(monkeypatch):
    monkeypatch.delenv("MULTIDROP_CONFIG_DIR", raising=False)
    monkeypatch.setenv("XDG_CONFIG_HOME", "/somewhere")
    assert configuration.config_file() == Path("/somewhere/multidrop/multidrop.toml")


@pytest.mark.parametrize("label", ["\x1b[31mred", "left\u202e", "a\x9b2J"])
def test_a_name_that_would_act_on_a_terminal_is_refused(label):
    with pytest.raises(Diagnostic, match="control characters"):
        configuration.parse(f"[connections.a]\nurl = 'sim:'\nnames = {{ a = {json.dumps(label)} }}\n", "multidrop.toml")


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ('[log]\nalways = true\n\n[screen]\n# a remark\ncolor = "red"\n', 6),
        ('[screen]\nsigns = "none"\n', 2),
        ("[keys]\npalette = 5\n", 2),
        ('[connections.press]\nurl = "sim:"\nbaud = 9600\n', 3),
        ("screen.nothing = 1\n", 1),
        ("[nothing]\n", 1),
        ("[log]\nfiles = 0\n", 2),
    ],
)
def test_what_is_wrong_is_reported_with_its_line(folder, text, line):
    (folder / "multidrop.toml").write_text(text)
    with pytest.raises(Diagnostic) as failure:
        configuration.load()
    assert failure.value.where == f"{folder / 'multidrop.toml'}:{line}"


OLD = "# the shop\n[connections.press]\nurl = 'serial:/dev/ttyS0'   # left\n"


@pytest.fixture
def file(tmp_path, monkeypatch):
    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(tmp_path))
    return tmp_path / "multidrop.toml"


def test_a_connection_is_added_and_remarks_stay(file):
    file.write_text(OLD)
    assert configuration.save("clamp", "serial:/dev/ttyUSB0?baud=9600") == file
    assert file.read_text().startswith(OLD)
    assert {name: each.url for name, each in configuration.load().connections.items()} == {
        "press": "serial:/dev/ttyS0",
        "clamp": "serial:/dev/ttyUSB0?baud=9600",
    }
    assert list(file.parent.iterdir()) == [file]


def test_a_new_file_is_made(file):
    configuration.save("clamp", "sim:")
    assert configuration.load().connections["clamp"].url == "sim:"


@pytest.mark.parametrize(("name", "why"), [("press", "exists already"), ("a b", "not a name"), ("", "not a name")])
def test_a_name_that_exists_or_is_none_is_refused_and_nothing_changes(file, name, why):
    file.write_text(OLD)
    with pytest.raises(Diagnostic, match=why):
        configuration.check_new(name)
    with pytest.raises(Diagnostic, match=why):
        configuration.save(name, "sim:")
    assert file.read_text() == OLD


def test_a_folder_that_cannot_be_written_is_named(file):
    file.mkdir()
    with pytest.raises(Diagnostic, match="multidrop.toml"):
        configuration.save("clamp", "sim:")
