"""Help on a screen: rows that fit, broken between words, under the column that they belong to."""

from __future__ import annotations

import os
import struct
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.dialects.families import languages
from multidrop.shell.events import Output, Printed
from multidrop.shell.operations.table import VERBS
from multidrop.shell.streams.event_printer import EventPrinter, laid_out
from tests.support.posix import pty

NOTE = "  note       beyond one comparison it is read from left to right: R1=1&MV as (R1=1)&MV, KF&12=12 as (KF&12)=12"


def test_what_goes_over_stands_under_its_column() -> None:
    assert laid_out(NOTE, 80) == [
        "  note       beyond one comparison it is read from left to right: R1=1&MV as",
        "             (R1=1)&MV, KF&12=12 as (KF&12)=12",
    ]
    assert laid_out(NOTE, 120) == [NOTE]
    assert laid_out("    " + "word " * 8, 24) == ["    word word word word", "    word word word word"]
    assert laid_out(" " * 28 + "a meaning that is long", 40) == [
        " " * 20 + "a meaning that is",
        " " * 20 + "long",
    ]


EVERY = [line for language in languages() for word in language.names() for line in language.describe(word)]
EVERY += [line for verb in VERBS.values() for line in verb.described()]


@pytest.mark.parametrize("width", [62, 80, 120])
def test_every_line_of_help_fits_and_keeps_its_words_and_indent(width: int) -> None:
    for line in EVERY:
        rows = laid_out(line, width)
        assert max(map(len, rows)) <= width
        assert [word for row in rows for word in row.split()] == line.split(), line
        indent = len(line) - len(line.lstrip())
        assert all(len(row) - len(row.lstrip()) >= indent for row in rows)


@given(st.text(st.sampled_from("ab -|"), max_size=80), st.integers(1, 50))
def test_any_line_fits_and_loses_nothing(line: str, width: int) -> None:
    rows = laid_out(line, width)
    assert all(len(row) <= width for row in rows)
    assert "".join("".join(rows).split()) == "".join(line.split())


def test_a_terminal_gets_rows_of_its_width_and_a_pipe_the_line_as_it_is(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    termios, fcntl = pytest.importorskip("termios"), pytest.importorskip("fcntl")
    reader, writer = pty.openpty()
    fcntl.ioctl(writer, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    with open(writer, "w", encoding="utf-8") as terminal, monkeypatch.context() as patch:
        patch.setattr(sys, "stdout", terminal)
        patch.setattr(sys, "__stdout__", terminal)
        patch.delenv("COLUMNS", raising=False)
        EventPrinter().show(Output(0.0, NOTE, columns=True))
        EventPrinter().show(Printed(0.0, "press", "a", "x" * 100))
        heard = ""
        while not heard.endswith("x\r\n"):
            heard += os.read(reader, 4096).decode()
    assert heard.split("\r\n") == [*laid_out(NOTE, 80), "x" * 100, ""]
    os.close(reader)
    EventPrinter().show(Output(0.0, NOTE, columns=True))
    assert capsys.readouterr().out == f"{NOTE}\n"
