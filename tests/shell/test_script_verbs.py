"""Help on the verbs that only scripts have, and suggestions for them."""

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.dialects.families import FAMILIES
from multidrop.shell.operations.table import VERBS, find, script_verbs
from multidrop.shell.verbs.explaining import described, explained, overview


@pytest.mark.parametrize("name", script_verbs())
def test_a_script_verb_has_help_with_and_without_its_slash(name: str) -> None:
    usage, meaning = script_verbs()[name].usage, script_verbs()[name].help
    assert usage.split()[0] == name and name not in VERBS and not meaning.endswith(".")
    assert described(name)[0] == usage and meaning[1:] in described(name)[1]
    assert described(name.upper()) == described(name)
    if not FAMILIES["mcode"].language.knows(name[1:]):
        assert explained(name[1:], FAMILIES["mcode"].language) == described(name)
    assert any(line.startswith(usage) for line in overview())


@pytest.mark.parametrize(
    ("typed", "similar"), [("asert", "/assert"), ("/asert", "/assert"), ("/hlep", "/help"), ("/untl", "/until")]
)
def test_a_word_like_a_script_verb_is_answered_with_that(typed: str, similar: str) -> None:
    with pytest.raises(Diagnostic) as caught:
        described(typed)
    assert similar in caught.value.hint
    if typed.startswith("/"):
        with pytest.raises(Diagnostic) as caught:
            find(typed)
        assert similar in caught.value.hint
