"""The macros of a person and those beside a project: which one is meant, and what a change of one leaves."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.macros import Macro, MacroStep, MacroStore, format_macro, parse_macro
from multidrop.macros.store import listed
from multidrop.macros.toml_format import quoted, with_values
from tests.support.cases import for_each

ONE = (MacroStep(0.0, "MR 1"),)
TEXT = '# mine\nname = "{0}"\nkey = "{1}"\nnote = "n"\n[[step]]\nline = "MR 1" # far\n'


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path]:
    own, project = tmp_path / "own", tmp_path / "project"
    for each in (own, project):
        each.mkdir()
    return own, project


@pytest.fixture
def store(folders: tuple[Path, Path]) -> MacroStore:
    return MacroStore(*folders)


def put(folder: Path, name: str, key: str = "", more: str = "") -> Path:
    path = folder / f"{name}.toml"
    path.write_text(more + TEXT.format(name, key))
    return path


def told(call: object, *given: object, **named: object) -> str:
    with pytest.raises(Diagnostic) as caught:
        call(*given, **named)  # type: ignore[operator]
    return str(caught.value)


def test_a_macro_of_the_project_hides_the_persons_of_the_same_name(
    store: MacroStore, folders: tuple[Path, Path]
) -> None:
    own, project = folders
    for folder, names in ((own, "abx"), (project, "bcx")):
        for name in names:
            put(folder, name, more=f'recorded = "{folder.name}"\n')
    (own / "notes.txt").write_text("no macro")
    (own / ".hidden.toml").write_text("left by an editor")
    assert store.folders == (project, own)
    assert store.names() == ["a", "b", "c", "x"]
    assert [store.load(name).recorded for name in "abcx"] == ["own", "project", "project", "project"]
    assert [store.is_project(name) for name in "abc"] == [False, True, True]
    line = f"macro b: the one in {project} is played, not that in {own}"
    assert store.hidden() == [line, line.replace(" b:", " x:")]
    assert [store.hides(name) for name in "abc"] == ["", line, ""]
    assert listed(store).lines == [
        "a                -    1 line  n",
        f"b                -    1 line  n  [{project}]",
        f"c                -    1 line  n  [{project}]",
        f"x                -    1 line  n  [{project}]",
    ]
    assert listed(store).warnings == store.hidden()


def test_one_folder_is_no_project_beside_itself(folders: tuple[Path, Path]) -> None:
    own, _ = folders
    for store in (MacroStore(own), MacroStore(own, own), MacroStore(own, own.parent / "project" / ".." / "own")):
        put(own, "a")
        assert (store.project, store.folders, store.hidden(), store.names()) == (None, (own,), [], ["a"])
        assert not store.is_project("a") and store.hides("a") == ""


def test_a_new_macro_is_the_persons_and_a_copy_is_beside_the_old_one(
    store: MacroStore, folders: tuple[Path, Path]
) -> None:
    own, project = folders
    assert store.save(Macro("a", ONE)) == own / "a.toml"
    put(project, "b", "F3")
    assert store.copy("b", "c") == project / "c.toml"
    assert store.copy("b", "d", own, keep_key=True) == own / "d.toml"
    assert (store.load("c").key, store.load("d").key) == ("", "F3")
    assert (project / "c.toml").read_text() == TEXT.format("c", "")
    assert (own / "d.toml").read_text() == TEXT.format("d", "F3")
    assert store.rename("b", "e") == project / "e.toml"
    assert (project / "e.toml").read_text() == TEXT.format("e", "F3") and not (project / "b.toml").exists()
    assert told(store.copy, "a", "a") == f"{own / 'a.toml'}: the file exists already; use another name"
    assert told(store.copy, "a", "-x").startswith("invalid macro name '-x'")


def test_what_is_not_there_is_told_with_what_is(store: MacroStore, folders: tuple[Path, Path]) -> None:
    own, project = folders
    assert told(store.load, "a") == f"{project} and {own}: no macro 'a'; no macro has been recorded"
    put(own, "b")
    put(project, "c")
    assert told(store.load, "a") == f"{project} and {own}: no macro 'a'; valid: b, c"
    assert told(store.delete, "a") == f"{own}: no macro 'a'"
    assert store.contents("a") is None
    assert store.delete("c") == project / "c.toml"
    assert store.names() == ["b"]


@for_each(
    "error, said",
    [
        (PermissionError(errno.EACCES, "Permission denied"), "Permission denied"),
        (OSError("the disk is gone"), "the disk is gone"),
    ],
)
def test_a_system_that_refuses_is_quoted(error: OSError, said: str, tmp_path: Path) -> None:
    folder = tmp_path / said.replace(" ", "-")
    store = MacroStore(folder)
    store.save(Macro("a", ONE))
    path, before = folder / "a.toml", store.contents("a")

    def refuse(*_: object, **__: object) -> None:
        raise error

    for name, call, text in [
        ("iterdir", store.names, f"{folder}: cannot read it ({said})"),
        ("unlink", lambda: store.delete("a"), f"{path}: cannot delete the file ({error.strerror})"),
    ]:
        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(Path, name, refuse)
            assert told(call) == text
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("multidrop.macros.store.opened", refuse)
        assert told(store.load, "a") == told(store.contents, "a") == f"{path}: cannot read it ({said})"
    for target, call, text in [
        (
            "write_atomically",
            lambda: store.save(Macro("a", ONE * 2), before),
            f"{path}: cannot write the file ({said}); the old file is unchanged",
        ),
        (
            "create_atomically",
            lambda: store.save(Macro("b", ONE)),
            f"{folder / 'b.toml'}: cannot write the file ({said})",
        ),
        ("make_folder", lambda: store.save(Macro("b", ONE)), f"{folder}: cannot make the folder ({said})"),
    ]:
        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(f"multidrop.macros.store.{target}", refuse)
            assert told(call) == text
    assert store.contents("a") == before and store.names() == ["a"]


def test_a_file_in_the_place_of_the_projects_folder_is_no_folder_and_the_persons_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    put(tmp_path, "a")
    assert MacroStore(tmp_path, tmp_path / "file").names() == ["a"]
    assert MacroStore(tmp_path, tmp_path / "file").contents("b") is None
    if os.name != "nt":
        assert "cannot read it" in told(MacroStore(tmp_path / "file").names)


def test_keys_are_in_pages_and_a_taken_one_is_refused(store: MacroStore, folders: tuple[Path, Path]) -> None:
    own, _ = folders
    assert store.pages() == ["1"]
    for name, key, page in (("a", "F3", "1"), ("b", "F3", "2"), ("c", "F3", "10"), ("d", "F4", "x"), ("e", "", "9")):
        store.save(Macro(name, ONE, key, page=page))
    assert store.pages() == ["1", "2", "10", "x"], "a page without a key is none"
    assert [each.name for each in store.on_key("f3", "2")[0]] == ["b"]
    assert [each.name for each in store.on_key("F3")[0]] == ["a"]
    put(own, "broken", more="key =\n")
    found, broken = store.on_key("F4", "x")
    assert [each.name for each in found] == ["d"] and [Path(each.where.rpartition(":")[0]).stem for each in broken] == [
        "broken"
    ]
    assert told(store.set_key, "e", "F3", "2").startswith(
        f"{own / 'e.toml'}: F3 (page 2) already plays b; take another key, or none, for one of them"
    )
    store.set_key("e", "F4", "2")
    assert (store.load("e").key, store.load("e").page) == ("F4", "2")
    store.set_key("e", "", "x")
    assert (store.load("e").key, store.load("e").page) == ("", "2"), "without a key the page stays"
    store.set_key("b", "F3", "2")
    assert store.load("b").key == "F3", "its own key is not taken"
    (own / "f.toml").write_text(format_macro(Macro("f", ONE, "F3", page="2")))
    (own / "g.toml").write_text(format_macro(Macro("g", ONE, "F3")))
    assert store.clashes() == [
        "a and g are both on F3, which plays none of them",
        "b and f are both on F3 of page 2, which plays none of them",
    ]


def test_a_free_name_is_the_first_that_no_macro_has(store: MacroStore, folders: tuple[Path, Path]) -> None:
    own, project = folders
    assert store.free_name("a") == "a-2"
    put(own, "a-2")
    put(project, "a-3")
    assert store.free_name("a") == "a-4"
    assert store.free_name("x" * 64) == f"{'x' * 60}-2"


def test_a_note_is_changed_in_its_line_only(store: MacroStore, folders: tuple[Path, Path]) -> None:
    path = put(folders[1], "a", "F3")
    store.describe("a", 'to "the" left')
    assert path.read_text() == TEXT.format("a", "F3").replace('"n"', '"to \\"the\\" left"')


def test_a_file_that_changes_in_the_moment_of_a_change_stays(
    store: MacroStore, folders: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    path, other = put(folders[0], "a"), TEXT.format("a", "F9") + "# another program\n"

    def meanwhile(*given: object) -> str:
        path.write_text(other)
        return with_values(*given)  # type: ignore[arg-type]

    monkeypatch.setattr("multidrop.macros.store.with_values", meanwhile)
    assert told(store.describe, "a", "x") == f"{path}: the file has changed meanwhile; it is as it is now; do it again"
    assert path.read_text() == other


# The text of a file


def test_a_file_of_all_parts_is_written_as_a_person_would() -> None:
    macro = Macro(
        "a",
        (MacroStep(1, "MR 1", "press:a", ("ok",)), MacroStep(0.5, "PR P", "", ("5", "> "))),
        "F3",
        "note",
        "2",
        ("press",),
        ("SL 0", "H"),
        True,
        "2026-11-29",
    )
    text = format_macro(macro)
    assert text.partition("\n")[2] == (
        'name = "a"\nkey = "F3"\npage = "2"\nnote = "note"\nrecorded = "2026-11-29"\nroles = ["press"]\n'
        'on_early_end = [\n    "SL 0",\n    "H",\n]\non_early_end_moves = true\n'
        '\n[[step]]\nafter = 1.0\nline = "MR 1"\ndrive = "press:a"\nreplies = ["ok"]\n'
        '\n[[step]]\nafter = 0.5\nline = "PR P"\nreplies = [\n    "5",\n    "> ",\n]\n'
    )
    assert parse_macro(text) == macro


@for_each(
    "text, written",
    [
        ("", '""'),
        ('a"b\\c', '"a\\"b\\\\c"'),
        ("\t\n\r\b\f", '"\\t\\n\\r\\b\\f"'),
        ("\x1b\x7f", '"\\u001b\\u007f"'),
        ("\u202e\uffff", '"\\u202e\\uffff"'),
        ("\U000e0001", '"\\U000e0001"'),
        ("\u00e4\U0001f600", '"\u00e4\U0001f600"'),
    ],
)
def test_what_a_terminal_would_act_upon_is_written_as_its_number(text: str, written: str) -> None:
    assert quoted(text) == written


HEAD = 'name = "a"\n'
STEP = '[[step]]\nline = "MR 1"\n'


@for_each(
    "text, where",
    [
        ("page = 1.5\n" + HEAD + STEP, "x:1: page must be a number or text in quotes"),
        ("page = true\n" + HEAD + STEP, "x:1: page must be a number or text in quotes"),
        (HEAD + "on_early_end_moves = 1\n" + STEP, "x:2: on_early_end_moves must be true or false"),
        (HEAD + "roles = 'a'\n" + STEP, 'x:2: roles must be texts in brackets: ["...", "..."]'),
        (HEAD + "roles = ['a', 1]\n" + STEP, 'x:2: roles must be texts in brackets: ["...", "..."]'),
        (HEAD + "note = 1\n" + STEP, "x:2: note must be text in quotes"),
        (HEAD + STEP + STEP + "after = 1000000000000001\n", "x:6: step 2: after must be a number"),
        (HEAD + STEP + STEP + "replies = [1]\n", 'x:6: step 2: replies must be texts in brackets: ["...", "..."]'),
        (HEAD + STEP + "drive = 1\n", "x:4: step 1: drive must be text in quotes"),
        (HEAD + STEP + "[[step]]\nafter = 1\n", 'x:4: step 2: no line; add line = "..."'),
        (HEAD + "step = [1]\n", "x:2: step 1: must be a table; write [[step]], then after = and line ="),
        (STEP, 'x: no name; add name = "..."'),
        (HEAD + "on_stop = ['S']\non_stop_moves = 1\n" + STEP, "x:3: on_early_end_moves must be true or false"),
        (
            HEAD + "on_stop = ['S']\non_early_end = ['S']\n" + STEP,
            "x:2: on_stop is the old name of on_early_end, which is there too; keep one of them",
        ),
        (HEAD + STEP + "delay = 1\n", "x:4: step 1: unknown key 'delay'; valid keys: after, line, drive, replies"),
    ],
)
def test_a_wrong_value_in_a_file_is_told_with_its_line(text: str, where: str) -> None:
    assert told(parse_macro, text, "x") == where


def test_what_is_left_out_has_its_usual_value() -> None:
    assert parse_macro(HEAD + STEP) == Macro("a", ONE)
    found = parse_macro(HEAD + "key = 'f3'\npage = 2\n[[step]]\nafter = 1000000000000000\nline = 'MR 1'\n")
    assert (found.key, found.page, found.steps[0].after) == ("F3", "2", 1e15)


@for_each(
    "text, values, changed",
    [
        ("", {"a": "1"}, 'a = "1"\n'),
        ("x = 1", {"a": "1"}, 'x = 1\na = "1"\n'),
        ("x = 1\r\n", {"a": "1"}, 'x = 1\r\na = "1"\r\n'),
        ("# head\n\nx = 1\ny = 2\n", {"a": "1", "b": "2"}, '# head\n\nx = 1\nb = "2"\na = "1"\ny = 2\n'),
        ("# only\n", {"a": "1"}, '# only\na = "1"\n'),
        ("[t]\nx = 1\n", {"a": "1"}, 'a = "1"\n[t]\nx = 1\n'),
        ("x = [\n 1,\n]\n", {"a": "1"}, 'a = "1"\nx = [\n 1,\n]\n'),
        ("\ufeffa = '0' # old\n", {"a": "1"}, '\ufeffa = "1" # old\n'),
    ],
)
def test_a_value_is_set_in_its_line_or_behind_the_first_statement(
    text: str, values: dict[str, str], changed: str
) -> None:
    assert with_values(text, values, "x") == changed
