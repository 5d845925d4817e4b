import errno
import os
import re
import sys
import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.macros import Macro, MacroStep, MacroStore, format_macro, parse_macro
from multidrop.macros.store import listed
from multidrop.macros.toml_format import quoted, with_values

SHUTTLE = Macro("shuttle", (MacroStep(0.0, "@b EX Ga"), MacroStep(1.25, 'PR "x \\ y"')), key="F3", note="to and fro")
GOOD = 'name = "a"\n[[step]]\nafter = 0\nline = "MR 1"\n'


@pytest.fixture
def store(tmp_path: Path) -> MacroStore:
    return MacroStore(tmp_path / "config" / "macros")


def test_what_is_saved_is_loaded_from_a_folder_that_was_not_there(store: MacroStore) -> None:
    assert store.names() == []
    path = store.save(SHUTTLE)
    assert path == store.folder / "shuttle.toml"
    assert store.load("shuttle") == SHUTTLE
    assert store.names() == ["shuttle"]
    assert os.listdir(store.folder) == ["shuttle.toml"]


def test_the_file_reads_like_the_lines_that_were_typed() -> None:
    assert format_macro(SHUTTLE) == (
        "# a macro of multidrop: lines as typed, with the seconds after the line before\n"
        'name = "shuttle"\nkey = "F3"\nnote = "to and fro"\n'
        '\n[[step]]\nafter = 0.0\nline = "@b EX Ga"\n'
        '\n[[step]]\nafter = 1.25\nline = "PR \\"x \\\\ y\\""\n'
    )


LINES = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\n\r"))
TIMES = st.floats(min_value=0.0, allow_infinity=False, allow_nan=False)


@given(st.lists(st.builds(MacroStep, TIMES, LINES), min_size=1), st.text(st.characters(exclude_categories=["Cs"])))
def test_any_line_survives_the_file(steps: list[MacroStep], note: str) -> None:
    macro = Macro("m", tuple(steps), "F12", note)
    text = format_macro(macro)
    assert all(char == "\n" or char.isprintable() for char in text)
    assert tomllib.loads(text)["step"][0]["line"] == steps[0].line
    assert parse_macro(text) == macro


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("name = \n", "x.toml:1: not TOML"),
        (GOOD + "line = 'again'\n", "x.toml:5: not TOML"),
        (GOOD.replace('name = "a"', ""), "no name"),
        (GOOD.replace('"a"', "7"), "name must be text in quotes"),
        (GOOD.replace('"a"', '"a b"'), "invalid macro name 'a b'"),
        (
            "colour = 1\n" + GOOD,
            "unknown key 'colour'; valid keys: name, key, page, note, recorded, roles, on_early_end, "
            "on_early_end_moves, step",
        ),
        ("on_stop = ['S']\non_early_end = ['S']\n" + GOOD, "x.toml:1: on_stop is the old name of on_early_end"),
        ("on_stop = [1]\n" + GOOD, "x.toml:1: on_early_end must be texts"),
        ("key = 'F1'\n" + GOOD, "invalid key 'F1'"),
        (GOOD + "delay = 1\n", "step 1: unknown key 'delay'; valid keys: after, line, drive, replies"),
        (GOOD.replace("0\n", '"0"\n'), "step 1: after must be a number"),
        (GOOD.replace("0\n", "true\n"), "step 1: after must be a number"),
        (GOOD.replace("0\n", "-1\n"), "step 1: invalid after = -1.0"),
        (GOOD.replace("0\n", "nan\n"), "step 1: invalid after = nan"),
        (GOOD.replace("0\n", "inf\n"), "step 1: invalid after = inf"),
        (GOOD.replace('"MR 1"', "['MR 1']"), "step 1: line must be text in quotes"),
        (GOOD.replace('line = "MR 1"', ""), "step 1: no line"),
        ('name = "a"\n', "a macro without steps"),
        ('name = "a"\nstep = "MR 1"\n', "step must be [[step]] tables"),
        ('name = "a"\nstep = ["MR 1"]\n', "step 1: must be a table"),
    ],
)
def test_a_wrong_file_is_told_with_its_name(text: str, says: str) -> None:
    with pytest.raises(Diagnostic, match=r"^x\.toml") as caught:
        parse_macro(text, "x.toml")
    assert says in str(caught.value)


