"""`[sweep]` in what `multidrop config` shows and checks; the paths that the configuration allows a sweep."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.support.front_door import Command, Done, tables
from tests.support.leaving_cell import assert_allowed_by_configuration, write_leaving


def test_without_a_file_no_cluster_is_named(multidrop: Command) -> None:
    found = tables(multidrop("config", "show"))
    order = ["[simulator]", "[sweep]", "[guards]"]
    assert [each for each in found if each in order] == order and found["[sweep]"] == ["clusters = []   # default"]


def test_what_the_file_sets_has_no_remark(multidrop: Command, tmp_path: Path) -> None:
    (tmp_path / "conf").mkdir()
    file = tmp_path / "conf" / "multidrop.toml"
    file.write_text('[sweep]\nclusters = ["tcp://h:1"]\n')
    assert tables(multidrop("config", "show"))["[sweep]"] == ['clusters = ["tcp://h:1"]']
    assert multidrop("config", "check") == Done(0, f"{file} is right\n", "")


@pytest.mark.parametrize("text", ["[sweep]\nclusters = [1]\n", "[sweep]\nx = 1\n"])
def test_what_is_wrong_in_it_is_one_line(multidrop: Command, tmp_path: Path, text: str) -> None:
    (tmp_path / "conf").mkdir()
    (tmp_path / "conf" / "multidrop.toml").write_text(text)
    done = multidrop("config", "check")
    [line] = done.stderr.splitlines()
    assert done.returncode == 2 and re.search(r"multidrop.toml:\d: .*sweep", line)


def test_paths_of_a_cell_leave_its_folder_where_the_configuration_allows_it(tmp_path: Path) -> None:
    write_leaving(tmp_path)
    words = ("feed.mxt", "--cell", "cell/own.toml", "--vary", "VM=20000", "--run", "G1")
    assert_allowed_by_configuration(tmp_path, "program", "sweep", *words)
