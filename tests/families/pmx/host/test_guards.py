"""Which commands of a PMX need a person's yes."""

from multidrop.dialects.families import FAMILIES
from multidrop.families.pmx.host.codec import Pmx, PmxState

FAMILY = FAMILIES["pmx"]
ONE, EVERY = PmxState(Pmx(), "00"), PmxState(Pmx(), "*")


def named(state, text):
    found = FAMILY(state).guard(text)
    return found.name if found else ""


def test_what_is_kept_and_what_changes_the_address_is_guarded():
    for text, name in {
        "STORE": "STORE",
        " store ": "STORE",
        "@00STORE": "STORE",
        "@01DB=2": "DB",
        "DN=2ED07": "DN",
        "DB=2": "DB",
    }.items():
        for form in (text, text.lower()):
            assert named(ONE, form) == named(EVERY, form) == FAMILY.word_of(form.strip()) == name, form
    for text in ("DN", "DB", "X1000", "SR0=1", "HSPD=1000", "STOP", "SA0=5", "nonsense"):
        assert named(ONE, text) == "", text


def test_a_command_to_all_that_can_start_is_guarded_and_a_stop_is_not():
    for text in ("X1000", "JX+", "HX-", "SR0=1", "SR1=3", "EO=3", "SLX=1", "GS0", "nonsense"):
        assert named(EVERY, text) == "*", text
    for text in ("STOP", "STOPX", "ABORT", "SR0=0", "SR1=2", "EO=0", "SLX=0", "JF", "PX", "DN"):
        assert named(EVERY, text) == "", text