@given(st.text(st.sampled_from('name="[]step\n#F3\\ 0.1e{}line')) | st.text())
def test_any_text_is_a_macro_or_a_diagnostic(text: str) -> None:
    try:
        macro = parse_macro(text, "x.toml")
    except Diagnostic as problem:
        assert "x.toml" in str(problem)
    else:
        assert parse_macro(format_macro(macro)) == macro


def put(store: MacroStore, name: str, data: bytes) -> None:
    store.folder.mkdir(parents=True, exist_ok=True)
    (store.folder / f"{name}.toml").write_bytes(data)


def test_a_file_that_is_no_utf_8_is_told_with_its_line(store: MacroStore) -> None:
    put(store, "a", GOOD.encode() + b"# caf\xe9\n")
    with pytest.raises(Diagnostic, match=r"a\.toml:5: not UTF-8"):
        store.load("a")


def test_a_byte_order_mark_and_windows_line_ends_are_read(store: MacroStore) -> None:
    put(store, "a", b"\xef\xbb\xbf" + GOOD.replace("\n", "\r\n").encode())
    assert store.load("a").steps == (MacroStep(0.0, "MR 1"),)


def test_a_file_under_another_name_is_told(store: MacroStore) -> None:
    put(store, "b", GOOD.encode())
    with pytest.raises(Diagnostic, match="name = 'a' in the file of 'b'"):
        store.load("b")


@pytest.mark.fork
def test_what_is_no_file_is_told_and_never_waited_for(store: MacroStore) -> None:
    store.save(SHUTTLE)
    os.mkfifo(store.folder / "pipe.toml")
    (store.folder / "zero.toml").symlink_to("/dev/zero")
    (store.folder / "lost.toml").symlink_to("nowhere")
    problems = "\n".join(map(str, listed(store).broken))
    for words in (
        "lost.toml: a link to a file that is not",
        "pipe.toml: is not a regular file",
        "zero.toml: is not a regular file",
    ):
        assert words in problems
    with pytest.raises(Diagnostic, match="not a regular file"):
        store.save(Macro("pipe", SHUTTLE.steps), b"")


def test_a_file_whose_name_no_macro_can_have_is_told_and_hides_no_other(store: MacroStore, tmp_path: Path) -> None:
    for folder in (store.folder, tmp_path / "macros"):
        MacroStore(folder).save(SHUTTLE)
    put(store, "sp ce", GOOD.encode())
    found = listed(MacroStore(store.folder, tmp_path / "macros"))
    assert [line.split()[0] for line in found.lines] == ["shuttle"]
    assert "sp ce" in str(found.broken) and "shuttle: the one in" in str(found.warnings)


def test_a_macro_that_is_not_there_is_told_with_those_that_are(store: MacroStore) -> None:
    store.save(SHUTTLE)
    with pytest.raises(Diagnostic, match="no macro 'shuttel'.*valid: shuttle"):
        store.load("shuttel")
    with pytest.raises(Diagnostic, match="no macro 'x'"):
        store.delete("x")
    with pytest.raises(Diagnostic, match="invalid macro name"):
        store.load("../shuttle")


def test_a_key_plays_its_macro_whatever_other_files_are_broken(store: MacroStore) -> None:
    store.save(SHUTTLE)
    assert store.on_key("F3") == store.on_key("f3") == ([SHUTTLE], [])
    assert store.on_key("F4") == ([], [])
    put(store, "broken", b"name =")
    assert store.on_key("F3")[0] == [SHUTTLE]
    found, [problem] = store.on_key("F4")
    assert found == [] and problem.where.startswith(str(store.path("broken")))


def test_a_second_macro_on_a_key_is_refused(store: MacroStore) -> None:
    store.save(SHUTTLE)
    with pytest.raises(Diagnostic, match="F3 already plays shuttle"):
        store.save(Macro("other", SHUTTLE.steps, "F3"))
    assert store.names() == ["shuttle"]
    again = Macro("shuttle", SHUTTLE.steps, "F3", "the same may be saved again")
    store.save(again, store.contents("shuttle"))


def test_two_files_on_a_key_are_told(store: MacroStore) -> None:
    for name in "ab":
        put(store, name, f'key = "F5"\n{GOOD}'.replace('"a"', f'"{name}"').encode())
    assert [macro.name for macro in store.on_key("F5")[0]] == ["a", "b"]
    assert store.clashes() == ["a and b are both on F5, which plays none of them"]


def test_a_deleted_macro_is_gone(store: MacroStore) -> None:
    store.save(SHUTTLE)
    store.delete("shuttle")
    assert store.names() == []


