"""A macro may be another person's: it writes files in the current folder only."""

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.shell.events import By
from tests.support.macro_shop import macro_runner

pytestmark = pytest.mark.virtual
OUTSIDE = [
    "/log ../x.log",
    "/log out/x.log",
    "/list a /tmp/x.mxt",
    "/upload /tmp/x.mxt a",
]


@pytest.fixture
def session(tmp_path, monkeypatch):
    return macro_runner(tmp_path, monkeypatch)


@pytest.mark.parametrize("line", OUTSIDE)
async def test_a_macro_writes_no_file_outside_the_current_folder(session, tmp_path, line):
    with pytest.raises(Diagnostic, match="leaves the current folder"):
        await session(line)
    assert not list(tmp_path.glob("*.*"))


@pytest.mark.parametrize(("line", "file"), [("/log x.log", "x.log"), ("/list a out.d/x.mxt", "out.d/x.mxt")])
async def test_a_macro_writes_inside_it(session, tmp_path, line, file):
    (tmp_path / "here" / "out.d").mkdir()
    await session(line)
    assert (tmp_path / "here" / file).exists()


async def test_a_person_writes_anywhere(session, tmp_path):
    await session("/log ../x.log", By.OPERATOR)
    await session("/list a ../x.mxt", By.SCRIPT)
    assert (tmp_path / "x.log").exists() and (tmp_path / "x.mxt").exists()
