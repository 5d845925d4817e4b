"""An sshd of a test's own on loopback, and a program `ssh` first in PATH that knows its keys."""

from __future__ import annotations

import contextlib
import getpass
import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.paths import ROOT
from tests.support.tools import absent, tool
from tests.support.until import PATIENCE

CONFIG = """
ListenAddress 127.0.0.1
Port {port}
HostKey {folder}/host_key
PidFile {folder}/sshd.pid
AuthorizedKeysFile {folder}/user_key.pub
StrictModes no
UsePAM no
PasswordAuthentication no
KbdInteractiveAuthentication no
PermitRootLogin yes
SetEnv PATH={path}
LogLevel ERROR
"""


def script(path: Path, text: str) -> None:
    """Make a program of a text for sh."""
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)


def far_programs(folder: Path, *names: str) -> str:
    """Make a folder with `multidrop` (of this tree) or others of this machine; return it."""
    folder.mkdir()
    for name in names:
        if name == "multidrop":
            script(folder / name, f'export PYTHONPATH="{ROOT}"; exec {sys.executable} -m multidrop "$@"')
        elif found := shutil.which(name):
            (folder / name).symlink_to(found)
    return str(folder)


def fake_ssh(folder: Path, body: str) -> str:
    """Make a folder with a program `ssh` of this body, in which `$last` is the command for the far shell."""
    folder.mkdir(exist_ok=True)
    script(folder / "ssh", f"for last; do :; done\n{body}")
    return f"{folder}:{os.environ['PATH']}"


@contextlib.contextmanager
def ssh_server(folder: Path) -> Iterator[int]:
    """Run an sshd, and put `ssh` first in PATH; yield its port."""
    far = far_programs(folder / "far", "multidrop", "readlink")
    for key in ("host_key", "user_key"):
        subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", folder / key], check=True)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    if os.geteuid() == 0:  # it wants a folder of its own then
        os.makedirs("/run/sshd", mode=0o755, exist_ok=True)
    (folder / "sshd_config").write_text(CONFIG.format(port=port, folder=folder, path=f"{far}:/usr/bin:/bin"))
    host = (folder / "host_key.pub").read_text()
    (folder / "known_hosts").write_text(f"[127.0.0.1]:{port} {host}")
    (folder / "ssh_config").write_text(
        f"Host *\n User {getpass.getuser()}\n IdentityFile {folder}/user_key\n IdentitiesOnly yes\n"
        f" UserKnownHostsFile {folder}/known_hosts\n"
    )
    with (folder / "sshd.log").open("wb") as log:
        server = subprocess.Popen([tool("sshd"), "-D", "-e", "-f", folder / "sshd_config"], stdout=log, stderr=log)
        try:
            _until_open(port, server)
            with pytest.MonkeyPatch.context() as patch:
                patch.setenv("PATH", fake_ssh(folder / "bin", f'exec {tool("ssh")} -F "{folder}/ssh_config" "$@"'))
                yield port
        finally:
            server.terminate()
            server.wait(PATIENCE)


def _until_open(port: int, server: subprocess.Popen[bytes]) -> None:
    deadline = time.monotonic() + PATIENCE
    while server.poll() is None and time.monotonic() < deadline:
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1):
            return
        time.sleep(0.01)
    absent("sshd does not start here")
