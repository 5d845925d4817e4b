"""The wheel and the source distribution: what is in them, and that they install where nothing else is."""

import os
import subprocess
import sys
import tarfile
import zipfile

import pytest

from tests.support.paths import ROOT

pytestmark = [pytest.mark.process, pytest.mark.nightly]
ROOMS = {"tui", "shell", "macros", "drives", "simulator", "dialects", "transports", "base", "families", "features"}
DATA = {
    "share/man/man1/multidrop.1",
    "share/bash-completion/completions/multidrop",
    "share/zsh/site-functions/_multidrop",
    "share/fish/vendor_completions.d/multidrop.fish",
}


def run(*command, env=None):
    done = subprocess.run([str(each) for each in command], env=env, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    folder = tmp_path_factory.mktemp("dist")
    run(sys.executable, "-m", "build", "--outdir", folder, ROOT)
    return next(folder.glob("*.whl")), next(folder.glob("*.tar.gz"))


def test_the_wheel_has_one_package_the_data_and_nothing_else(built):
    names = zipfile.ZipFile(built[0]).namelist()
    assert {name.split("/")[0] for name in names if not name.startswith("multidrop-")} == {"multidrop"}
    tracked = run("git", "-C", ROOT, "ls-files", "--", *ROOMS).split()
    assert {name for name in names if name.split("/")[1] in ROOMS} == {f"multidrop/{name}" for name in tracked}
    assert {name.partition(".data/data/")[2] for name in names} >= DATA


def test_the_source_distribution_builds_and_tests_itself(built):
    with tarfile.open(built[1]) as file:
        names = {name.partition("/")[2] for name in file.getnames()}
    assert names >= {
        "Makefile",
        "constraints.txt",
        "requirements-dev.txt",
        "tests/conftest.py",
        "packaging/generate.py",
        "packaging/rooms.py",
        "shell/session.py",
    }
    assert not [name for name in names if name.split("/")[1:2] and name.split("/")[1] in ROOMS]


@pytest.mark.parametrize("which", [0, 1], ids=["wheel", "sdist"])
def test_it_installs_without_a_compiler_and_runs_in_an_empty_home(built, which, tmp_path):
    env = {"HOME": str(tmp_path / "home"), "PATH": "/usr/bin:/bin", "CC": "/bin/false", "CXX": "/bin/false"}
    (tmp_path / "home").mkdir()
    run(sys.executable, "-m", "venv", tmp_path / "venv")
    run(tmp_path / "venv/bin/python", "-m", "pip", "install", "-c", ROOT / "constraints.txt", built[which])
    multidrop = tmp_path / "venv/bin/multidrop"
    assert run(multidrop, "--version", env=env).startswith("multidrop ")
    assert run(multidrop, "send", "sim:#press", "PR VR", env=env) == "LMDCM 6.002, Hw: 3.2\n"
    assert "no such file" in run(multidrop, "report", env=env)
    for name in ("shell", "drives", "transports", "macros", "tests"):  # a person's own files beside his program
        (tmp_path / f"{name}.py").write_text("raise SystemExit('imported')\n")
    (tmp_path / "own.py").write_text(
        "import multidrop\nwith multidrop.connect('sim:#press') as s: print(s.drive().send('PR VR'))\n"
    )
    assert "LMDCM" in run(tmp_path / "venv/bin/python", tmp_path / "own.py", env=env)
    assert all((tmp_path / "venv" / name).exists() for name in DATA)


@pytest.mark.parametrize("links", [True, False], ids=["links", "no-links"])
def test_a_checkout_runs_and_its_editable_install_too(links, tmp_path):
    """Without symbolic links (a checkout on a file system that has none) git writes small files in their place."""
    tree = tmp_path / "tree"
    run("git", "-c", f"core.symlinks={'true' if links else 'false'}", "clone", "--quiet", ROOT, tree)
    assert (tree / "multidrop" / "shell").is_symlink() is links
    env = {"HOME": str(tmp_path), "PATH": os.environ["PATH"]}
    (tmp_path / "shell.py").write_text("raise SystemExit('imported')\n")
    run(sys.executable, "-m", "venv", "--system-site-packages", tmp_path / "venv")
    python = tmp_path / "venv/bin/python"
    packages = os.pathsep.join(path for path in sys.path if path.endswith("site-packages"))
    run(python, "-m", "pip", "install", "--no-deps", "-e", tree, env=env)
    said = subprocess.run(
        [str(python), "-m", "multidrop", "send", "sim:#press", "PR VR"],
        env=env | {"PYTHONPATH": packages},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert said.stdout == "LMDCM 6.002, Hw: 3.2\n", said.stderr
