"""Files that people name are read by one rule or refused in one line; text from elsewhere acts on no terminal."""

import asyncio
import os
import tempfile
import unicodedata
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.base.files import (
    DEEPEST_TABLES,
    LARGEST_FILE,
    MOST_LINES,
    bytes_of,
    encoded_program_of,
    escaped_toml,
    lines_of,
    program_text_of,
    split_lines,
    text_of,
    toml_of,
)
from multidrop.base.text import visible
from multidrop.families.lexium.manual import program_file
from multidrop.families.pmx.manual import program_file as pmx_file
from multidrop.macros import MacroStore
from multidrop.macros.toml_format import parse_macro
from multidrop.macros.vendor import imported
from multidrop.shell import configuration
from multidrop.shell.log import files as log_files
from multidrop.shell.params import file as params_file
from multidrop.shell.programs.edited_file import EditedFile
from multidrop.shell.scripts.reading import read_script
from multidrop.simulator import cells
from multidrop.simulator.serving.command import read_lines
from tests.support.cases import for_each

ENDLESS = Path("/dev/zero")
HIDDEN = ("\x0b", "\x0c", "\x1c", "\x1d", "\x1e", "\x1f", "\x85", "\u2028", "\u2029", "\x07", "\x7f", "\x9b", "\x1a")
"""Characters at which some programs end a line, and others that no editor shows."""


def store_of(file: str) -> MacroStore:
    """A store whose macro `m` is that file."""
    folder = Path(tempfile.mkdtemp())
    (folder / "m.toml").symlink_to(file)
    return MacroStore(folder)


READERS = {
    "bytes": bytes_of, "text": text_of, "program": encoded_program_of, "script": lambda file: read_script(file, {}),
    "cell": cells.load, "settings": params_file.load,
    "MCode": lambda file: program_file.read(program_text_of(file), str(file)),
    "PMX": lambda file: pmx_file.read(program_text_of(file), str(file)),
    "log": lambda file: list(log_files.lines(Path(file))), "macro": lambda file: store_of(file).load("m"),
    "editor": lambda file: EditedFile(Path(file)),
}  # fmt: skip


def test_a_file_is_read_as_utf_8_with_or_without_a_mark_and_else_as_windows_text(tmp_path):
    file = tmp_path / "a.mxt"
    for data in ("\ufeffµ".encode(), "µ".encode(), "µ".encode("latin-1")):
        file.write_bytes(data)
        assert text_of(file) == "µ"
    file.write_bytes(b"MR 1 '\x93quoted\x94 \xb5m\n")
    text, encoding = encoded_program_of(file)
    assert text == "MR 1 '“quoted” µm\n" and text.encode(encoding) == file.read_bytes()


# Lines


def test_lines_end_at_lf_or_cr_lf_and_at_cr_only_where_there_is_no_lf() -> None:
    assert split_lines("a\nb\r\nc") == split_lines("a\rb\rc") == ["a", "b", "c"]
    assert split_lines("a\rb\nc") == ["a\rb", "c"]
    assert split_lines("\ufeffa\r\n\x1a") == ["a", ""]


@for_each("hidden", HIDDEN)
def test_a_character_that_hides_a_line_is_refused_with_its_place(hidden: str) -> None:
    with pytest.raises(Diagnostic, match=rf"^x:2: .*U\+{ord(hidden):04X}"):
        lines_of(f"PR P\n# remark{hidden}MR 777\nPR V\n", "x")


def test_a_cr_inside_a_line_is_refused() -> None:
    with pytest.raises(Diagnostic, match="^x:1: carriage return without a line feed"):
        lines_of("# remark\rMR 777\nPR P\n", "x")


def test_tabs_letters_of_any_script_a_mark_at_the_head_and_one_ctrl_z_are_fine() -> None:
    text = "\ufeffPR P\t# Größe, 速度, скорость, “x”\r\nPR V\r\n\x1a"
    assert lines_of(text) == ["PR P\t# Größe, 速度, скорость, “x”", "PR V", ""]


@for_each("hidden", HIDDEN[:9])
def test_every_reader_refuses_a_hidden_line(hidden: str) -> None:
    for read in (
        lambda text: program_file.read(f"PG 1\nMR 1 '{text}\nE\nPG\n", "x"),
        lambda text: pmx_file.read(f"X100\n;{text}\nEND\n", "x"),
        lambda text: parse_macro(f'name = "m"\n# {text}\n[[step]]\nline = "PR P"\n', "x"),
        lambda text: imported(f"F2 MR 1^M\n; {text}\n", "x"),
        lambda text: configuration.parse(f"[log]\n# {text}\n", "x"),
        lambda text: cells.read(f'seed = 1\n# {text}\n[[bus]]\nname = "a"\n', "x", Path()),
    ):
        with pytest.raises(Diagnostic, match=rf"^x:2\b.*U\+{ord(hidden):04X}"):
            read(f"remark{hidden}MR 777")


