"""A connection saved in the configuration: its remarks stay, and nothing is replaced."""

import pytest

from multidrop.dialects import Diagnostic
from multidrop.shell.connect import settings

OLD = "# the shop\n[connections.press]\nurl = 'serial:/dev/ttyS0'   # left\n"


@pytest.fixture
def file(tmp_path, monkeypatch):
    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(tmp_path))
    return tmp_path / "multidrop.toml"


def test_a_connection_is_added_and_remarks_stay(file):
    file.write_text(OLD)
    assert settings.save("clamp", "serial:/dev/ttyUSB0?baud=9600") == file
    assert file.read_text().startswith(OLD)
    assert {name: each.url for name, each in settings.load().connections.items()} == {
        "press": "serial:/dev/ttyS0",
        "clamp": "serial:/dev/ttyUSB0?baud=9600",
    }
    assert list(file.parent.iterdir()) == [file]


def test_a_new_file_is_made(file):
    settings.save("clamp", "sim:")
    assert settings.load().connections["clamp"].url == "sim:"


@pytest.mark.parametrize(("name", "why"), [("press", "exists already"), ("a b", "not a name"), ("", "not a name")])
def test_a_name_that_exists_or_is_none_is_refused_and_nothing_changes(file, name, why):
    file.write_text(OLD)
    with pytest.raises(Diagnostic, match=why):
        settings.check_new(name)
    with pytest.raises(Diagnostic, match=why):
        settings.save(name, "sim:")
    assert file.read_text() == OLD


def test_a_folder_that_cannot_be_written_is_named(file):
    file.mkdir()
    with pytest.raises(Diagnostic, match="multidrop.toml"):
        settings.save("clamp", "sim:")
