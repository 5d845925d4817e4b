"""An Ethernet drive over Modbus takes what a program asks of any family."""

from __future__ import annotations

from pathlib import Path

import pytest

import multidrop
from multidrop import Limits, MotionFailed, Timeout
from tests.support.cell_session import bus

DRIVE = """personality = "LMDCE"
set = { VM = 100000, IS = ["1,1,0", "2,3,0", "3,2,0"] }
world = { home = -2000, limit_minus = -40000, limit_plus = 20000 }
"""


@pytest.mark.slow
def test_modbus_takes_the_same_calls(tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text(bus("eth", DRIVE, baud=0))
    with (
        multidrop.simulate(tmp_path / "cell.toml", speed=20) as cell,
        multidrop.connect(cell.url("eth", "modbus")) as session,
    ):
        a = session.drive()
        a.home("-")
        a.wait()
        assert a.homed and a.error is None
        a.disable()
        assert a.read("DE") == 0
        a.enable()
        a.set_output(1, True)
        assert a.inputs == {1: False, 2: False, 3: False, 4: False, "home": False, "lim-": False, "lim+": False}
        assert a.limits == Limits(False, False, None)
        a.run_at(10000)
        a.wait_for("P>=0")
        with pytest.raises(Timeout, match=r"^wait_for P=-9: .* still reports"):
            a.wait_for("P=-9", timeout=0.05)
        with pytest.raises(MotionFailed, match="error 83: plus limit reached"):
            a.wait()
        assert a.limits.plus and a.error is None and a.read_error() is None  # read for the reason, and cleared by that
