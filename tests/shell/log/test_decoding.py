"""The positions that lines of a log have printed."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from multidrop.dialects.families import FAMILIES
from multidrop.shell.log.decoding import printed
from tests.support.cases import for_each

LARGEST = 2**31 - 1


@for_each(
    "family, text, prints, axis, position",
    [
        ("mcode", "PR P", ("5",), "", 5),
        ("mcode", "  pr   p ", (" -7 ",), "", -7),
        ("mcode", "PR P", (f"{LARGEST}",), "", LARGEST),
        ("mcode", "PR P", (f"{-LARGEST - 1}",), "", -LARGEST - 1),
        ("pmx", "PX", ("12",), "x", 12),
        ("pmx", "py", ("-12",), "y", -12),
    ],
)
def test_a_line_that_asks_for_a_position_has_measured_it(
    family: str, text: str, prints: tuple[str, ...], axis: str, position: int
) -> None:
    drive: Any = SimpleNamespace(family=FAMILIES[family])
    step: Any = SimpleNamespace(text=text, printed=prints, where=("press", "a"), at=1.5)
    (found,) = printed(step, drive)
    expected: Any = (step.where, step.at, axis, position, None)
    assert (found.where, found.at, found.axis, found.position, found.velocity) == expected


@for_each(
    "text, prints",
    [
        ("PR P", ()),
        ("PR P", ("5", "6")),
        ("PR P", ("",)),
        ("PR P", ("five",)),
        ("PR P", (f"{LARGEST + 1}",)),
        ("PR P", (f"{-LARGEST - 2}",)),
        ("PR V", ("5",)),
        ("PR P,V", ("5",)),
        ("P", ("5",)),
    ],
)
def test_another_line_or_another_print_is_no_position(text: str, prints: tuple[str, ...]) -> None:
    drive: Any = SimpleNamespace(family=FAMILIES["mcode"])
    step: Any = SimpleNamespace(text=text, printed=prints, where=("press", "a"), at=1.5)
    assert list(printed(step, drive)) == []
