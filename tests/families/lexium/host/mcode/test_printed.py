"""What a PR prints is known from its text, so that other lines are told from it; values are signed."""

import re
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import NoAnswer
from multidrop.dialects import DriveState
from multidrop.families.lexium.host import classify
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.exchange import sign, signed
from multidrop.families.lexium.host.mcode.family import MCodeFamily
from multidrop.families.lexium.host.mcode.state import MCodeState
from multidrop.families.lexium.manual.table import words
from multidrop.families.lexium.simulator.state.models import MODELS
from tests.support.mcode_drives import MODES, Desk

FORMS = [
    ("PR P", ["0", "-5", "-2147483648"], ["tick 100", "", "1.5", "5 6", "5000200473513947"]),
    ('PR "v",R1', ["v5", "v-5"], ["tick 100", "5", "v", "vv5", "v5 "]),
    ('PR "v",R1;', ["v5"], ["5"]),
    ('pr"V3="V3', ["V3=5"], ["V3=", "3=5"]),
    ("PR MV ST I1", ["001", "0-11"], ["0 0", "x01", ""]),
    ('PR P,"1",P', ["515"], ["x"]),
    ('PR P," at ",V," steps/s"', ["5 at -7 steps/s"], ["5 at -7 steps", "5 at x steps/s"]),
    ('PR "Bex 1"', ["Bex 1"], ["Bex 2", "bex 1"]),
    ('PR "a.b*",P', ["a.b*5"], ["axb5", "a.bb5"]),
    ('PR "x\\r",P', ["x5", "x\\r5"], ["xr5"]),
    ("PR DN", ['"a"', "a"], []),
    ('PR "<",DN,">",PN', ['<"!">LMDCM571'], ['"!">LMDCM571']),
    ("PR VR", ["LMDCM 6.002, Hw: 3.2"], []),
    ('PR "T ",IT,1', ["T 35"], ["35"]),
    ("PR VT,1", ["0, 12"], []),
    ("PR F1", ["  1.5E+03"], []),
    ('PR "n ",Q1', ["n 5"], ["n x"]),
    ("PR 8", ["8"], ["9", "88"]),
    ('PR ""', [""], ["x"]),
]


@pytest.mark.parametrize(("text", "answers", "others"), FORMS)
def test_the_form_of_an_answer_comes_from_the_text_of_its_print(text, answers, others):
    form = classify.print_form(text)
    assert form is not None
    for line in answers:
        assert re.fullmatch(form, line), line
    for line in others:
        assert not re.fullmatch(form, line), line


@pytest.mark.parametrize("text", ["MR 5", "PR AL", "L", 'PR "x', "PR ,P", 'PR "a\\n",P', "PR", "", "PR P+1"])
def test_where_it_is_not_known_or_has_several_lines_there_is_none(text):
    assert classify.print_form(text) is None and classify.with_item(text, "DN") is None


@pytest.mark.parametrize("product", MODELS)
def test_every_word_prints_what_its_form_says(bench, product):
    [device] = bench([{"personality": product}]).devices.values()
    device.execute("VA Q1=-7", 0.0)
    device.execute("PF=12,3,1,0", 0.0)
    seen = 0
    for word in (*words(product), "Q1"):
        answer = device.execute(f"PR {word}", 0.0)
        if answer.refused or len(answer.lines) != 1 or (form := classify.print_form(f"PR {word}")) is None:
            continue
        seen += 1
        assert re.fullmatch(form, answer.lines[0]), (word, answer.lines)
    assert seen > 40


ITEMS = st.lists(
    st.one_of(
        st.sampled_from(["P", "R1", "DN", "F1", "VT", "1", "-5", "Q1", "VR", "S1", "IT 1"]),
        st.text(st.characters(min_codepoint=32, max_codepoint=126, exclude_characters='"'), max_size=8).map(
            '"{}"'.format
        ),
    ),
    max_size=12,
)


@given(ITEMS, st.sampled_from([",", " ", " , "]), st.booleans())
def test_the_form_of_any_print_is_an_expression_that_is_matched_fast(items, between, quiet):
    text = "PR " + between.join(items) + ";" * quiet
    form = classify.print_form(text)
    assert form is None or re.compile(form)
    if form is None:
        return
    begun = time.process_time()
    for line in ("1" * 4000, "-1" * 2000, " " * 4000 + "x", "1 " * 2000):
        re.fullmatch(form, line + "\x00")
    assert time.process_time() - begun < 1.0
    again = classify.with_item(text, "DN")
    assert again is None or (";" in again) is (";" in text)


