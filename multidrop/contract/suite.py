"""All tests of the suite in one class."""

from __future__ import annotations

from multidrop.contract.api import Api
from multidrop.contract.lines import Lines, Opening
from multidrop.contract.motion import Stopping


class FamilyContract(Opening, Lines, Stopping, Api):
    """What every family promises. A subclass has a `sample`."""