def test_what_a_program_writes_into_toml_is_readable() -> None:
    made = escaped_toml('a = "x\x85\u2028\x9b"\n')
    assert toml_of(made, "x") == {"a": "x\x85\u2028\x9b"}


# Limits


@for_each("name", READERS)
@pytest.mark.skipif(not ENDLESS.exists(), reason="no /dev/zero here")
def test_a_device_and_a_pipe_with_a_name_are_refused_unopened(name: str, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / f"pipe-{name}")
    for path in (str(ENDLESS), str(tmp_path / f"pipe-{name}")):
        with pytest.raises(Diagnostic, match="is not a regular file"):
            READERS[name](path)


def test_the_largest_file_is_read_and_one_byte_more_is_not(tmp_path):
    file = tmp_path / "a"
    file.touch()
    os.truncate(file, LARGEST_FILE)
    assert len(bytes_of(file)) == LARGEST_FILE
    os.truncate(file, LARGEST_FILE + 1)
    with pytest.raises(Diagnostic, match="is larger than 1 MB"):
        bytes_of(file)


def test_a_program_has_as_many_lines_as_no_drive_holds_and_one_more_is_refused(tmp_path):
    file = tmp_path / "a.mxt"
    for end in ("\n", "\r", "\r\n"):
        file.write_bytes(f"MR 1{end}".encode() * MOST_LINES)
        assert len(split_lines(encoded_program_of(file)[0])) == MOST_LINES + 1
        file.write_bytes(f"MR 1{end}".encode() * (MOST_LINES + 1))
        with pytest.raises(Diagnostic, match="has more than 20000 lines"):
            encoded_program_of(file)


@for_each("text", [
    ".".join("a" * 60) + " = 1\n", "[" + ".".join("a" * 60) + "]\n", f"a = {'[' * 60}{']' * 60}\n",
    "a = " + "{b = " * 60 + "1" + "}" * 60 + "\n", "a." * 30 + "a = " + "[" * 51 + "]" * 51 + "\n",
])  # fmt: skip
def test_toml_that_is_nested_too_deeply_is_refused_before_it_is_parsed(text: str) -> None:
    with pytest.raises(Diagnostic, match="^x:2: .*nested deeper than 50 levels"):
        toml_of("b = 1\n" + text, "x")


def test_texts_and_remarks_nest_nothing() -> None:
    marks = "[{.," * 100
    text = f'# {marks}\na = "{marks}"\nb = \'{marks}\'\nc = """{marks}\n{marks}"""\n' + "d = [1.5, 2.5]\n" * 0
    assert toml_of(text, "x").keys() == {"a", "b", "c"}
    assert toml_of(".".join(["a"] * DEEPEST_TABLES) + " = 1", "x")


def test_a_name_that_is_empty_is_shown_as_one():
    with pytest.raises(Diagnostic, match='^"": cannot be read: '):
        bytes_of("")


@pytest.mark.skipif(not ENDLESS.exists(), reason="no /dev/zero here")
@pytest.mark.fork
async def test_a_simulation_refuses_an_endless_standard_input_and_reads_a_file(tmp_path: Path) -> None:
    loop, taken = asyncio.get_running_loop(), []
    with ENDLESS.open() as stdin, pytest.raises(Diagnostic, match="standard input: is larger than 1 MB"):
        read_lines(loop, stdin, taken.append)
    (tmp_path / "lines").write_text("/sim push b 1\n/sim unplug press")
    with (tmp_path / "lines").open() as stdin:
        read_lines(loop, stdin, taken.append)
    await asyncio.sleep(0)
    assert taken == ["/sim push b 1", "/sim unplug press"]


# Text from elsewhere


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("51200", "51200"),
        ("\x1b]52;c;cm0gLXJm\x07", r"\x1b]52;c;cm0gLXJm\x07"),
        ("\x1b]0;title\x1b\\", r"\x1b]0;title\x1b" + "\\"),
        ("\x9b2J", r"\x9b2J"),
        ("\x1b[?1049h", r"\x1b[?1049h"),
        ("© München 5 µm", "© München 5 µm"),
        ("a\u202egnp.exe", r"a\u202egnp.exe"),
        ("\u2066x\u2069", r"\u2066x\u2069"),
        ("\ud800", r"\ud800"),
        ("a\tb\r\n", r"a\x09b\x0d\x0a"),
    ],
)
def test_control_and_direction_characters_are_written_out(text, shown):
    assert visible(text) == shown


def test_a_tab_may_stay():
    assert visible("a\tb\x0b", tabs=True) == "a\tb\\x0b"


@given(st.text())
def test_nothing_that_acts_is_left_and_what_is_shown_stays(text):
    shown = visible(text)
    assert all(unicodedata.category(each) not in ("Cc", "Cs", "Zl", "Zp") for each in shown)
    assert all(
        unicodedata.bidirectional(each) not in ("LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI")
        for each in shown
    )
    assert visible(shown) == shown