@given(st.text(max_size=40))
def test_nothing_that_can_be_typed_breaks_it(text):
    for each in (text, f"PR {text}", f'PR "{text}",P'):
        form = classify.print_form(each)
        assert form is None or re.compile(form)
        classify.with_item(each, "DN")


# --- signs


def party(signs=True, check=0) -> DriveState:
    return MCodeState(MCode(em=1, party=True, checksum=check, escape=1), "a", "a", signs=signs)


@pytest.mark.parametrize(
    ("text", "own", "other"),
    [
        ("PR P", b"aPR P,DN\n", b'aPR P,"~a"\n'),
        ('PR "v",R1', b'aPR "v",R1,DN\n', b'aPR "v",R1,"~a"\n'),
        ("PR P;", b"aPR P,DN;\n", b'aPR P,"~a";\n'),
        ("PR MV ST", b"aPR MV ST,DN\n", b'aPR MV ST,"~a"\n'),
        ('PR "Bex 1"', b'aPR "Bex 1"\n', b'aPR "Bex 1"\n'),  # it has no value, and may be meant for another drive
        ("PR 8", b"aPR 8\n", b"aPR 8\n"),
        ('PR "x', b'aPR "x\n', b'aPR "x\n'),
    ],
)
def test_values_are_signed_and_nothing_else_is(text, own, other):
    for signs, data in ((True, own), (False, other)):
        state = party(signs)
        request = signed(state, state.codec.request("a", text))
        assert state.codec.encode(request) == data
        assert request.text == text  # which is what a person is told of


def test_a_print_that_has_no_room_for_the_sign_is_sent_as_it_is():
    for check in (0, 1):
        state, room = party(check=check), 64 - len('aPR "",P') - check
        whole = state.codec.request("a", f'PR "{"x" * room}",P')
        assert signed(state, whole) == whole
        assert signed(state, state.codec.request("a", f'PR "{"x" * (room - 3)}",P')).signed


def test_a_drive_that_is_alone_signs_by_a_text():
    assert sign(MCodeState(MCode(), "", "!", signs=True)).item == '"~"'


@pytest.mark.wide
@pytest.mark.parametrize("text", ["PR R1", 'PR "v",R1', "PR R1;"])
@pytest.mark.parametrize(("em", "check"), [(em, check) for em in range(4) for check in range(3)])
def test_what_a_program_of_another_drive_prints_is_no_answer(bench, text, em, check):
    """It prints what looks like the answer, at every moment from before the question to behind the answer."""
    sealed = check and not text.endswith(";")  # a print without an end has no check byte
    for moment in range(0, 40, 3):
        desk = Desk(bench, (em, check), (em, check), party=True, baud=9600)
        for state in desk.knowns:
            state.signs = True
        desk.devices[0].execute("R1=77", desk.bench.now)
        begun, told = desk.bench.now + moment / 1000, []

        def talk(bench, begun=begun, told=told, desk=desk):
            if not told and bench.now >= begun:
                told.append(bench.now)
                for line in ("100", "v100", "tick 100"):
                    desk.devices[1].core.printer.announce(f"{line}\r\n")

        try:
            answer = desk.bench.run(MCodeFamily(desk.state).perform(text), desk.state, at=talk)
        except NoAnswer:
            continue  # the two collided, which without a checksum may also take a digit away
        assert "100" not in "".join(answer) and (answer in (("77",), ("v77",)) or not sealed), (moment, answer)


def test_one_that_is_deaf_to_its_name_is_not_believed(bench):
    """A flipped bit makes b's name of a's: b answers, and says so."""
    desk = Desk(bench, (1, 0), (1, 0), party=True)
    desk.devices[0].execute("R1=77", 0.5)
    desk.devices[1].execute("R1=88", 0.5)
    desk.state.signs = True
    receive = desk.bench.wire.receive
    desk.bench.wire.receive = lambda data, now: receive(data.replace(b"aPR", b"bPR"), now)
    with pytest.raises(NoAnswer):
        desk.type("PR R1")
    with pytest.raises(NoAnswer):
        desk.bench.run(MCodeFamily(desk.state).motion(0), desk.state)


@pytest.mark.parametrize(("em", "is_party", "check"), MODES)
def test_opening_sees_whether_a_drive_prints_its_name(bench, em, is_party, check):
    from multidrop.dialects import Hints

    desk = bench([{"name": "a" if is_party else "!", "party": is_party, "set": {"EM": em, "CK": check}}])
    hints = Hints(drives=("a",), party=True) if is_party else Hints()
    [state] = desk.run(MCodeFamily.identify(hints))
    assert state.signs
    assert desk.type(state, "PR P") == ("0",)
    assert (b"aPR P,DN" in desk.written[-1]) is is_party