def test_a_full_disk_leaves_the_old_macro_and_no_litter(store: MacroStore, monkeypatch: pytest.MonkeyPatch) -> None:
    store.save(SHUTTLE)
    before = store.path("shuttle").read_bytes()

    def full(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        with pytest.raises(Diagnostic, match=r"shuttle\.toml: cannot write the file \(No space left on device\)"):
            store.save(Macro("shuttle", (MacroStep(0.0, "MR 2"),)), before)
    assert store.path("shuttle").read_bytes() == before
    assert os.listdir(store.folder) == ["shuttle.toml"]


def test_a_write_that_stops_halfway_leaves_the_old_macro_and_no_litter(store: MacroStore) -> None:
    resource = pytest.importorskip("resource")
    store.save(SHUTTLE)
    before = store.path("shuttle").read_bytes()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, hard))
    try:
        with pytest.raises(Diagnostic, match="cannot write the file"):
            store.save(Macro("shuttle", (MacroStep(0.0, "MR 2" * 100),)), before)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert store.path("shuttle").read_bytes() == before
    assert os.listdir(store.folder) == ["shuttle.toml"]


def test_a_folder_that_cannot_be_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    store = MacroStore(tmp_path / "file" / "macros")
    with pytest.raises(Diagnostic, match="cannot make the folder"):
        store.save(Macro("m", SHUTTLE.steps))
    if sys.platform != "win32":  # which says of such a path that it is not there
        with pytest.raises(Diagnostic, match="cannot read it"):
            store.names()


@pytest.mark.fork
def test_a_link_to_a_file_elsewhere_stays_a_link(store: MacroStore, tmp_path: Path) -> None:
    store.folder.mkdir(parents=True)
    elsewhere = tmp_path / "dotfiles.toml"
    store.path("shuttle").symlink_to(elsewhere)
    store.save(SHUTTLE)
    assert store.path("shuttle").is_symlink()
    assert parse_macro(elsewhere.read_text()) == SHUTTLE


# -- what a person wrote into a file

WRITTEN = (
    "# the shuttle of line 4\n\n"
    "name   = 'a'   # as on the plan\n"
    'key = "F3"\t# left pedal\n'
    "# about the steps\n"
    "[[step]]\n"
    "after = 1_0.5    # the press needs it\n"
    'line = """MR 1"""\n\n'
    "[[step]]\n  line = 'PR P'\n# the end\n"
)
FORMS = {
    "unix": WRITTEN,
    "windows": WRITTEN.replace("\n", "\r\n"),
    "mixed": WRITTEN.replace("\n", "\r\n", 3),
    "marked": "\ufeff" + WRITTEN,
    "no last line end": WRITTEN.rstrip("\n"),
}


@pytest.mark.parametrize("form", FORMS)
def test_a_key_is_changed_and_nothing_else_in_the_file(store: MacroStore, form: str) -> None:
    put(store, "a", FORMS[form].encode())
    store.set_key("a", "F4")
    assert store.path("a").read_bytes().decode() == FORMS[form].replace('"F3"', '"F4"')
    store.set_key("a", "")
    assert store.path("a").read_bytes().decode() == FORMS[form].replace('"F3"', '""')


@pytest.mark.parametrize("form", FORMS)
def test_a_key_is_added_behind_the_name_and_nothing_else_is_changed(store: MacroStore, form: str) -> None:
    without = "".join(line for line in FORMS[form].splitlines(keepends=True) if not line.startswith("key"))
    put(store, "a", without.encode())
    store.set_key("a", "F4")
    lines = store.path("a").read_bytes().decode().splitlines(keepends=True)
    at = next(n for n, line in enumerate(lines) if line.startswith("key"))
    assert lines[at].rstrip("\r\n") == 'key = "F4"' and lines[at - 1].startswith("name")
    assert lines[at].endswith("\r\n") == lines[at - 1].endswith("\r\n")
    assert "".join(lines[:at] + lines[at + 1 :]) == without
    assert store.load("a").key == "F4"


@pytest.mark.parametrize(
    "text",
    [
        'step = [{line = "MR 1"}]\nname = "a"\n',
        'step = [\n  # one\n  {line = "MR 1"},\n]\nname = "a"',
        'note = """\nname = "b"\n"""\nname = "a"\n[[step]]\nline = "MR 1"',
        'name = "a"\n"key" = "F3" # x\n[[step]]\nline = "MR 1"',
    ],
)
def test_a_key_goes_into_any_form_of_file(store: MacroStore, text: str) -> None:
    put(store, "a", text.encode())
    before = store.load("a")
    store.set_key("a", "F9")
    after = store.load("a")
    assert (after.key, after.name, after.steps, after.note) == ("F9", before.name, before.steps, before.note)


