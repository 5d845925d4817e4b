"""`program sweep` on a file of another language than that of its name."""

from __future__ import annotations

from pathlib import Path

from tests.support.cell_session import bus, drive
from tests.support.front_door import Command


def test_a_file_of_another_language_is_named(multidrop: Command, tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text(bus("slide", drive("TMCM", "1")))
    (tmp_path / "turn.mxt").write_text("Far = 20000\nLoop: MVP ABS, 0, Far   // far end\n WAIT POS, 0, 0\n JA Loop\n")
    words = ("--cell", "cell.toml", "--vary", "load=0,1", "--expect", "position==0", "--jobs", "1")
    done = multidrop("program", "sweep", "turn.mxt", *words)
    assert done.returncode != 0 and done.stderr == (
        "turn.mxt:1:1: this is TMCL, not MCode; name it .tmc or .tmcl, or give --language tmcl\n"
    )
