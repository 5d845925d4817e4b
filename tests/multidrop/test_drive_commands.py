"""`program list|diff|upload|download`, `params` and `snapshot`, beside a drive that prints without end."""

from __future__ import annotations

import asyncio
import json
import tomllib
from pathlib import Path
from typing import Any

import pytest

from multidrop.shell.batch.virtual_loop import VirtualLoop
from tests.support.cases import for_each
from tests.support.cell_session import bus, drive, party, pmx
from tests.support.front_door import Command, Done

HELD = "VA Q1=7\nPG 1\nLB GO\n  MR Q1  ' far\n  H\n  BR GO,Q1<9\nE\nPG\nS\n"
LISTED = ["1  LB GO", "6  MR Q1", "11  H", "13  BR GO,Q1<9", "25  E"]
NOISE = 'PG 1\nLB SU\n PR "noise"\n H 1\n BR SU\nE\nPG\n'
CELL = bus("line", party("a", 'program = "a.mxt"', CK=0), party("b", CK=0, VM=600000), baud=0)
CELL += bus("pmx", pmx("07", 'program = "p.prg"'), baud=0)
NOISY = bus("noisy", drive("LMDCM", "", 'program = "noise.mxt"'), baud=0)
FILES = {
    "a.mxt": HELD,
    "other.mxt": HELD.replace("MR Q1", "MR 8"),
    "short.mxt": HELD.replace("  BR GO,Q1<9\n", ""),
    "new.mxt": "PG 1\nLB GO\nPR 5\nE\nPG\n",
    "p.prg": "PRG 0\nX1000\nWAITX\nEND\n",
    "noise.mxt": NOISE,
    "cell.toml": CELL,
    "noisy.toml": CELL + NOISY,
    "vm.toml": bus("line", party("b", CK=0, VM=500000), baud=0),
    "two.toml": bus("line", party("b", CK=0, VM=500000), party("a", CK=0), baud=0),
    "kept.toml": "[parameters]\nRC = 33\nCK = 2\nD1 = 5\n",
}
URL = "sim:cell.toml"


