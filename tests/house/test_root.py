"""The root of the repository holds what CONTRIBUTING names."""

from tests.support.paths import ROOT

HIDDEN = {".git", ".gitignore", ".ci"}


def test_everything_in_the_root_is_named_in_contributing():
    named = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8") + (ROOT / ".gitignore").read_text(encoding="utf-8")
    root = sorted(each.name for each in ROOT.iterdir() if each.name not in HIDDEN)
    assert [name for name in root if name not in named] == []
