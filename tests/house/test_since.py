"""`make test SINCE=main` runs what the changes can break, and names what it leaves out."""

import subprocess
from pathlib import Path

import pytest

from tests.support import since
from tests.support.paths import ROOT

FILES = {path.relative_to(ROOT).as_posix() for path in (ROOT / "tests").rglob("test_*.py")}
WIRE = "tests/drives/test_inbox.py"
SCREEN = "tests/tui/test_app.py"
USB = "tests/features/usb/"
PMX = "tests/families/pmx/"
HOST = "tests/families/pmx/host/"
SUITE = "tests/families/pmx/test_contract.py"
DOOR = "tests/multidrop/test_failures.py"
RECORDS = "tests/features/test_records.py"
TEXTS = "tests/docs/test_links.py"


@pytest.mark.parametrize(
    ("change", "runs", "leaves"),
    [
        ("features/usb/schemes.py", (USB, RECORDS, TEXTS), (WIRE, SCREEN, HOST, DOOR)),
        ("features/usb/anything.csv", (USB, RECORDS, TEXTS), (WIRE, SCREEN, HOST, DOOR)),
        ("features/usb/not_there.py", (USB, RECORDS, TEXTS), (WIRE, SCREEN, HOST, DOOR)),
        ("families/pmx/manual/commands.csv", (PMX, TEXTS), (WIRE, SCREEN, DOOR)),
        ("tui/app.py", (SCREEN, DOOR, SUITE, TEXTS), (WIRE, HOST)),
        ("drives/inbox.py", (WIRE, SCREEN, DOOR, TEXTS), ("tests/transports/test_pipes.py", "tests/macros/")),
        ("shell/verbs/units.py", ("tests/shell/test_units.py", SCREEN, DOOR, SUITE, TEXTS), (WIRE, HOST)),
        ("multidrop/contract/motion.py", (SUITE, TEXTS), (WIRE, SCREEN, HOST)),
        ("tests/support/pmx_controller.py", (PMX, TEXTS), (SCREEN, DOOR)),
        (WIRE, (WIRE, TEXTS), (SCREEN, USB, DOOR)),
        ("docs/safety.md", (TEXTS,), (WIRE, SCREEN, USB, DOOR)),
    ],
)
def test_a_change_runs_what_it_can_break(change: str, runs: tuple[str, ...], leaves: tuple[str, ...]) -> None:
    chosen = since.choice([change], FILES)
    for each in runs:
        assert any(name.startswith(each) for name in chosen), each
    for each in leaves:
        assert not any(name.startswith(each) for name in chosen), each


@pytest.mark.parametrize("change", since.EVERYTHING)
def test_a_change_of_what_all_rest_on_runs_all(change: str) -> None:
    assert since.choice([change], FILES) == FILES


def test_nothing_changed_runs_the_tests_of_the_whole_tree_alone() -> None:
    assert since.choice([], FILES) == {name for name in FILES if name.startswith(since.SEAMS)}


def test_what_is_left_out_is_named_by_folder_and_counted() -> None:
    files = {"tests/tui/test_a.py", "tests/tui/test_b.py", "tests/features/usb/test_c.py", "tests/docs/test_d.py"}
    lines = since.words("main", ["docs/safety.md"], files, {"tests/docs/test_d.py"})
    assert lines == [
        "1 file has changed since main: 1 of 4 files of tests run",
        "left out, as no change reaches what they import: 1 in tests/features/usb",
        "left out, as no change reaches what they import: 2 in tests/tui",
    ]


@pytest.mark.process
def test_the_changes_are_those_of_the_tree_new_files_too(tmp_path: Path) -> None:
    def git(*words: str) -> None:
        subprocess.run(["git", "-C", tmp_path, "-c", "user.name=a", "-c", "user.email=a@b", *words], check=True)

    git("init", "--quiet")
    for name in ("kept.py", "changed.py", "gone.py"):
        (tmp_path / name).write_text("1\n")
    git("add", ".")
    git("commit", "--quiet", "--message", "first")
    (tmp_path / "changed.py").write_text("2\n")
    (tmp_path / "gone.py").unlink()
    (tmp_path / "new.py").write_text("3\n")
    assert since.changed("HEAD", tmp_path) == ["changed.py", "gone.py", "new.py"]
    with pytest.raises(pytest.UsageError, match="--since nothing: "):
        since.changed("nothing", tmp_path)
