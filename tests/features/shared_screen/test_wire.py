"""The wire of a shared screen as bytes: greetings, lines of items, and what is none of these."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

import multidrop
from multidrop.dialects.values import Conditions, Lamp, Pace
from multidrop.drives.events import Conditioned, Sample, Silent
from multidrop.drives.stopping import Fate
from multidrop.features.shared_screen.wire import (
    LONGEST_MESSAGE_LINE,
    GarbledMessage,
    Item,
    Items,
    Now,
    StopHeard,
    greeted,
    greeting,
    line,
    other_version,
)
from multidrop.shell.events import By, Entered, Phase, ProgramSeen
from multidrop.shell.stop_report import DriveFate

TYPES = (Sample, Conditioned, Silent, Entered, ProgramSeen, DriveFate, StopHeard, Now)
TEXTS = st.text('ab1 é\x1b\u2028\n"', max_size=12)
VALUES = st.one_of(
    st.builds(Sample, st.floats(), TEXTS, st.integers(), st.integers(), TEXTS, TEXTS, st.none() | st.booleans()),
    st.builds(
        Conditioned,
        st.floats(),
        TEXTS,
        st.tuples(
            st.builds(
                Conditions,
                axis=TEXTS,
                lamps=st.tuples(st.builds(Lamp, TEXTS, TEXTS, st.none() | st.booleans())),
                limits=st.none() | st.tuples(st.integers(), st.integers()),
                more=st.lists(st.tuples(TEXTS, TEXTS)).map(tuple),
                pace=st.none() | st.builds(Pace, *[st.floats()] * 4),
            )
        ),
    ),
    st.builds(Entered, st.floats(), TEXTS, st.sampled_from(By)),
    st.builds(ProgramSeen, st.floats(), TEXTS, TEXTS, st.none() | st.integers(), st.sampled_from(Phase)),
    st.builds(DriveFate, st.sampled_from(Fate), TEXTS, TEXTS),
    st.builds(StopHeard, st.integers()),
)
JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.sampled_from([*map(str, TYPES), "Sample", "DriveFate", ""]),
    lambda inner: st.lists(inner, max_size=8) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
)


def test_a_line_is_json_of_type_bus_and_fields() -> None:
    items = [Item(Sample(1.5, "a", 51200, -7, program=True), "press"), Item(StopHeard(2))]
    data = line(items)
    assert data == b'[["Sample","press",[1.5,"a",51200,-7,"","",true]],["StopHeard","",[2]]]\n'
    assert Items(TYPES).take(data) == items
    assert (
        line([Item(DriveFate(Fate.NOT_REACHED, "a", "press", "lost"))])
        == b'[["DriveFate","",["NOT_REACHED","a","press","lost"]]]\n'
    )


@given(st.lists(st.builds(Item, VALUES, TEXTS), max_size=5), st.integers(1, 50))
def test_items_arrive_as_they_were_sent_whatever_the_pieces(items: list[Item], size: int) -> None:
    data = line(items) + line([])
    parser, found = Items(TYPES), list[Item]()
    for begin in range(0, len(data), size):
        found += parser.take(data[begin : begin + size])
    assert line(found) == line(items)
    assert [type(each.value) for each in found] == [type(each.value) for each in items]


@given(st.binary(max_size=200) | JSON.map(lambda value: json.dumps([value]).encode() + b"\n"))
def test_anything_else_is_garbled_and_nothing_worse(data: bytes) -> None:
    try:
        found = Items(TYPES).take(data + b"\n")
    except GarbledMessage:
        return
    assert all(isinstance(each.value, TYPES) for each in found)


WRONG = (
    b"\xff\n",
    b"{}\n",
    b"[" * 100_000 + b"\n",
    b"[" + b"9" * 5000 + b"]\n",
    b'[["os","",[1]]]\n',
    b'[["StopHeard","",[true]]]\n',
    b'[["StopHeard","",["1"]]]\n',
    b'[["StopHeard","",[1,2]]]\n',
    b'[["StopHeard",null,[1]]]\n',
    b'[["DriveFate","",["GONE","a","b",""]]]\n',
    b'[["Sample","",{"at":1}]]\n',
    b"[" + b" " * LONGEST_MESSAGE_LINE,
)


def test_each_wrong_line_is_refused() -> None:
    for data in WRONG:
        with pytest.raises(GarbledMessage):
            Items(TYPES).take(data)


def test_passwords_do_not_leave() -> None:
    entered = Entered(1.0, "/open tcp://me:secret@10.0.0.5:503", By.OPERATOR)
    data = line([Item(entered), Item(Silent(1.0, "password = 'secret'"))])
    assert b"secret" not in data and b"tcp://***@10.0.0.5:503" in data


def test_a_greeting_has_version_and_name_and_another_version_is_refused_with_both() -> None:
    version, name = greeted(greeting())
    assert (version, other_version(version, "pc")) == (multidrop.__version__, "")
    assert "@" in name and greeting().startswith(b"multidrop-screen ")
    assert greeted(b"multidrop-screen 9.9 anna@\x1b[2J\n") == ("9.9", "anna@\\x1b[2J")
    told = other_version("9.9", "pc")
    assert told == f"pc is multidrop 9.9, this is {multidrop.__version__}; install one version on both sides"
    for wrong in (b"", b"SSH-2.0\n", b"multidrop-screen\n", b"multidrop-screen 1 " + b"a" * 300):
        with pytest.raises(GarbledMessage):
            greeted(wrong)
