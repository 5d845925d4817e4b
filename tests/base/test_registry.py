"""Features by others: where they come from, what becomes of one that cannot be loaded, and of one that is not there."""

from __future__ import annotations

import importlib.metadata
import os
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from multidrop.base import places, registry
from multidrop.base.errors import Diagnostic
from multidrop.base.feature import Feature
from tests.support.own_features import forget_loaded, load, wheel_unread

GOOD = 'from multidrop.base.feature import Feature\nFEATURE = Feature("{name}", "does something")\n'
NO_OPENING = """
from multidrop.base.feature import Feature
from multidrop.shell.connect.scheme import Scheme

class Can(Scheme):
    name, prefix, example, meaning = "can", "can://", "can://HOST", "a gateway"

FEATURE = Feature("bad", "a kind of URL", adds=(Can(),))
"""


@pytest.fixture(autouse=True)
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The folder of a person's own features; nothing is loaded before or after."""
    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(tmp_path))
    monkeypatch.setenv("MULTIDROP_STATE_DIR", str(tmp_path / "state"))
    forget_loaded(monkeypatch)
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: [])
    folder = tmp_path / "features"
    folder.mkdir()
    yield folder


def write(folder: Path, name: str, text: str = GOOD) -> Path:
    path = folder / f"{name}.py"
    path.write_text(text.replace("{name}", name))
    return path


def state(name: str) -> tuple[str, str]:
    """Its source and its state."""
    [(source, found)] = [(entry.source, said) for entry, _, said in registry.states("1.2") if entry.name == name]
    return source, found


def test_a_file_in_the_folder_is_a_feature(own: Path) -> None:
    path = write(own, "clamp")
    registry.load_others()
    assert registry.warnings() == []
    assert [each.name for each in registry.by_others()] == ["clamp"]
    assert state("clamp") == (str(path), "ready")


def test_without_the_configuration_a_persons_own_files_are_not_loaded(own: Path) -> None:
    write(own, "clamp")
    with places.without_configuration():
        registry.load_others()
    assert registry.warnings() == [] and registry.by_others() == []


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("raise SystemExit(3)", "SystemExit: 3"),
        ("import no_such_module", "ModuleNotFoundError: No module named 'no_such_module'"),
        ("def (", "SyntaxError: "),
        ("1 / 0", "ZeroDivisionError: division by zero"),
        ("x = 1", "AttributeError: "),
        ("FEATURE = 1", "TypeError: FEATURE is no multidrop.base.feature.Feature"),
        ("class B(BaseException): pass\nraise B('x')", "B: x"),
        (GOOD.replace('"does something"', "None"), "TypeError: name and meaning are texts"),
        (GOOD.replace('something"', 'something", adds=Feature("a", "b")'), "TypeError: adds is a tuple of records"),
        (GOOD.replace('something"', 'something", extras=["fit"]'), "TypeError: extras is a mapping of names to names"),
        (GOOD.replace("{name}", "other"), "its record has the name other"),
        (NO_OPENING, "TypeError: Can't instantiate abstract class Can with"),
    ],
)
def test_one_that_cannot_be_loaded_is_one_warning_and_the_others_are_there(own: Path, text: str, why: str) -> None:
    path = write(own, "bad", text)
    write(own, "fine")
    registry.load_others()
    [warning] = registry.warnings()
    assert warning.startswith(f"the feature bad ({path}) cannot be loaded: {why}")
    assert [each.name for each in registry.by_others()] == ["fine"]
    registry.load_others()
    assert registry.warnings() == [], "it is said once"
    assert state("bad")[1].startswith(f"cannot be loaded: {why}")


@pytest.mark.fork
def test_a_file_that_others_can_change_is_not_used(own: Path) -> None:
    write(own, "clamp").chmod(0o666)
    registry.load_others()
    [warning] = registry.warnings()
    assert "can be changed by every account" in warning and registry.by_others() == []


@pytest.mark.fork
def test_a_pipe_in_the_folder_is_not_read(own: Path) -> None:
    os.mkfifo(own / "pipe.py")
    (own / "folder.py").mkdir()
    registry.load_others()
    assert [each.endswith("cannot be loaded: it is not a file") for each in registry.warnings()] == [True, True]


def test_a_name_of_the_wheel_is_taken(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "IN_WHEEL", {"clamp": ()})
    write(own, "clamp")
    registry.load_others()
    assert registry.warnings()[0].endswith("cannot be loaded: another feature has this name")


def test_a_feature_tells_which_extras_are_missing() -> None:
    assert Feature("x", "y", extras={"fit": "no_such_module", "here": "json"}).missing() == ["fit"]


def package(name: str, value: str, version: str = "2.0") -> Any:
    return SimpleNamespace(name=name, value=value, dist=SimpleNamespace(name=f"multidrop-{name}", version=version))


