"""The package in `examples/plugin`, written from `docs/plugins.md`: it is installed like any other, and removed."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

from tests.support.front_door import Done
from tests.support.paths import ROOT
from tests.support.processes import environment

pytestmark = [pytest.mark.process, pytest.mark.slow, pytest.mark.wine("its Python has no pip")]
PLUGIN = ROOT / "examples" / "plugin"
THERE_AND_BACK = ("@a MR 51200", "/wait stopped", "@a MR -51200", "/wait stopped")


def ran(*command: object, folder: Path) -> Done:
    """Run a program with the packages of the tests beside its own."""
    packages = {"PYTHONPATH": os.pathsep.join([str(ROOT), sysconfig.get_path("purelib")])}
    words, env = [str(each) for each in command], environment(folder) | packages
    done = subprocess.run(words, cwd=folder, env=env, capture_output=True, text=True, timeout=300)
    return Done(done.returncode, done.stdout, done.stderr)


class Installed:
    """A fresh environment with a package in it. `pip` and `multidrop` work there, without a network."""

    def __init__(self, folder: Path, source: Path) -> None:
        self.folder = folder
        self.python = folder / "venv" / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
        assert ran(sys.executable, "-m", "venv", "--without-pip", folder / "venv", folder=folder).returncode == 0
        shutil.copytree(source, folder / "source", ignore=shutil.ignore_patterns("__pycache__"))
        offline = ("--no-deps", "--no-build-isolation", "--no-index", "--disable-pip-version-check")
        self.pip("wheel", *offline, "--wheel-dir", folder / "dist", folder / "source")
        [wheel] = (folder / "dist").glob("*.whl")
        self.pip("install", "--no-deps", "--no-index", wheel)

    def pip(self, *arguments: object) -> None:
        done = ran(self.python, "-m", "pip", *arguments, folder=self.folder)
        assert done.returncode == 0, done.stderr

    def multidrop(self, *arguments: str) -> Done:
        return ran(self.python, "-m", "multidrop", *arguments, folder=self.folder)


@pytest.fixture(scope="module")
def plugin(tmp_path_factory: pytest.TempPathFactory) -> Installed:
    """The plugin as it is."""
    return Installed(tmp_path_factory.mktemp("plugin"), PLUGIN)


def test_an_installed_package_is_listed_and_has_help(plugin: Installed) -> None:
    [line] = [each for each in plugin.multidrop("features").stdout.splitlines() if each.startswith("mileage ")]
    assert line.split()[1:4] == ["multidrop-mileage", "1.0", "ready"]
    assert "/mileage [ADDR]" in plugin.multidrop("send", "sim:#press", "/help").stdout
    done = plugin.multidrop("mileage", "--help")
    assert done.returncode == 0 and "usage: multidrop mileage [-h] [--no-config] URL LINE [LINE ...]" in done.stdout
    assert "  multidrop mileage 'sim:#press'" in done.stdout


def test_its_command_counts_there_and_back_twice(plugin: Installed) -> None:
    done = plugin.multidrop("mileage", "sim:#press", *THERE_AND_BACK)
    assert done == Done(0, "a: 102400 steps (10 mm)\nb: 0 steps\nc: 0 steps\n", "")


def test_an_address_that_is_not_there_is_one_line_and_wrong_usage(plugin: Installed) -> None:
    done = plugin.multidrop("send", "sim:#press", "/mileage z")
    assert done == Done(2, "", "/mileage: no drive z; /drives lists them\n")
    done = plugin.multidrop("mileage", "nowhere", "PR P")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)


def test_a_broken_package_is_one_warning_and_the_rest_works(tmp_path: Path) -> None:
    source = shutil.copytree(PLUGIN, tmp_path / "broken")
    module = source / "multidrop_mileage.py"
    module.write_text(module.read_text(encoding="utf-8") + "raise RuntimeError('no gauge')\n", encoding="utf-8")
    broken = Installed(tmp_path, source)
    done = broken.multidrop("send", "sim:#press", "PR P")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (0, "0\n", 1)
    assert "the feature mileage (multidrop-mileage) cannot be loaded: RuntimeError: no gauge" in done.stderr
    assert "no gauge" in broken.multidrop("features").stdout


def test_nothing_is_left_of_a_package_that_is_uninstalled(tmp_path: Path) -> None:
    away = Installed(tmp_path, PLUGIN)
    assert "mileage" in away.multidrop("features").stdout
    away.pip("uninstall", "--yes", "multidrop-mileage")
    assert "mileage" not in away.multidrop("features").stdout
    done = away.multidrop("send", "sim:#press", "/mileage", "PR P")
    assert done.returncode == 2 and done.stderr.startswith("no verb /mileage")
    assert away.multidrop("mileage", "sim:#press", "PR P").returncode == 2
    assert away.multidrop("send", "sim:#press", "PR P") == Done(0, "0\n", "")
