"""Every word of A-SCRIPT is understood by the simulated controller, within the values that the checks let through."""

from __future__ import annotations

from multidrop.families.pmx.manual.script_parser import WORDS, Word
from multidrop.families.pmx.simulator.device import PmxDevice
from multidrop.simulator.cell.spec import DriveSpec
from tests.support.cases import for_each

MOVING_ONLY = ("SSPDX", "SSPDY")
"""Taken during a motion only."""
HIGH = 5000
TAKEN = [(name, word) for name, word in WORDS.items() if name[0] != "V" and not name.startswith("SR")]


@for_each(("name", "word"), TAKEN)
def test_a_word_is_read_set_or_carried_out(name: str, word: Word) -> None:
    spec = DriveSpec(personality="PMX", name="00")
    controller = PmxDevice(spec).controller
    assert controller.ask("EO=3", 0.0) == "OK"
    if word.readable:
        assert int(controller.ask(word.ascii, 0.0)) >= 0
    if word.settable and name not in MOVING_ONLY:
        for value in (max(word.low, -HIGH), min(word.high, HIGH)):
            assert controller.ask(f"{word.ascii}={value}", 0.0) == "OK"
    if word.command:
        assert controller.ask(word.ascii, 0.0) == "OK"
