"""Lists whose bytes come late: a list is whole, or the host says that it may not be."""

from dataclasses import replace

import pytest

from multidrop.dialects import End, NoAnswer
from multidrop.dialects.mcode.host.codec import MCode
from multidrop.dialects.mcode.host.exchange import fresh
from multidrop.dialects.mcode.host.state import MCodeState
from multidrop.simulator.cell.spec import Faults
from tests.support.mcode_drives import MODES, Desk

LINES = ["LB G1", "R1=R1+1", "E", "LB G2", "RT"]


@pytest.mark.parametrize(
    ("em", "reply"),
    [
        (0, b"L\r\n1  LB G1\r\n"),
        (0, b"L\r\n1  LB G1\r\n6  "),
        (0, b"L\r\n1  LB G1\r\n6  R1=R"),
        (1, b"\r\n1  LB G1\r\n6  R1=R"),
        (2, b"1  LB G1\r\n6"),
        (3, b"L\r\n1  LB G1\r\n6  R1"),
    ],
)
def test_a_list_does_not_end_before_its_prompt_nor_within_a_line(em, reply):
    codec = MCode(em)
    assert codec.on_quiet(codec.request("", "L"), reply) is None
    assert codec.on_timeout(codec.request("", "L"), reply).reply.end is End.DAMAGED


def test_an_address_alone_is_the_prompt_of_program_mode():
    codec = MCode(0)
    found = codec.on_quiet(codec.request("", "L"), b"L\r\n41  ")
    assert found is not None and found.reply.prompt == "41  "


@pytest.mark.parametrize("em", [1, 2, 3])
def test_lines_that_come_after_the_mark_was_sent_belong_to_the_list(em):
    state = MCodeState(MCode(em))
    own = fresh(state, "", party=False)
    request = state.codec.request("", f"PR {own.item}")
    request = replace(request, expect=own.shown, gather=True, signed=True)
    head = {1: "\r\n", 2: "", 3: f"PR {own.item}\r\n"}[em]
    reply = f"20  LB G2\r\n25  RT\r\n{head}{own.shown}\r\n".encode()
    found = state.codec.decode(request, reply)
    assert found is not None and found.reply.lines == ("20  LB G2", "25  RT", own.shown)


@pytest.mark.wide
@pytest.mark.parametrize(("em", "party", "check"), MODES)
def test_a_list_with_pauses_is_whole_or_said_to_be_incomplete(bench, em, party, check):
    whole = 0
    for seed in range(3):
        desk = Desk(bench, (em, check), party=party, baud=9600)
        for line in ("PG 1", *LINES, "PG"):
            desk.type(line)
        desk.bench.wire._faults = Faults(late=0.02, late_by=(0.01, 0.4))
        desk.bench.wire._rng.seed(seed)
        try:
            listed = desk.type("L")
        except NoAnswer:
            continue
        whole += 1
        assert [line.split(None, 1)[1] for line in listed] == LINES
    assert whole
