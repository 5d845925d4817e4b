"""The configuration: read as a whole; a connection saved in it, where remarks stay and nothing is replaced."""

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base import places
from multidrop.base.errors import Diagnostic
from multidrop.shell import configuration, line_syntax
from multidrop.shell.broken_configuration import salvage


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


WRONG = """[connections.press]
url = "tcp://127.0.0.1:9"
names = { a = "x y" }
[connections.eth]
url = 5
[connections.stage]
url = "tcp://127.0.0.1:8"
unit = { a = "5 mm/turn" }
[guards]
off = ["NONE"]
[log]
files = "x"
megabytes = 3
"""


KEPT = '[connections.kept]\nurl = "sim:"\n'


def test_all_errors_are_told_at_once_and_the_last_one_names_the_way_past_them(folder):
    (folder / "multidrop.toml").write_text(WRONG)
    with pytest.raises(Diagnostic) as caught:
        configuration.load()
    told = [str(problem).removeprefix(f"{folder / 'multidrop.toml'}:") for problem in caught.value.problems]
    assert [each.partition(":")[0] for each in told] == ["3", "5", "8", "10", "12"]
    assert told[-1].endswith("; --no-config goes on without the file")
    assert str(caught.value) == str(caught.value.problems[0])


def test_what_is_right_in_a_file_with_errors_counts_and_what_drives_lack_is_in_doubt(folder):
    (folder / "multidrop.toml").write_text(WRONG)
    found = configuration.load(lenient=True)
    assert (found.log.size, found.log.files) == (3_000_000, 8)
    assert [(name, each.names) for name, each in found.connections.items()] == [("press", {}), ("stage", {})]
    assert set(found.in_doubt) == {"press", "eth", "stage"} and len(found.problems) == 5


@pytest.mark.parametrize(
    ("text", "in_doubt"),
    [
        ('[log]\nalways = \n[connections.a]\nurl = "sim:"', set()),
        ('[guards]\nalso = [\n[connections.a]\nurl = "sim:"', {""}),
        ('[connections.b]\nurl = "sim:"\nunits = { a = }\n[connections.a]\nurl = "sim:"', {"b"}),
        ('[guard]\nalso = ["EX"]\n[connections.a]\nurl = "sim:"', {""}),
        ('[guards]\nalso = ["EX", 5]\n[connections.a]\nurl = "sim:"', {""}),
        ('[guards]\noff = 5\n[connections.a]\nurl = "sim:"', set()),
        ('connections.b = 5\n[connections.a]\nurl = "sim:"', {"b"}),
        ('x = \n[connections.a]\nurl = "sim:"', {""}),
        ('[log]\nalways = true\n[log]\n[connections.a]\nurl = "sim:"', {""}),
    ],
)
def test_a_broken_section_takes_no_other_with_it(folder, text, in_doubt):
    found = configuration.parse(text, "multidrop.toml", lenient=True)
    assert "a" in found.connections and set(found.in_doubt) == in_doubt and found.problems


@given(
    st.lists(
        st.sampled_from([*WRONG.splitlines(True), "[", "= 1\n", "\n", "[[log]]\n", '"""\n', "log = 1\n"]), max_size=9
    )
)
def test_any_file_is_read_or_told(lines):
    found = configuration.parse("".join(lines), "multidrop.toml", lenient=True)
    assert all(str(problem).startswith("multidrop.toml") for problem in found.problems)
    assert found.problems or not found.in_doubt


def test_no_config_reads_nothing(folder):
    (folder / "multidrop.toml").write_text(WRONG + KEPT)

    with places.without_configuration():
        assert configuration.load() == configuration.Settings()
        with pytest.raises(Diagnostic, match="a connection kept exists already"):
            configuration.save("kept", "sim:")
        assert (folder / "multidrop.toml").read_text() == WRONG + KEPT


def test_a_file_that_cannot_be_read_is_named(folder):
    (folder / "multidrop.toml").mkdir()
    with pytest.raises(Diagnostic, match="multidrop.toml: cannot be read"):
        configuration.load()


def test_without_the_variables_the_platform_says_where(monkeypatch):
    monkeypatch.delenv("MULTIDROP_CONFIG_DIR", raising=False)
    monkeypatch.setenv("XDG_CONFIG_HOME", "/somewhere")
    assert places.config_file() == Path("/somewhere/multidrop/multidrop.toml")


@pytest.mark.parametrize("label", ["-rf", "=1+1", "+1", "@x", "\x1b[31mred", "left\u202e", "a\x9b2J"])
def test_a_name_that_would_act_on_a_terminal_or_in_a_command_line_or_a_table_is_refused(label):
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


@pytest.mark.parametrize(
    ("name", "why"), [("press", "exists already"), ("a b", "not a name"), ("", "not a name"), ("-x", "not - first")]
)
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


def test_a_name_in_quotation_marks_has_its_line_too(folder):
    (folder / "multidrop.toml").write_text('[log]\nfiles = 3\n[connections."a b"]\nurl = "sim:"\n')
    with pytest.raises(Diagnostic) as caught:
        configuration.load()
    assert caught.value.where.endswith("multidrop.toml:3") and "connections.a b: not a name" in str(caught.value)


def test_a_value_that_is_kept_makes_its_table_and_leaves_the_rest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(tmp_path))
    path = configuration.keep("screen", "times", "last")
    assert path.read_text(encoding="utf-8") == '[screen]\ntimes = "last"\n'
    configuration.keep("screen", "signs", "ascii")
    assert configuration.load().screen.times == "last" and configuration.load().screen.signs == "ascii"


def test_lines_name_drives_only_where_every_one_does() -> None:
    assert line_syntax.targets(["@a PR P", "/wait stopped", "@press:b PR P", "@a MR 1"]) == ("a", "press:b")
    for other in ("PR P", "@* PR P", "@a PR 'P"):
        found = line_syntax.targets(["@a PR P", other])
        assert found == (("a",) if other.startswith("@a") else ())


def test_an_error_of_an_empty_document_ends_the_salvage():
    def read(document: dict[str, object], where: str) -> None:
        raise Diagnostic("never right")

    with pytest.raises(Diagnostic, match="^never right$"):
        salvage("[screen]\ntheme = 1\n", "f.toml", read)
