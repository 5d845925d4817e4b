"""`[sweep]` in what `multidrop config` shows and checks."""

from __future__ import annotations

from pathlib import Path

from tests.support.front_door import Command, Done, tables


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
