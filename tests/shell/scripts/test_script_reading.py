"""What a script holds, and the lines of standard input: comments, ends of lines, bounds."""

import asyncio
import os
import select

import pytest

from multidrop.base.comments import uncommented
from multidrop.base.errors import Diagnostic
from multidrop.base.files import LARGEST_FILE
from multidrop.shell.prompt.terminal_input import stream_lines
from multidrop.shell.scripts.reading import read_script
from tests.support.until import PATIENCE


@pytest.fixture
def script(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def write(text, name="s.txt"):
        (tmp_path / name).write_bytes(text if isinstance(text, bytes) else text.encode())
        return name

    return write


def test_a_script_is_its_lines_without_comments_and_blanks(script):
    file = script('# shuttle\n\n  @a MR 100  # there\r\n/sleep 0.5\n@a PR "x#1"\n#end')
    assert [(line.where, line.text) for line in (step.line for step in read_script(file, {}).body)] == [
        ("s.txt:3", "@a MR 100"),
        ("s.txt:4", "/sleep 0.5"),
        ("s.txt:5", '@a PR "x#1"'),
    ]


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("PR P\nMR {STEPS}\n", "s.txt:2: .*STEPS"),
        ("/slep 1\n", "s.txt:1: no verb /slep; try /sleep"),
        ("@a\n", "s.txt:1: "),
        (b"\xff\xfe\x00", "s.txt:1: not UTF-8"),
    ],
)
def test_what_is_wrong_is_found_before_anything_runs(script, text, named):
    with pytest.raises(Diagnostic, match=named):
        read_script(script(text), {})


def test_a_file_that_is_no_script_is_named(script, tmp_path):
    with pytest.raises(Diagnostic, match="gone.txt: cannot be read: No such file"):
        read_script("gone.txt", {})
    with pytest.raises(Diagnostic, match="s.py: is Python"):
        read_script(script("import multidrop", "s.py"), {})


@pytest.mark.parametrize(
    ("line", "kept"),
    [("MR 1 # c", "MR 1"), ("#", ""), ("MR#1", "MR#1"), ("\t# x", ""), ("sim:#press", "sim:#press"), (" a ", "a")],
)
def test_a_comment_begins_at_the_head_or_behind_a_space(line, kept):
    assert uncommented(line) == kept


@pytest.mark.parametrize("kind", ["pipe", "file"])
async def test_lines_come_from_pipes_and_files_and_a_last_one_needs_no_end(tmp_path, kind):
    text = "PR P\r\n\n@b é\nlast".encode()
    if kind == "pipe":
        descriptor, writer = os.pipe()
        os.write(writer, text)
        os.close(writer)
    else:
        (tmp_path / "lines").write_bytes(text)
        descriptor = os.open(tmp_path / "lines", os.O_RDONLY)
    async with asyncio.timeout(5):
        found = [line async for line in stream_lines(descriptor)]
    os.close(descriptor)
    assert [line.strip() for line in found] == ["PR P", "", "@b é", "last"]


async def test_a_cr_ends_lines_of_standard_input_only_where_no_lf_comes(tmp_path):
    opened = []

    async def lines_of_input(text):
        file = tmp_path / f"input-{len(opened)}"
        file.write_bytes(text)
        opened.append(os.open(file, os.O_RDONLY))  # closed at the end: a thread may still read it
        async with asyncio.timeout(5):
            return [line async for line in stream_lines(opened[-1])]

    assert await lines_of_input(b"\xef\xbb\xbfPR P\rMR 1\r") == ["PR P", "MR 1"]
    assert await lines_of_input(b"\xef\xbb\xbfPR P\r\nMR 1\n\x1a") == ["PR P", "MR 1"]
    for text in (b"PR P\n# a\rMR 1\n", "PR P\n# a\u2028MR 1\n".encode(), b"PR P\n# a\x0bMR 1", b"PR P\na\rMR 1"):
        with pytest.raises(Diagnostic, match="^standard input:2: "):
            await lines_of_input(text)
    for descriptor in opened:
        os.close(descriptor)


async def test_a_line_of_standard_input_has_an_end(tmp_path):
    (tmp_path / "lines").write_bytes(b"PR P\n" + b"x" * (LARGEST_FILE + 100_000))
    descriptor = os.open(tmp_path / "lines", os.O_RDONLY)
    with pytest.raises(Diagnostic, match="^standard input:2: a line is larger than 1 MB"):
        _ = [line async for line in stream_lines(descriptor)]
    os.close(descriptor)


@pytest.mark.fork
async def test_standard_input_is_read_ahead_of_the_lines_within_bounds():
    reader, writer = os.pipe()
    os.write(writer, b"first\n")
    lines, written = stream_lines(reader), 0
    assert await anext(lines) == "first"
    os.set_blocking(writer, False)
    while written < 4_000_000 and select.select([], [writer], [], 0.5)[1]:
        written += os.write(writer, b"x" * 4095 + b"\n")
    os.close(writer)
    assert written < 1_000_000
    async with asyncio.timeout(PATIENCE):
        assert sum([len(line) + 1 async for line in lines]) == written
    os.close(reader)
