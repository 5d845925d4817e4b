"""The fuzzer's targets: their seeds, their kept findings, and what hypothesis makes break none of them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fuzz.targets import TARGETS, seeds
from tests.support.examples import examples


def needed(name):
    """Skip a target whose feature is not there."""
    if name == "usb":
        pytest.importorskip("multidrop.features.usb")


@pytest.mark.parametrize("name", TARGETS)
def test_seeds_and_findings_break_nothing(name):
    needed(name)
    for data in seeds(name):
        TARGETS[name](data)


@pytest.mark.parametrize("name", ["decode", "line", "port", "modbus_port", "usb", "typed", "program"])
def test_changed_seeds_break_nothing(name):
    needed(name)

    @examples(15, 2000)
    @given(st.data())
    def holds(data):
        seed = bytearray(data.draw(st.sampled_from(seeds(name))))
        for _ in range(data.draw(st.integers(0, 4))):
            at = data.draw(st.integers(0, len(seed)))
            seed[at : at + data.draw(st.integers(0, 3))] = data.draw(st.binary(max_size=4))
        TARGETS[name](bytes(seed))

    holds()
