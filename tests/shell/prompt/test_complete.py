from types import SimpleNamespace

import pytest

from multidrop import cli
from multidrop.dialects.families import FAMILIES
from multidrop.dialects.family import Family
from multidrop.shell.channel import Front
from multidrop.shell.connect.schemes import schemes
from multidrop.shell.connect.urls import KEYS
from multidrop.shell.operations.parameter import Listed
from multidrop.shell.operations.table import VERBS
from multidrop.shell.prompt.complete import complete, hint
from multidrop.simulator import USAGES
from tests.support.cases import for_each
from tests.support.paths import THERE

BOTH = [("press", "a"), ("press", "b"), ("eth", "!")]


class Minimal(Family):
    """A family that offers what a family must, and nothing more."""


def drive(address, label="", language="mcode"):
    return SimpleNamespace(address=address, label=label, product="LMDCM", family=FAMILIES[language])


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
        cells={},
        raw={},
        names=SimpleNamespace(offered=lambda drive, line: ()),
        front=Front(),
    )


@pytest.fixture
def simulated(session):
    placed = [SimpleNamespace(bus=bus, spec=SimpleNamespace(name=name, personality="LMDCM")) for bus, name in BOTH]
    floor = SimpleNamespace(floor=SimpleNamespace(drives=placed))
    session.cells = {"press": floor}
    return session


@for_each(
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
        ("/open r", "rfc2217://"),
        ("/open m", "modbus://"),
        ("/open sim:", "sim:"),
        ("/open sim:families/pmx/simulator/dem", "sim:families/pmx/simulator/demo.toml"),
        ("/record s", "shuttle"),
        ("/record s", "stop"),
        ("/record shuttle -", "--replace"),
        ("/record stop -", "--waits"),
        ("/key F3 o", "off"),
        ("/wait stopped 5 s", None),
        ("/log o", "off"),
        ("/coil 1 1", "1"),
        ("/plot o", "off"),
        ("/status b", "b"),
        ("/list b", "b"),
        ("/drives x", None),
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


@pytest.mark.parametrize(
    ("text", "offered"),
    [
        ("/sim s", "supply"),
        ("/sim l", "lock"),
        ("/sim input ", "b"),
        ("/sim input e", "eth:!"),
        ("/sim input b 1 ", "open"),
        ("/sim supply b o", "off"),
        ("/sim unplug p", "press"),
        ("/sim push b 1", None),
        ("/sim shake ", None),
        ("/si", "/sim"),
    ],
)
def test_the_hands_of_the_simulator_are_offered_where_there_is_one(session, simulated, text, offered):
    found = [each.text for each in complete(simulated, text)]
    assert offered in found if offered else found == []
    session.cells = {}
    assert "/sim" not in [each.text for each in complete(session, "/si")]


def test_verbs_are_offered_where_the_selected_drive_has_a_use_for_them(session):
    def offered():
        return {each.text for each in complete(session, "/")}

    session.selected.family, session.selected.family.language = Minimal, FAMILIES["modbus"].language
    assert not offered() & {"/status", "/register", "/coil", "/device"}
    for family in ("mcode", "pmx", "modbus"):
        session.selected.family = FAMILIES[family]
        assert "/status" in offered() and ("/register" in offered()) is (family == "modbus")


def test_every_argument_of_a_verb_is_completed_or_known_to_a_person_only():
    known_to_a_person = {
        *('"TEXT" [SECONDS]', "ADDRESS [COUNT|=VALUE]", "BYTE ...", "COUNTS", "LABEL", "MS", "N", "NAME", "NAME,..."),
        *("NAME=VALUE", "NUMBER", "PASSES", "SECONDS", "STEPS", "TEXT", "TEXT ...", "UNIT", "UNIT/turn|UNIT/step"),
        *("'5 mm/turn'", "'0..300 mm'", "'120 mm'", "200", "WORD,..."),
        *(("N|max", "[HOST:]PORT") if "plot_files" in THERE else ()),
    }
    arguments = [each for verb in VERBS.values() for form in verb.working for each in form.arguments if not each.flag]
    assert {each.value for each in arguments if not each.argument.listed and not each.words} == known_to_a_person
    for listed in Listed:
        if listed is not Listed.BROKER:
            assert any(listed in each.argument.listed for each in arguments), listed


def test_every_word_of_sim_and_every_kind_of_url_is_in_help_and_usage():
    told = VERBS["/sim"].described()
    for word, usage in USAGES.items():
        assert usage in VERBS["/sim"].usage and any(line.startswith(f"  {usage}") for line in told), word
    told = "\n".join(VERBS["/open"].described())
    assert all(form.example in told and form.example in cli.urls() for form in schemes().values())
    assert all(key in cli.urls() for key in KEYS)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("/sim lock b", "/sim lock DRIVE on|off   hold the rotor fast, or let go"),
        ("/sim", f"{VERBS['/sim'].usage}   Act on simulated drives from outside: inputs, loads, power, cables."),
        ("/sim u", "/sim unplug BUS   Act"),
        ("/sim power b o", "/sim power DRIVE on|off   switch the whole drive on or off"),
        ("/sim p", "/sim push DRIVE STEPS | power DRIVE on|off | plug BUS   Act"),
        ("/sim shake", f"{VERBS['/sim'].usage}   Act"),
        ("/wait idle", "/wait stopped|idle|ended [SECONDS]   the same, and no program is running"),
        ("/record ", "/record [MACRO [--replace] | stop [--waits]]"),
    ],
)
def test_the_hint_narrows_with_what_is_typed(session, text, told):
    assert hint(session, text).startswith(told)
