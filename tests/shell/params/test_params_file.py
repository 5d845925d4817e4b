"""The file of a drive's settings: what is written is read again, and no text breaks the reader."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.dialects.values import SECTIONS, Reading, Readings
from multidrop.shell.params import file as files

TEXTS = st.text(st.characters(codec="utf-8", exclude_categories=("Cc", "Cs")), max_size=8)
SCALARS = st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False) | TEXTS
VALUES = SCALARS | st.lists(SCALARS, min_size=1, max_size=4).map(tuple)
NAMES = st.from_regex(r"[A-Z0-9][A-Z0-9_]{0,5}", fullmatch=True)
READINGS = st.dictionaries(NAMES, st.tuples(VALUES, st.sampled_from(SECTIONS), TEXTS, st.none() | VALUES), max_size=6)


@given(READINGS, st.dictionaries(TEXTS, TEXTS, max_size=3))
def test_what_is_written_is_read_again(tmp_path_factory, rows, unread):
    found = Readings(tuple(Reading(name, *row) for name, row in rows.items()), tuple(unread.items()))
    text = files.formatted({"product": "LMDCM", "language": "MCode"}, found)
    path = tmp_path_factory.getbasetemp() / "kept.toml"
    path.write_text(text, encoding="utf-8", newline="")
    loaded = files.load(path)
    assert loaded.named == found.values and (loaded.product, loaded.language) == ("LMDCM", "MCode")
    assert loaded.section == {name: row[1] for name, row in rows.items()} and loaded.has_variables


@given(st.text(max_size=60) | st.sampled_from(SECTIONS).map(lambda name: f"[{name}]\nVM = ").flatmap(
    lambda head: st.text(max_size=20).map(lambda tail: head + tail)
))  # fmt: skip
def test_any_text_is_settings_or_one_clear_line(tmp_path_factory, text):
    path = tmp_path_factory.getbasetemp() / "any.toml"
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    try:
        files.load(path)
    except Diagnostic as problem:
        assert "any.toml" in str(problem) and "\n" not in str(problem)


@pytest.mark.parametrize(
    "data", [b"\0", b"\xff\xfe[parameters]", b"[parameters]\nVM = [[1]]\n", b"[parameters]\nVM = []\n"]
)
def test_a_file_that_is_no_settings_file(tmp_path, data):
    (tmp_path / "x.toml").write_bytes(data)
    with pytest.raises(Diagnostic):
        files.load(tmp_path / "x.toml")
