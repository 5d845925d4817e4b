import sys
import tomllib

import pytest

import multidrop
from multidrop import cli
from tests.support.paths import ROOT


def test_the_public_names_are_there():
    assert [name for name in multidrop.__all__ if getattr(multidrop, name) is None] == []
    assert multidrop.Session.__name__ == "Session" and set(multidrop.__all__) == set(multidrop._PUBLIC)


def test_what_is_not_public_is_an_attribute_error():
    with pytest.raises(AttributeError, match="frob"):
        multidrop.frob  # noqa: B018


def test_the_version_says_which_extras_are_installed(monkeypatch):
    with open(ROOT / "pyproject.toml", "rb") as file:
        project = tomllib.load(file)["project"]
    assert set(cli.EXTRAS) == set(project["optional-dependencies"])
    monkeypatch.setattr(cli, "EXTRAS", {"here": "json", "absent": "no_such_module"})
    python = ".".join(map(str, sys.version_info[:3]))
    assert cli.version() == f"multidrop {multidrop.__version__}, Python {python}, extras: here"
    monkeypatch.setattr(cli, "EXTRAS", {})
    assert cli.version().endswith("extras: none")
