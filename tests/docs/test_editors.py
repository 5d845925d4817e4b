"""The settings of editors in docs/editors.md name the languages and the endings that the server knows."""

from __future__ import annotations

import json
import re
import tomllib
from xml.etree import ElementTree

from multidrop.dialects.families import program_languages
from tests.support.paths import ROOT

PAGE = (ROOT / "docs" / "editors.md").read_text(encoding="utf-8")
EDITORS = ROOT / "docs" / "editors"
KNOWN = {
    files.ids[0]: {ending[1:] for ending in files.endings if ending != ".txt"} for files in program_languages().values()
}


def test_helix_gives_each_language_its_endings() -> None:
    settings = tomllib.loads(re.search(r"```toml\n(.*?)```", PAGE, re.S)[1])
    assert {each["name"]: set(each["file-types"]) for each in settings["language"]} == KNOWN
    assert settings["language-server"]["multidrop"]["args"] == ["lsp"]


def test_vs_code_gives_each_language_its_endings() -> None:
    package = json.loads((EDITORS / "vscode" / "package.json").read_text())
    languages = package["contributes"]["languages"]
    assert {each["id"]: {ending[1:] for ending in each["extensions"]} for each in languages} == KNOWN
    for each in ("README.md", package["main"], *(language["configuration"] for language in languages)):
        assert (EDITORS / "vscode" / each).is_file()
    assert package["devDependencies"] == {"@vscode/vsce": "3.9.2"} and "vsce package" in package["scripts"]["package"]


def test_emacs_gives_each_language_its_endings() -> None:
    (settings,) = re.findall(r"```elisp\n(.*?)```", PAGE, re.S)
    pairs = re.findall(r'"\\\\\.(\w+)\\\\\'" \. (\w+)-mode', settings)
    assert {name: {ending for ending, named in pairs if named == name} for name in KNOWN} == KNOWN
    assert settings.count("(") == settings.count(")")


def test_kate_gives_each_language_its_endings() -> None:
    servers = json.loads(re.search(r"```json\n(.*?)```", PAGE, re.S)[1])["servers"]
    found = {}
    for name, server in servers.items():
        language = ElementTree.parse(EDITORS / "kate" / f"{name}.xml").getroot()
        found[name] = {each.removeprefix("*.") for each in language.attrib["extensions"].split(";")}
        assert re.search(server["highlightingModeRegex"], language.attrib["name"])
        assert server["command"] == ["multidrop", "lsp"]
    assert found == KNOWN


def test_neovim_gives_each_language_its_endings() -> None:
    newer = re.search(r"extension = \{(.*?)\}", PAGE)[1]
    pairs = re.findall(r'(\w+) = "(\w+)"', newer)
    assert {name: {ending for ending, named in pairs if named == name} for name in KNOWN} == KNOWN
    older = (EDITORS / "neovim.lua").read_text()
    assert set(re.findall(r'"\*\.(\w+)"', older)) == set().union(*KNOWN.values())
