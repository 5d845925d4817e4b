"""The reply that is read at once is the reply that the parser finds."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.dialects import Kind
from multidrop.dialects.mcode.host.codec import MCode, only_strays, short_reply
from multidrop.dialects.mcode.host.reply_parser import ReplyParser

PIECES = st.sampled_from(
    [
        b"\r\n",
        b"\n",
        b"\r",
        b"5",
        b"-51200",
        b'12"a"0',
        b">",
        b"?",
        b"Copyright 2010 Schneider",
        b"\x06",
        b"\x15",
        b"x y",
    ]
)
BUFFERS = st.lists(PIECES, max_size=5).map(b"".join)
ASKED = ["PR P", "PR P,DN,V", 'PR "x y"', "PR AL", "PR S1", "MR 5", "VM=5", "L", 'PR "Copyright"']


@given(buffer=BUFFERS, em=st.sampled_from([1, 2]), text=st.sampled_from(ASKED), gather=st.booleans())
def test_it_is_what_the_parser_finds(buffer, em, text, gather):
    codec = MCode(em=em)
    request = codec.request("", text)
    request = replace(request, gather=gather, expect=request.expect if gather else request.expect or ".*")
    found = short_reply(request, buffer)
    assert found is None or found == ReplyParser(request, em, 0, text.encode(), buffer).whole()


@given(buffer=BUFFERS, em=st.sampled_from([1, 2]), text=st.sampled_from(ASKED), gather=st.booleans())
def test_among_strays_only_the_parser_finds_no_reply(buffer, em, text, gather):
    request = replace(MCode(em=em).request("", text), gather=gather)
    if only_strays(request, buffer):
        assert ReplyParser(request, em, 0, text.encode(), buffer).whole() is None


def test_a_flood_of_prints_is_known_to_hold_no_reply():
    request = MCode(em=1).request("", "PR P")
    flood = b"".join(b"tick %d\r\n" % n for n in range(100))
    assert only_strays(request, flood + b"51200")
    assert not only_strays(request, flood + b"51200\r\n")
    assert not only_strays(request, flood + b"tick\r51200\r\n"), "a lost line feed"


@pytest.mark.parametrize("buffer", [b"\r\n51200\r\n", b"51200\r\n"])
def test_a_plain_print_is_read_at_once(buffer):
    request = MCode(em=1).request("", "PR P")
    assert request.kind is Kind.PRINT
    found = short_reply(request, buffer)
    assert found is not None and found.reply.lines == ("51200",) and found.used == len(buffer)


@pytest.mark.parametrize("buffer", [b"", b"\r\n", b"51200", b"51200\r", b"\r\n\r\n5\r\n", b"5\r\n6\r\n", b"ten\r\n"])
def test_anything_else_is_left_to_the_parser(buffer):
    assert short_reply(MCode(em=1).request("", "PR P"), buffer) is None
