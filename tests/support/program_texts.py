"""Program texts as they are while they are typed, for tests that nothing in a text breaks anything."""

from hypothesis import strategies as st

WORDS = st.sampled_from(
    ["LB G1", "VA Q1=5", "mr q1", "BR G1,Q1<3", "brg1", "vaq1", "PG 1", "PG", "E", "TI=1,G1", 'PR "Q1 \'', "' Q1", "H5",
     "PRG 0", "SUB 3", "GOSUB 3", "IF V1<3", "ELSE", "ENDIF", "XV1YV2", "X V1Y V2", "V1=V2+1", "; V1", "END",
     "WHILE V1=", "😀", "DN Q", "\t", " ", "\x85", "\u2028", "\x1a", "\ud800"]
)  # fmt: skip
TEXTS = st.lists(st.tuples(WORDS, st.sampled_from(["\n", "\r\n", "\r", " ", ""])), max_size=12).map(
    lambda parts: "".join(word + end for word, end in parts)
) | st.text(max_size=60)