def test_packages_are_read_once_until_the_environment_changes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    site = tmp_path / "site"
    site.mkdir()
    monkeypatch.syspath_prepend(str(tmp_path / "first"))
    monkeypatch.setattr("sys.path", [str(tmp_path), str(site)])
    reads = []

    def entry_points(group: str) -> list[Any]:
        reads.append(group)
        return [package("gauge", "package_gauge:FEATURE")] if group == registry.GROUP else []

    monkeypatch.setattr(importlib.metadata, "entry_points", entry_points)
    first = registry.entries()
    assert first == [registry.FeatureEntry("gauge", "multidrop-gauge", "2.0", "package_gauge:FEATURE")]
    assert registry.entries() == first and reads == ["multidrop.features", "multidrop.families"]
    os.utime(site, ns=(1, 1))
    assert registry.entries() == first and len(reads) == 4


@pytest.mark.parametrize("value", ["package_knock:FAMILY", "package_knock"])
def test_a_package_brings_a_family_by_an_entry_point_of_its_own(
    value: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "package_knock.py").write_text(GOOD.replace("{name}", "knock").replace("FEATURE", "FAMILY"))
    monkeypatch.syspath_prepend(str(tmp_path))
    found = {registry.FAMILY_GROUP: [package("knock", value)]}
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: found.get(group, []))
    registry.load_others()
    assert registry.warnings() == [] and state("knock") == ("multidrop-knock", "ready")
    assert [each.name for each in registry.families()][-1] == "knock"


def test_what_is_kept_of_packages_may_be_damaged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: [package("gauge", "g:FEATURE")])
    first = registry.entries()
    (tmp_path / "state" / registry.FEATURES_FILE).write_text("[1")
    assert registry.entries() == first


def test_a_package_is_loaded_by_its_entry_point(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "package_clamp.py").write_text(GOOD.replace("{name}", "clamp"))
    monkeypatch.syspath_prepend(str(tmp_path))
    found = {registry.GROUP: [package("clamp", "package_clamp:FEATURE")]}
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: found.get(group, []))
    registry.load_others()
    assert registry.warnings() == []
    assert state("clamp") == ("multidrop-clamp", "ready")
    [(entry, meaning, _)] = [each for each in registry.states("1.2") if each[0].name == "clamp"]
    assert (entry.version, meaning) == ("2.0", "does something")


def test_the_word_of_a_feature_that_was_deleted_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "IN_WHEEL", {"gone_away": ("gone", "/gone", "relay usb:")})
    monkeypatch.setattr(registry, "FAMILIES", {})
    with pytest.raises(Diagnostic, match="gone: the feature gone_away is not there; install multidrop again, whole"):
        registry.with_word("gone")
    with pytest.raises(Diagnostic, match="^relay usb: the feature gone_away is not there"):
        registry.with_word("relay usb:")
    assert list(registry.wheels()) == [] and registry.with_word("other") is None
    assert [(entry.name, said) for entry, _, said in registry.states("1.2")] == [("gone_away", "not there")]


def test_the_language_of_a_family_that_was_deleted_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "FAMILIES", {"gone_too": ("dialect=gone", "gone:")})
    with pytest.raises(Diagnostic, match="^dialect=gone: the family gone_too is not there; install multidrop again"):
        registry.with_word("dialect=gone")


@pytest.mark.parametrize(
    ("failure", "why"),
    [
        (ImportError("no scipy"), "ImportError: no scipy"),
        (ModuleNotFoundError("no scipy", name="scipy"), "ModuleNotFoundError: no scipy"),
        (SyntaxError("invalid"), "SyntaxError: invalid"),
        (ValueError("two\nlines"), "ValueError: two lines"),
        (SystemExit(3), "SystemExit: 3"),
    ],
)
def test_a_feature_of_the_wheel_whose_module_raises_is_one_warning_and_its_word_says_why(
    failure: BaseException, why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def raising(name: str) -> None:
        raise failure

    monkeypatch.setattr(registry, "IN_WHEEL", {"twins": ("/twin",)})
    monkeypatch.setattr(registry, "FAMILIES", {})
    wheel_unread(monkeypatch)
    monkeypatch.setattr(registry.importlib, "import_module", raising)
    assert list(registry.wheels()) == [] == list(registry.wheels())
    assert registry.warnings() == [f"the feature twins (multidrop) cannot be loaded: {why}"]
    with pytest.raises(Diagnostic, match=f"^/twin: the feature twins cannot be loaded: {why}; install multidrop"):
        registry.with_word("/twin")
    assert [said for _, _, said in registry.states("1.2")] == [f"cannot be loaded: {why}"]


SINGLE = """
from multidrop.base.feature import Feature

class One:
    def claims(self):
        return ("the only place",)

FEATURE = Feature("{name}", "has it", adds=(One(),))
"""


def test_of_two_features_for_a_single_place_the_later_one_is_refused(own: Path) -> None:
    write(own, "early", SINGLE)
    path = write(own, "later", SINGLE)
    write(own, "twice", SINGLE.replace("(One(),)", "(One(), One())"))
    registry.load_others()
    assert registry.warnings()[0] == f"the feature later ({path}) cannot be loaded: the only place is taken"
    assert [each.name for each in registry.by_others()] == ["early"]


def test_what_features_add_is_found_by_its_class(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "IN_WHEEL", {})
    load(monkeypatch, Feature("x", "y", adds=(1, "a", 2.5, 3)))
    assert list(registry.added(int)) == [1, 3] and list(registry.added(str)) == ["a"]
