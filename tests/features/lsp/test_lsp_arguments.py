"""What `lsp` hands on to the language server, and says to a person and where its library is missing."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

from tests.support.cases import for_each
from tests.support.front_door import Called, Done, at_terminal


@for_each("words, closed, given, said", [
    ([], ["stdin"], ("LMDCM", None), ""),
    (["--personality", "MDI"], ["stdin"], ("MDI", None), ""),
    ([], [], ("LMDCM", None), "multidrop lsp speaks to an editor, which starts it; see docs/editors.md\n"),
    (["--tcp", "0"], [], ("LMDCM", ("127.0.0.1", 0)), ""),
])  # fmt: skip
def test_the_language_server_gets_its_arguments_and_a_person_is_told(
    tmp_path: Path, words: list[str], closed: list[str], given: tuple[Any, ...], said: str
) -> None:
    with pytest.MonkeyPatch.context() as patched:
        served = Called(1)
        patched.setattr("multidrop.features.lsp.serving.serve", served)
        assert at_terminal(tmp_path, "lsp", *words, closed=closed) == Done(1, "", said) and served.calls == [given]


class Without:
    """An installation whose language server lacks a module."""

    def __init__(self, missing: str) -> None:
        self._missing = missing

    def find_spec(self, name: str, *_: object) -> None:
        if name == "multidrop.features.lsp.serving":
            raise ModuleNotFoundError(f"No module named {self._missing!r}", name=self._missing)


@for_each("missing, hint", [("pygls", True), ("pygls.server", True), ("lsprotocol", True), ("attrs", False)])
def test_a_language_server_without_its_library_names_the_extra(tmp_path: Path, missing: str, hint: bool) -> None:
    with pytest.MonkeyPatch.context() as patched:
        patched.delitem(sys.modules, "multidrop.features.lsp.serving", raising=False)
        patched.setattr(sys, "meta_path", [Without(missing), *sys.meta_path])
        if not hint:
            with pytest.raises(ModuleNotFoundError, match="attrs"):
                at_terminal(tmp_path, "lsp")
            return
        said = "the language server needs pygls, which is not installed; pipx install 'multidrop[lsp]'\n"
        assert at_terminal(tmp_path, "lsp") == Done(2, "", said)
