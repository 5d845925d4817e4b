"""Where `plant` shows what it watches, and what it says of a wrong configuration."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.cases import for_each
from tests.support.front_door import Called, Command, at_terminal


@for_each("words, closed, screen", [
    ([], None, True), (["--json"], None, False), ([], "stdin", False), ([], "stdout", False), ([], "stderr", False),
])  # fmt: skip
def test_a_plant_is_a_screen_at_a_terminal_and_lines_elsewhere(
    tmp_path: Path, words: list[str], closed: str | None, screen: bool
) -> None:
    with pytest.MonkeyPatch.context() as patched:
        shown, watched = Called(3), Called(4)
        patched.setattr("multidrop.features.publishing.screen.run", shown)
        patched.setattr("multidrop.features.publishing.watch.run", watched)
        done = at_terminal(tmp_path, "plant", "mqtt://h/plant", *words, closed=[closed] if closed else [])
    assert done.returncode == (3 if screen else 4)
    assert shown.calls == ([("mqtt://h/plant",)] if screen else [])
    assert watched.calls == ([] if screen else [("mqtt://h/plant", {"as_json": bool(words)})])


def test_each_error_of_the_configuration_is_named_and_the_way_on(multidrop: Command, tmp_path: Path) -> None:
    (tmp_path / "conf").mkdir()
    file = tmp_path / "conf" / "multidrop.toml"
    file.write_text("[log]\nfiles = 0\n[screen]\nsigns = 5\n")
    done = multidrop("plant", "mqtt://127.0.0.1/plant", "--json")
    assert done.returncode == 2
    assert f"{file}:2: log.files" in done.stderr and f"{file}:4: screen.signs" in done.stderr
    assert "--no-config" in done.stderr