@given(st.text(st.sampled_from('#" \n\r\t=[]x\u2028\u00e9'), max_size=30), st.text(max_size=20))
def test_remarks_anywhere_survive_a_change_of_the_key(remark: str, note: str) -> None:
    lines = re.split(r"[\r\n]+", remark)
    text = "".join(f"# {line}\n" for line in lines) + format_macro(Macro("a", (MacroStep(0.0, "MR 1"),), "F2", "x"))
    text += "".join(f"#{line}\r\n" for line in lines)
    try:
        parse_macro(text)
    except Diagnostic:
        return  # a control character within a remark
    assert with_values(text, {"key": "F12"}, "x") == text.replace('key = "F2"', 'key = "F12"')


@pytest.mark.parametrize(
    ("text", "changed"),
    [
        ("a = 'x'\n", "a = 'x'\nkey = 'F2'\n"),
        ("a = 'x'", "a = 'x'\nkey = 'F2'\n"),
        ("a = 'x'\r\n", "a = 'x'\r\nkey = 'F2'\r\n"),
        ("a = 'x'\nb = 1\r\n", "a = 'x'\nkey = 'F2'\nb = 1\r\n"),
        ("# remark\r\na = 'x'\nb = 1\n", "# remark\r\na = 'x'\nkey = 'F2'\r\nb = 1\n"),
        ("[a]\nb = 1\n", "key = 'F2'\n[a]\nb = 1\n"),
        ("a = [\n1]\n", "key = 'F2'\na = [\n1]\n"),
    ],
)
def test_a_new_key_stands_behind_the_first_statement_and_ends_as_the_lines_before_it(text: str, changed: str) -> None:
    assert with_values(text, {"key": "F2"}, "x") == changed.replace("'F2'", quoted("F2"))


@pytest.mark.fork
def test_a_file_keeps_its_mode_and_a_linked_one_too(store: MacroStore, tmp_path: Path) -> None:
    put(store, "a", WRITTEN.encode())
    store.path("a").chmod(0o640)
    store.set_key("a", "F4")
    assert store.path("a").stat().st_mode & 0o7777 == 0o640
    elsewhere = tmp_path / "dotfiles.toml"
    store.path("a").rename(elsewhere)
    store.path("a").symlink_to(elsewhere)
    store.set_key("a", "F5")
    assert store.path("a").is_symlink() and elsewhere.stat().st_mode & 0o7777 == 0o640
    assert elsewhere.read_text() == WRITTEN.replace("F3", "F5")


def test_a_macro_takes_the_place_of_what_was_there_when_it_was_asked_for_only(store: MacroStore) -> None:
    store.save(SHUTTLE)
    with pytest.raises(Diagnostic, match=r"shuttle\.toml: the file exists already"):
        store.save(Macro("shuttle", (MacroStep(0.0, "MR 2"),)))
    before = store.contents("shuttle")
    put(store, "shuttle", WRITTEN.encode())
    with pytest.raises(Diagnostic, match=r"shuttle\.toml: the file has changed meanwhile"):
        store.save(Macro("shuttle", (MacroStep(0.0, "MR 2"),)), before)
    assert store.contents("shuttle") == WRITTEN.encode()
    assert store.free_name("shuttle") == "shuttle-2"


def test_every_key_with_two_macros_is_named(store: MacroStore) -> None:
    for name, key in (("a", "F5"), ("b", "f5"), ("c", "F12"), ("d", "F12"), ("e", "F12"), ("f", "F2"), ("g", "")):
        put(store, name, f'name = "{name}"\nkey = "{key}"\n[[step]]\nline = "MR 1"\n'.encode())
    put(store, "h", b"key =")
    assert store.clashes() == [
        "a and b are both on F5, which plays none of them",
        "c and d and e are all on F12, which plays none of them",
    ]


def test_a_file_of_version_0_1_0_with_on_stop_means_the_same() -> None:
    before = 'name = "a"\non_stop = ["SL 0"]\non_stop_moves = true\n[[step]]\nafter = 0\nline = "PR P"\n'
    found = parse_macro(before, "x.toml")
    assert (found.on_early_end, found.on_early_end_moves) == (("SL 0",), True)
    assert parse_macro(format_macro(found)) == found and "on_early_end_moves = true" in format_macro(found)
