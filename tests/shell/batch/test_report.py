"""The line at the end of a script: failed checks are counted apart from other failed lines."""

from types import SimpleNamespace
from typing import Any

import pytest

from multidrop.shell.batch.report import BatchReport


@pytest.mark.parametrize(
    ("results", "says"),
    [
        ([(True, True)], "1 line, 1 check, 0 failed, "),
        ([(True, True), (True, False), (False, True)], "3 lines, 2 checks, 1 failed, "),
        ([(True, True), (False, False)], "2 lines, 1 check, 0 failed, 1 other line failed, "),
    ],
)
def test_a_failed_line_that_is_no_check_is_not_counted_as_one(
    results: list[tuple[bool, bool]], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    report = BatchReport("s.txt")
    for check, ok in results:
        result: Any = SimpleNamespace(check=check, ok=ok)
        report.executed(result)
    report.finish(0)
    assert f": {says}" in capsys.readouterr().err
