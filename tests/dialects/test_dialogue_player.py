"""The player of dialogues notices what a dialect does otherwise than it is written."""

from __future__ import annotations

from dataclasses import replace

import pytest

from multidrop.base.errors import Refused
from multidrop.families.pmx.host.codec import Pmx, PmxState
from multidrop.families.pmx.host.family import PmxFamily
from tests.support.dialogues import blocks, played, shown, written

TEXT = """\
== A position is read
$ it = PmxState(Pmx(), '00')
$ PmxFamily(it).perform('PX')
> 'PX' PRINT expect='(?![OK]*$).*' b'@00PX\\r'
< b'10\\r'
  DONE lines=('10') acknowledged=True
= ('10')

== Silence
$ it = PmxState(Pmx(), '00')
$ PmxFamily(it).perform('X5')
> 'X5' COMMAND expect='OK' b'@00X5\\r'
< nothing
  TIMEOUT
! NoAnswer: 00 does not reply: it is not known whether 'X5' was executed; it was sent once
* reply_pending: False, True
"""
NAMES = {"PmxFamily": PmxFamily, "PmxState": PmxState, "Pmx": Pmx, "Refused": Refused, "replace": replace}


def play(text):
    return written({title: played(block, NAMES) for title, block in blocks(text).items()})


def test_what_is_done_as_it_is_written_is_the_same_text():
    assert play(TEXT) == TEXT


@pytest.mark.parametrize(
    ("written_so", "is_so"),
    [
        ("'@01PX", "'@00PX"),
        ("= ('11')", "= ('10')"),
        ("DONE lines=('11')", "DONE lines=('10')"),
        ("'X5' PRINT", "'X5' COMMAND"),
        ("was sent twice", "was sent once"),
        ("* reply_pending: True, False", "* reply_pending: False, True"),
    ],
)
def test_each_difference_shows(written_so, is_so):
    assert play(TEXT.replace(is_so, written_so)) == TEXT


def test_a_request_that_is_not_written_gets_no_reply():
    short = "\n".join(line for line in TEXT.splitlines() if not line.startswith(("> 'PX'", "< b'10")))
    assert "NoAnswer: 00 does not reply: it is not known whether 'PX'" in play(short)


def test_another_reply_has_another_outcome():
    assert "= ('77')" in play(TEXT.replace("b'10\\r'", "b'77\\r'"))


def test_a_dataclass_shows_what_differs_from_its_defaults():
    assert shown(PmxState(Pmx(), "07", error=True)) == ("PmxState(codec=Pmx(addressed=True), address='07', error=True)")
    assert shown({"b": (1, "x"), "a": frozenset("zy")}) == "{'b': (1, 'x'), 'a': {'y', 'z'}}"
