"""`[mqtt]` in what `multidrop config` shows and checks."""

from __future__ import annotations

from pathlib import Path

from tests.support.front_door import Command, Done, tables


def test_without_a_file_every_setting_is_a_default(multidrop: Command) -> None:
    found = tables(multidrop("config", "show"))
    assert [each for each in found if each in ("[log]", "[mqtt]", "[simulator]")] == ["[log]", "[mqtt]", "[simulator]"]
    assert found["[mqtt]"] == [
        f'{name} = ""   # default' for name in ("username", "password", "password_file", "ca", "cert", "key")
    ]


def test_what_the_file_sets_has_no_remark_and_no_password(multidrop: Command, tmp_path: Path) -> None:
    (tmp_path / "conf").mkdir()
    file = tmp_path / "conf" / "multidrop.toml"
    file.write_text('[mqtt]\nusername = "u"\npassword = "secret"\n')
    done = multidrop("config", "show")
    shown = tables(done)["[mqtt]"]
    assert shown[:3] == ['username = "u"', 'password = "***"', 'password_file = ""   # default']
    assert (done.returncode, done.stderr) == (0, "") and "secret" not in done.stdout
    assert multidrop("config", "check") == Done(0, f"{file} is right\n", "")
