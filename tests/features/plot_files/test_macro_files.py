"""A macro may be another person's: its plots are files in the current folder only."""

from __future__ import annotations

from pathlib import Path

import pytest

from multidrop.base.errors import Diagnostic
from tests.support.macro_shop import macro_runner

pytestmark = pytest.mark.virtual


@pytest.mark.parametrize("line", ["/plot ~/x.rrd", "/plot --to /tmp/x.rrd"])
async def test_a_macro_writes_no_plot_outside_the_current_folder(
    line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = macro_runner(tmp_path, monkeypatch)
    with pytest.raises(Diagnostic, match="leaves the current folder"):
        await run(line)
    assert not list(tmp_path.glob("*.*"))
