"""Three people at three drives of one noisy party line, and a program that prints: what is told is true.

A sample of what was run at length (`tests/noisy_wire.py`): no value is told as another drive's, as an older one or as a
program's, and nothing is executed twice. Without a checksum a digit may be damaged, which nothing can tell.
"""

import pytest

from multidrop.simulator.cell.spec import Faults
from tests.support.noisy_wire import Crowd

NOISE = {
    "clean": Faults(),
    "noise": Faults(flip=5e-4, drop=5e-4, delay=(0.0, 0.01)),
    "late": Faults(delay=(0.0, 1.6)),
    "flips": Faults(flip=2e-3),
    "all": Faults(flip=5e-4, drop=5e-4, delay=(0.0, 1.4)),
}


@pytest.mark.wide
@pytest.mark.parametrize("noise", NOISE)
@pytest.mark.parametrize(("em", "check"), [(em, check) for em in range(4) for check in (0, 1, 2)])
def test_no_value_is_told_as_anothers_and_nothing_is_executed_twice(bench, em, check, noise):
    told = Crowd(bench, em, check, seed=1, faults=NOISE[noise]).run(12)
    assert told.misdeeds == []
    assert told.ends["done"] > 10
    if check:
        assert not told.wrong["damaged"]


def test_a_flipped_bit_in_a_drives_name_has_no_other_drive_answer_for_it(bench):
    told = Crowd(bench, 1, 0, 2, Faults(flip=2e-3), program=False).run(150)
    assert told.misdeeds == [] and told.ends["done"] > 350
