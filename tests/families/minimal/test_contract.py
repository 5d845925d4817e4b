"""The least that a family must have, in the suite that all families pass: most of it says what it lacks."""

import pytest

from multidrop.contract import Absent, FamilyContract, FamilySample, Moved, Read, Wrong
from tests.support import knock
from tests.support.own_features import load


def listed(patch: pytest.MonkeyPatch) -> None:
    """List the family, as the entry point of an installed package does."""
    load(patch, knock.FAMILY)


class TestKnock(FamilyContract):
    sample = FamilySample(
        family="knock",
        drive='personality = "KNOCK"',
        addresses=("A", "B"),
        product="Knock",
        name="A",
        absent=Absent("C", "C: '\\?' was sent once: no reply"),
        reads=Read("?", "0 0"),
        reads_other=Read("GO 0", "0 0"),
        writes=None,
        refused=Wrong("JUMP", "{}: 'JUMP' was refused"),
        unsent=None,
        moves=Moved("GO 40", 40),
        far="GO 90000",
        ends=None,
        limit=None,
        starts=("GO 5", "JUMP"),
        harmless=("?",),
        stop=b"\r*HALT\r",
        word=None,
        state=None,
        scaled=None,
        turn="nothing tells how it counts",
        setting=None,
        program=None,
        traced=False,
        snapshot=False,
        scanned=False,
        guarded=None,
        help=None,
        completes=None,
        position=None,
        runs=None,
        homes=None,
        output=None,
        current=None,
        inputs=None,
        error=None,
    )

    @pytest.fixture(autouse=True)
    def _listed(self, monkeypatch: pytest.MonkeyPatch) -> None:
        listed(monkeypatch)