@pytest.fixture
def run(multidrop: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Command:
    """Run commands beside these files; time does not wait."""
    runner = asyncio.Runner
    monkeypatch.setattr(asyncio, "Runner", lambda **more: runner(**more | {"loop_factory": VirtualLoop}))
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    return multidrop


def objects(done: Done) -> list[dict[str, Any]]:
    return [json.loads(line) for line in done.stdout.splitlines()]


# What others print


@for_each("words", [
    ("program", "list", "URL", "--drive", "line:a", "--json"),
    ("program", "diff", "other.mxt", "URL", "--drive", "line:a"),
    ("program", "upload", "URL", "-", "--drive", "line:a"),
    ("params", "backup", "URL", "-", "--drive", "line:b"),
    ("params", "diff", "URL", "--drive", "line:a", "--other", "line:b"),
    ("params", "restore", "URL", "kept.toml", "--drive", "line:b", "--dry-run"),
])  # fmt: skip
def test_what_another_drive_prints_meanwhile_is_not_in_what_a_program_reads(
    run: Command, words: tuple[str, ...]
) -> None:
    quiet = run(*("sim:cell.toml" if word == "URL" else word for word in words))
    noisy = run(*("sim:noisy.toml" if word == "URL" else word for word in words))
    assert quiet.stdout and noisy == quiet


def test_what_another_drive_prints_is_shown_beside_what_a_person_reads(run: Command, tmp_path: Path) -> None:
    for words in (("list", "sim:noisy.toml"), ("upload", "sim:noisy.toml", "kept.mxt")):
        done = run("program", *words, "--drive", "line:a")
        assert done.returncode == 0 and "noise" in done.stdout.splitlines()
    assert "noise" not in (tmp_path / "kept.mxt").read_text()
    printed = run("snapshot", "sim:noisy.toml", "-o", "-")
    assert "\nnoise\n" not in printed.stdout and tomllib.loads(printed.stdout)["bus"][0]["name"] == "line"
    assert "noise" in run("snapshot", "sim:noisy.toml", "-o", "machine.toml").stdout.splitlines()


# Programs


def test_a_listing_names_the_drive_of_each_line_where_there_are_several(run: Command) -> None:
    assert run("program", "list", URL, "--drive", "line:a").stdout.splitlines() == LISTED
    pmx_lines = ["PRG 0", "    X1000", "    WAITX", "END"]
    both = run("program", "list", URL, "--drive", "line:a", "--drive", "pmx:07").stdout.splitlines()
    assert both == [*(f"line:a: {line}" for line in LISTED), *(f"pmx:07: {line}" for line in pmx_lines)]


def test_a_listing_as_json_has_what_the_drive_holds(run: Command) -> None:
    done = run("program", "list", URL, "--drive", "all", "--json")
    mcode = [line.split(maxsplit=1) for line in LISTED]
    held = [{"drive": "line:a", "at": int(at), "text": text} for at, text in mcode]
    compiled = enumerate(("PS0", "CV1000", "&X$1", "WX0", "XX"))
    held += [{"drive": "pmx:07", "at": at, "text": text} for at, text in compiled]
    assert (done.returncode, objects(done), done.stderr) == (0, held, "line:b: no program\n")
    for more in ((), ("--json",)):
        assert run("program", "list", URL, "--drive", "line:b", *more) == Done(0, "", "line:b: no program\n")


def test_a_comparison_says_what_differs_and_its_exit_code_whether(run: Command) -> None:
    def diff(file: str, *more: str) -> Done:
        return run("program", "diff", file, URL, "--drive", "line:a", *more)

    assert diff("a.mxt") == Done(0, "", "line:a holds a.mxt\n")
    assert diff("a.mxt", "--json") == Done(0, "", "line:a holds a.mxt\n")
    assert diff("other.mxt") == Done(1, "other.mxt:4: here 'MR 8', in line:a 'MR Q1' at 6\n", "")
    fact = {"drive": "line:a", "line": 4, "here": "MR 8", "at": 6, "there": "MR Q1"}
    assert (objects(diff("other.mxt", "--json")), diff("other.mxt", "--json").stderr) == ([fact], "")
    fact = {"drive": "line:a", "line": None, "here": "", "at": 13, "there": "BR GO,Q1<9"}
    assert objects(diff("short.mxt", "--json")) == [fact], "a line of the drive that the file has not"


def test_one_drive_that_differs_makes_the_exit_code_of_several(run: Command, tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text(
        bus("line", party("a", 'program = "other.mxt"', CK=0), party("b", 'program = "a.mxt"', CK=0), baud=0)
    )
    done = run("program", "diff", "a.mxt", URL, "--drive", "a", "--drive", "b")
    assert done == Done(1, "a.mxt:4: here 'MR Q1', in a 'MR 8' at 6\n", "b holds a.mxt\n")


def test_a_file_that_is_right_in_no_language_is_told_in_that_of_its_name(run: Command, tmp_path: Path) -> None:
    (tmp_path / "x.prg").write_text("FROB\n")
    (tmp_path / "x.mxt").write_text("PG 1\nLB GO\nE\n")
    (tmp_path / "named.txt").write_text(FILES["p.prg"])
    for words in (("download", "tcp://127.0.0.1:1", "{}"), ("diff", "{}", "tcp://127.0.0.1:1")):
        for file, said in (("x.prg", "x.prg:1:1: unknown command FROB"), ("x.mxt", "x.mxt:1:1: PG is never ended")):
            done = run("program", *(word.format(file) for word in words))
            assert (done.returncode, done.stdout) == (2, "") and done.stderr.startswith(said), "before it is opened"
    assert run("program", "diff", "named.txt", URL, "--drive", "pmx:07").stderr == "pmx:07 holds named.txt\n"


def test_programs_of_several_drives_go_to_a_folder_with_a_file_for_each(run: Command, tmp_path: Path) -> None:
    done = run("program", "upload", URL, "kept", "--drive", "line:a", "--drive", "pmx:07")
    said = ["line:a: 9 lines in kept/line-a.mxt", "pmx:07: 4 lines in kept/pmx-07.prg"]
    assert (done.returncode, done.stdout, done.stderr.splitlines()) == (0, "", said)
    assert (tmp_path / "kept" / "line-a.mxt").read_text().split() == HELD.replace("' far", "").split()
    raw = run("program", "upload", URL, "-", "--drive", "pmx:07", "--raw").stdout.splitlines()
    assert raw[0] == "SA0=PS0" and run("program", "upload", URL, "-", "--drive", "pmx:07").stdout.startswith("PRG 0\n")
    done = run("program", "upload", URL, "none.mxt", "--drive", "line:b")
    assert (done.returncode, done.stderr) == (1, "line:b holds no program\n") and not (tmp_path / "none.mxt").exists()


@for_each("options, said", [
    ((), ["downloaded, 5 lines", "not saved", "verified, 3 lines"]),
    (("--no-verify",), ["downloaded, 5 lines", "not saved"]),
    (("--save",), ["downloaded, 5 lines", "saved (S)", "verified, 3 lines"]),
    (("--save", "--no-verify"), ["downloaded, 5 lines", "saved (S)"]),
    (("--run", "GO", "--yes"), ["downloaded, 5 lines", "not saved", "verified, 3 lines", "started (EX GO)"]),
])  # fmt: skip
def test_a_download_does_what_its_options_say(run: Command, options: tuple[str, ...], said: list[str]) -> None:
    done = run("program", "download", URL, "new.mxt", "--drive", "line:b", *options)
    first, *lines = done.stderr.splitlines()
    assert done.returncode == 0 and first.startswith("backup: ")
    told = [line.removeprefix("line:b: ").removeprefix("new.mxt ") for line in lines]
    assert [line.partition(":")[0] for line in told] == said


def test_a_download_of_what_is_held_sends_nothing_where_that_is_asked(run: Command) -> None:
    words = ("program", "download", URL, "a.mxt", "--drive", "line:a", "--yes")
    assert run(*words, "--only-changed") == Done(0, "", "line:a: holds a.mxt already; nothing was sent\n")
    assert "a.mxt downloaded, 9 lines" in run(*words).stderr
    done = run("program", "download", URL, "new.mxt", "--drive", "line:a", "--drive", "line:b", "--run", "GO", "--yes")
    last = [line for line in done.stderr.splitlines() if "started" in line or "verified" in line]
    assert last == [f"line:{name}: {what}" for what in ("verified, 3 lines", "started (EX GO)") for name in "ab"]


# Settings


@for_each("words, said", [
    (("--other", "line:b"), ["VM: here 768000, there 600000 steps/s", "Q1: here 7, there none"]),
    (("--against", "sim:vm.toml"), ["VM: here 768000, there 500000 steps/s", "Q1: here 7, there none"]),
    (("--against", "sim:vm.toml", "--other", "b"), ["VM: here 768000, there 500000 steps/s", "Q1: here 7, there none"]),
    (("--against", "sim:two.toml", "--other", "a"), ["Q1: here 7, there none"]),
    (("--against", "sim:two.toml"), ["VM: here 768000, there 500000 steps/s", "Q1: here 7, there none"]),
    (("--against", URL, "--other", "line:b"), ["VM: here 768000, there 600000 steps/s", "Q1: here 7, there none"]),
    (("--defaults",), ['DN: here "a", there "!"', "EM: here 1, there 0", "PY: here 1, there 0"]),
    (("kept.toml",), ["CK: here 0, there 2", "D1: here 0, there 5 ms", "RC: here 25, there 33 %"]),
])  # fmt: skip
def test_settings_are_compared_with_one_thing(run: Command, words: tuple[str, ...], said: list[str]) -> None:
    done = run("params", "diff", URL, *words, "--drive", "line:a")
    assert (done.returncode, sorted(done.stdout.splitlines()), done.stderr) == (1, sorted(said), "")


@for_each("words", [
    (),
    ("kept.toml", "--defaults"),
    ("kept.toml", "--other", "line:b"),
    ("kept.toml", "--against", "sim:vm.toml"),
    ("--defaults", "--other", "line:b"),
    ("kept.toml", "--defaults", "--against", "sim:vm.toml"),
])  # fmt: skip
def test_settings_are_not_compared_with_nothing_or_with_two_things(run: Command, words: tuple[str, ...]) -> None:
    done = run("params", "diff", URL, *words)
    hint = "FILE, --against URL or --other ADDR, or --defaults"
    assert done == Done(2, "", f"params diff compares with one thing; {hint}\n")


def test_a_comparison_as_json_has_the_values_as_they_are(run: Command) -> None:
    done = run("params", "diff", URL, "kept.toml", "--drive", "line:a", "--json")
    rows = {each["name"]: (each["here"], each["there"]) for each in objects(done)}
    assert (done.returncode, rows) == (1, {"RC": (25, 33), "CK": (0, 2), "D1": (0, 5)})


def test_what_is_compared_with_may_be_absent(run: Command) -> None:
    for words, code, said in (
        (("--other", "zz:b"), 2, "no bus zz; open: line, pmx\n"),
        (("--against", "tcp://127.0.0.1:1"), 3, "tcp://127.0.0.1:1: nothing listens there"),
        (("gone.toml",), 2, "gone.toml: cannot be read"),
    ):
        done = run("params", "diff", URL, *words, "--drive", "line:a")
        assert (done.returncode, done.stdout) == (code, "") and done.stderr.startswith(said)


@for_each("options, steps, said", [
    ((), ["RC=33", "D1=5"], ["CK is left alone: it is a communication setting (--communication restores it)"]),
    (("--communication",), ["RC=33", "D1=5", "CK=2"], []),
    (("--with", " d1 ,,rc"), ["RC=33", "D1=5"],
     ["CK is left alone: it is a communication setting (--communication restores it)"]),
])  # fmt: skip
def test_a_restore_shows_its_steps_and_sends_nothing_in_a_dry_run(
    run: Command, options: tuple[str, ...], steps: list[str], said: list[str]
) -> None:
    done = run("params", "restore", URL, "kept.toml", "--drive", "line:b", "--dry-run", *options)
    assert done.returncode == 0
    assert sorted(line.split()[1] for line in done.stdout.splitlines()) == sorted(steps)
    last = f"{len(steps)} steps; nothing was sent (--dry-run)"
    assert done.stderr.splitlines() == [f"line:b: {each}" for each in (*said, last)]


def test_a_restore_says_whether_it_is_saved_and_asks_first(run: Command) -> None:
    words = ("params", "restore", URL, "kept.toml", "--drive", "line:b")
    assert run(*words).returncode == 2
    lost = "restored and read back; not saved, so lost at power-off"
    assert lost in run(*words, "--yes").stderr and lost not in run(*words, "--yes", "--save").stderr
    named = run(*words, "--with", "dn", "--dry-run")
    assert named == Done(2, "", "kept.toml: has no setting DN; --with takes names of the file\n")


def test_settings_of_another_product_are_restored_where_that_is_said(run: Command, tmp_path: Path) -> None:
    (tmp_path / "other.toml").write_text('[drive]\nlanguage = "MCode"\nproduct = "LMDCE"\n[parameters]\nRC = 33\n')
    words = ("params", "restore", URL, "other.toml", "--drive", "line:b", "--dry-run")
    refused = run(*words)
    assert (refused.returncode, refused.stdout) == (2, "") and "LMDCE" in refused.stderr
    assert run(*words, "--other-product").stdout == "line:b: RC=33 (was 25)\n"


# Snapshots


def test_a_snapshot_of_one_drive_needs_no_name_and_of_several_it_does(run: Command) -> None:
    names = "line:a, line:b, pmx:07"
    done = run("snapshot", "apply", "vm.toml", URL)
    assert done == Done(2, "", f"several drives have replied; --drive names one of {names}\n")
    done = run("snapshot", "apply", "vm.toml", "sim:vm.toml", "--dry-run")
    assert (done.returncode, done.stdout) == (0, "b: saved at the end (S); its position is not changed\n")
    assert "check it: OE, IS5" in done.stderr and done.stderr.count("\n") == 1


def test_a_snapshot_is_applied_from_another_name_only_to_one_drive(run: Command, tmp_path: Path) -> None:
    (tmp_path / "one.toml").write_text(bus("line", party("c", CK=0), baud=0))
    words = ("snapshot", "apply", "vm.toml", "sim:one.toml", "--from", "b")
    shown = run(*words, "--dry-run")
    assert shown.returncode == 0 and "VM=500000" in shown.stdout and "DN" in shown.stdout
    assert run(*words).returncode == 2, "it asks, and nobody answers"
    several = run(*words, "--drive", "all", "--dry-run")
    assert several == Done(2, "", "snapshot apply: --from b is for one drive; --drive names one\n")
    missing = run("snapshot", "apply", "two.toml", "sim:one.toml", "--dry-run")
    assert (missing.returncode, missing.stdout) == (2, "") and 'no drive "c"' in missing.stderr
