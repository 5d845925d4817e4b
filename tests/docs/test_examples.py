"""Each machine of `examples` has a cell, a script, a macro, a Python program, and a page that runs all of them.

`plugin` is none: `tests/packaging/test_plugin.py` installs and runs it.
`test_commands` runs the commands of the pages, which are short.
"""

import pytest

from tests.support.pages import EXAMPLES, blocks
from tests.support.paths import ROOT

MACHINES = sorted(path.name for path in EXAMPLES.iterdir() if path.name != "plugin")
LINES = 10
"""The largest number of lines of prose on a page."""


def test_there_are_five_machines() -> None:
    assert len(MACHINES) == 5


@pytest.mark.parametrize("machine", MACHINES)
def test_a_machine_is_whole_and_its_page_runs_all_of_it(machine: str) -> None:
    folder = EXAMPLES / machine
    found = sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())
    [script] = [name for name in found if name.endswith(".txt")]
    [program] = [name for name in found if name.endswith(".py")]
    [macro] = [name for name in found if name.startswith("macros/")]
    assert found == sorted(["README.md", "cell.toml", script, program, macro])
    page = str((folder / "README.md").relative_to(ROOT))
    [block] = blocks(page, "console")
    text = (folder / "README.md").read_text(encoding="utf-8")
    for name in ("cell.toml", script, program):
        assert f"`{name}`" in text and name in block.text, name
    assert f"`{macro}`" in text and f"macro play {macro[7:-5]} " in block.text
    assert len(text.partition("```")[0].strip().splitlines()) <= LINES
