"""A value that a drive does not print is not known: it neither fails as a defect nor counts as no."""

import pytest

from multidrop.base.errors import NoAnswer
from multidrop.dialects import End, Reply
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.operations import MCodeOperations
from multidrop.families.lexium.host.mcode.settings import MCodeParameters
from multidrop.families.lexium.host.mcode.state import MCodeState
from tests.support.procedure import ProcedureRunner


@pytest.mark.parametrize(
    "asked", [lambda state: MCodeOperations(state).status(), lambda state: MCodeParameters(state).ready()]
)
@pytest.mark.parametrize("em", [0, 1, 2, 3])
def test_values_that_do_not_come_are_no_answer(asked, em):
    runner = ProcedureRunner(asked(MCodeState(MCode(em=em, checksum=1, escape=1))))
    with pytest.raises(NoAnswer, match="does not reply"):
        while runner.request is not None:
            runner.answer(Reply(end=End.SILENT))
