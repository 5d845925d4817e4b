"""A line that is given the address of the drive that it was meant for."""

import pytest

from multidrop.shell.line_syntax import parse, pinned


@pytest.mark.parametrize(
    "line, address, text",
    [
        ("MR 5", "a", "@press:a MR 5"),
        ("MR 5", "", "@press: MR 5"),
        (" PR  P ", "a", "@press:a PR  P"),
        ("@b MR 5", "a", "@press:b MR 5"),
        ("@* SL 0", "a", "@press:* SL 0"),
        ("@press: MR 5", "a", "@press:a MR 5"),
        ("@eth: MR 5", "a", "@eth: MR 5"),
        ("@eth:b MR 5", "a", "@eth:b MR 5"),
        ("/wait stopped", "a", "/wait stopped"),
        ("@", "a", "@"),
        ("", "a", ""),
    ],
)
def test_pinned(line: str, address: str, text: str) -> None:
    assert pinned(line, "press", address) == text
    if text.startswith("@") and len(text) > 1:
        assert parse(pinned(text, "other", "z")) == parse(text), "once pinned it stays"
