"""The table of a TMCL module in a cell file: wrong keys get one line that names them."""

import pytest

from multidrop.dialects import Diagnostic
from multidrop.simulator.cells import read

CELL = '[[bus]]\nname = "slide"\n[[bus.drive]]\npersonality = "TMCM"\n'


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("set = { 04 = 5 }", 'set: "04" is not a parameter'),
        ('set = { 4 = 5, "04" = 6 }', 'set: "04" is not a parameter'),
        ("set = { G075 = 5 }", 'set: "G075" is not a parameter'),
        ("set = { 3 = 1 }", 'set: "3" is not a parameter'),
        ("set = { G66 = 3 }", 'set: "G66" is not a parameter'),
        ("set = { 4 = -1 }", 'set: "4" cannot be -1; valid: 0 to 8388607'),
        ("set = { G75 = 5, g75 = 6 }", 'set: "g75" is given twice'),
        ('name = "01"', 'name cannot be "01"; valid: the address of a module, 1 to 255'),
        ('name = "256"', 'name cannot be "256"; valid: the address of a module, 1 to 255'),
        ("party = true", "party is for MCode drives"),
        ("world = { inputs = [] }", 'unknown key "inputs"'),
    ],
)
def test_a_wrong_key_is_named(line, message):
    with pytest.raises(Diagnostic) as caught:
        read(CELL + line + "\n", "cell.toml")
    text = str(caught.value)
    assert message in text and text.startswith("cell.toml") and "\n" not in text
