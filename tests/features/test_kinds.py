"""A function of a feature by others may raise anything: it is one line that names the feature, and the rest works."""

from __future__ import annotations

from pathlib import Path

import pytest

from multidrop.base.errors import Diagnostic
from tests.support import foreign_features as foreign
from tests.support.cell_session import bus, party, session_on
from tests.support.foreign_features import CALLS, NAMES, PLAIN

OTHERWISE = {
    "Operation.fits": "False",  # a verb that does not know where it is valid is not offered
    "Pictures.html": "None",  # the notebook shows the text, and the log of the program has the reason
}
AS_IT_IS = {("Operation.run", SystemExit)}
"""What passes: a command may end its own process."""
OF_A_PORT = {"Scheme.open": "slow://h:1: broken", "EndpointKind.open": "cannot serve slow://127.0.0.1:0 (broken)"}
"""What is said of an OSError, which these raise where a port cannot be opened."""


def test_every_kind_that_a_room_asks_for_is_in_the_table() -> None:
    assert foreign.kinds_asked_for() == {each.__name__ for each in PLAIN}


def test_every_function_of_every_kind_is_in_the_table() -> None:
    assert set(CALLS) == {(kind, name) for kind in PLAIN for name in foreign.functions_of(kind)}


@pytest.mark.virtual
@pytest.mark.parametrize(
    "failure", [KeyError("key"), SystemExit(3), KeyboardInterrupt(), Diagnostic("cannot be done"), OSError(5, "broken")]
)
async def test_what_a_function_raises_is_one_line_that_names_the_feature(
    failure: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(tmp_path))
    monkeypatch.setenv("MULTIDROP_STATE_DIR", str(tmp_path))

    def raising(*_: object, **__: object) -> None:
        raise failure

    wrong = {}
    async with session_on(tmp_path, bus("press", party("a"))) as session:
        for (kind, name), text in zip(CALLS, NAMES, strict=True):
            feature = foreign.add(monkeypatch, foreign.broken(kind, name, raising))
            try:
                said = await foreign.outcome(session, kind, name, feature)
            except BaseException as raised:
                if (text, type(raised)) not in AS_IT_IS:
                    wrong[text] = f"{type(raised).__name__}: {raised}"
                continue
            if text in OTHERWISE:
                right = said == OTHERWISE[text]
            elif isinstance(failure, OSError) and text in OF_A_PORT:
                right = OF_A_PORT[text] in said
            elif isinstance(failure, Diagnostic):
                right = "cannot be done" in said
            else:
                words = str(failure) if isinstance(failure, OSError) else type(failure).__name__
                right = "the feature x" in said and words in said
            if not right or "\n" in said:
                wrong[text] = said
        await session.run("@a PR P")
    assert not wrong
