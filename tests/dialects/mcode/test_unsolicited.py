"""Lines that no request asked for, cut out of a buffer all at once."""

from hypothesis import given
from hypothesis import strategies as st

from multidrop.dialects.mcode.host.framing import pieces, printable, unasked

BYTES = st.text(alphabet="ab>?\r\n\x06\x15\xe9 ", max_size=40).map(lambda text: text.encode("latin-1"))


@given(BYTES, st.sampled_from([0, 1, 2, 3]))
def test_lines_taken_at_once_are_those_taken_piece_by_piece(buffer, echo):
    used, lines = 0, []
    for piece in pieces(buffer, 0, acknowledged=False):
        prompt = echo == 0 and piece.shown[:1] in (b">", b"?")
        if piece.what == "rest" and not (prompt and len(piece.shown) == 1):
            break
        used = piece.end
        lines.append(printable(piece.data)[1 if prompt else 0 :])
    assert unasked(buffer, echo, 0) == (tuple(filter(None, lines)), used)


def test_a_thousand_lines_are_taken_at_once():
    text = "".join(f"{n}\r\n" for n in range(1000)) + "half"
    assert unasked(text.encode(), 1, 0) == (tuple(map(str, range(1000))), len(text) - 4)
