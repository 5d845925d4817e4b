"""The suite that every family of drives passes, those of the wheel and those of other packages (docs/new-family.md).

A test file of a family says what is particular to it, and gets every test:

    from multidrop.contract import FamilyContract, FamilySample

    class TestZaber(FamilyContract):
        sample = FamilySample(family="zaber", ...)

It opens simulated drives of the family in virtual time and goes through the front doors: a session, the command line,
the Python API. It needs pytest alone (`pip install multidrop[pytest]`).
"""

from __future__ import annotations

import pytest

pytest.register_assert_rewrite(
    *(f"{__name__}.{each}" for each in ("desk", "lines", "motion", "settings", "api", "suite"))
)

from multidrop.contract.sample import (  # noqa: E402
    Absent,
    Error,
    FamilySample,
    Homed,
    Moved,
    Program,
    Ran,
    Read,
    Scaled,
    Setting,
    Written,
    Wrong,
)
from multidrop.contract.suite import FamilyContract  # noqa: E402

__all__ = [
    "Absent",
    "Error",
    "FamilyContract",
    "FamilySample",
    "Homed",
    "Moved",
    "Program",
    "Ran",
    "Read",
    "Scaled",
    "Setting",
    "Written",
    "Wrong",
]
