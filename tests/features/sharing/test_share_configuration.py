"""What `share` says of a wrong configuration, and of a URL that a feature by others adds."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.front_door import Command
from tests.support.own_features import forget_loaded, own

SCHEME = """
from multidrop.base.feature import Feature
from multidrop.shell.connect.scheme import Scheme
from multidrop.transports import Unreachable

class Can(Scheme):
    name, prefix, example, meaning, port = "can", "can://", "can://HOST:29536", "a CAN gateway", 29536

    async def open(self, connection, baud, within=None):
        raise Unreachable(f"{connection.host}:{connection.port}: no gateway")

FEATURE = Feature("can", "CAN gateways", adds=(Can(),))
"""


def test_a_url_of_others_is_known_before_a_session_opens(
    multidrop: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    forget_loaded(monkeypatch)
    own(tmp_path, "can", SCHEME)
    assert "no kind of connection can://" in multidrop("share", "can://pc", "--rfc2217", "0", "--no-config").stderr
    shared = multidrop("share", "can://pc", "--rfc2217", "0")
    assert (shared.returncode, shared.stderr) == (3, "pc:29536: no gateway\n")


def test_each_error_of_the_configuration_is_named_and_the_way_on(multidrop: Command, tmp_path: Path) -> None:
    (tmp_path / "conf").mkdir()
    file = tmp_path / "conf" / "multidrop.toml"
    file.write_text("[log]\nfiles = 0\n[screen]\nsigns = 5\n")
    done = multidrop("share", "sim:#press", "--rfc2217", "0", "--json")
    assert done.returncode == 2
    assert f"{file}:2: log.files" in done.stderr and f"{file}:4: screen.signs" in done.stderr
    assert "--no-config" in done.stderr
