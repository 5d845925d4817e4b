"""Files that people name: read whole, or refused in one line."""

import os
from pathlib import Path

import pytest

from dialects import Diagnostic
from dialects.files import LARGEST, bytes_of, text_of
from shell.scripts.reading import read_script
from simulator import cells

ENDLESS = Path("/dev/zero")


def test_a_file_is_read_as_utf_8_with_or_without_a_mark_and_else_as_latin_1(tmp_path):
    file = tmp_path / "a.mxt"
    for data in ("\ufeffµ".encode(), "µ".encode(), "µ".encode("latin-1")):
        file.write_bytes(data)
        assert text_of(file) == "µ"


@pytest.mark.parametrize("read", [bytes_of, text_of, lambda file: read_script(file, {}), cells.load])
@pytest.mark.skipif(not ENDLESS.exists(), reason="no /dev/zero here")
def test_a_file_without_an_end_is_refused_and_fills_no_memory(read):
    with pytest.raises(Diagnostic, match="^/dev/zero: is larger than 16 MB"):
        read(str(ENDLESS))


def test_the_largest_file_is_read_and_one_byte_more_is_not(tmp_path):
    file = tmp_path / "a"
    file.touch()
    os.truncate(file, LARGEST)
    assert len(bytes_of(file)) == LARGEST
    os.truncate(file, LARGEST + 1)
    with pytest.raises(Diagnostic, match="is larger"):
        bytes_of(file)


def test_a_name_that_is_empty_is_shown_as_one():
    with pytest.raises(Diagnostic, match='^"": cannot be read: '):
        bytes_of("")
