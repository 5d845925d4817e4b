from types import SimpleNamespace

import pytest

from shell.complete import complete, hint


def drive(address, label="", language="mcode"):
    return SimpleNamespace(address=address, label=label, product="LMDCM", dialect=SimpleNamespace(language=language))


@pytest.fixture
def session():
    press = SimpleNamespace(name="press", drives={"a": drive("a"), "b": drive("b", "gantry")})
    eth = SimpleNamespace(name="eth", drives={"00": drive("00", language="pmx")})
    return SimpleNamespace(
        buses={"press": press, "eth": eth},
        selected_bus="press",
        selected=press.drives["a"],
        macros=SimpleNamespace(names=lambda: ["home", "shuttle"]),
        settings=SimpleNamespace(connections={"lathe": SimpleNamespace(url="tcp://10.0.0.5")}),
    )


@pytest.mark.parametrize(
    ("text", "offered"),
    [
        ("/op", "/open"),
        ("@", "@a "),
        ("@", "@* "),
        ("@e", "@eth:00 "),
        ("/use ", "b"),
        ("/use e", "eth"),
        ("/play s", "shuttle"),
        ("/key F1", "F12"),
        ("/key F3 h", "home"),
        ("/wait s", "stopped"),
        ("/open l", "lathe"),
        ("/help MR", "MR"),
        ("MR", "MR"),
        ("mr", "MR"),
        ("@b PR P", "P"),
        ("VM=", None),
        ('PR "MR', None),
        ("@eth:00 MR", None),
        ("/nothing x", None),
        ("", None),
    ],
)
def test_what_may_be_meant_is_offered(session, text, offered):
    found = complete(session, text)
    assert [each.text for each in found if each.text == offered] == [offered] if offered else found == []
    for each in found:
        assert (text[: each.start] + each.text).lower().startswith(text.lower())


def test_mnemonics_and_verbs_come_with_their_meaning(session):
    assert all(each.meaning for each in [*complete(session, "M"), *complete(session, "/")])


def test_files_are_offered_where_a_file_is_meant(session, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "part.mxt").touch()
    (tmp_path / "more").mkdir()
    (tmp_path / "more" / "other.mxt").touch()
    assert [each.text for each in complete(session, "/download ")] == ["more/", "part.mxt"]
    assert [each.text for each in complete(session, "/download more/o")] == ["more/other.mxt"]
    assert complete(session, "/download nowhere/") == []


@pytest.mark.parametrize(
    ("text", "has"),
    [("/open sim:", "/open URL"), ("@", "@ADDR TEXT"), ("@b MR 5", "MR"), ("MR 5", "MR"), ("@eth:00 MR", ""), ("", "")],
)
def test_the_hint_tells_of_what_is_being_typed(session, text, has):
    found = hint(session, text)
    assert has in found and bool(found) == bool(has)
