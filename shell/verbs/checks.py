"""The verb that checks a program file; it sends nothing."""

from __future__ import annotations

import asyncio

from multidrop.dialects import Diagnostic, Inexpressible
from multidrop.dialects.families import program_language_of
from multidrop.dialects.program_files import errors
from multidrop.shell.checking import examine
from multidrop.shell.verbs.registry import Call, as_typed, verb
from multidrop.simulator.families import PROGRAMS, TABLE


@verb("/check FILE [PERSONALITY]", recorded=as_typed, concurrent=True)
async def check(call: Call) -> None:
    """Find the errors in a program file, without sending anything.

    The file is checked for the selected drive's product, or for another personality (LMDCM, MDI ...).
    """
    file, *personality = call.words(1, 2)
    product = _product(call, file, personality[0].upper() if personality else "")
    checked = await asyncio.to_thread(examine, file, product)
    for each in checked.problems:
        call.workspace.notify(each.line_for(file), warning=True)
    if not checked.right:
        count = len(errors(checked.problems))
        raise Inexpressible(f"{file}: {count} error{'' if count == 1 else 's'} for {product}")
    call.workspace.output(f"{file}: {checked.facts}")


def _product(call: Call, file: str, wanted: str) -> str:
    """The product to check a file for: the wanted one, the selected drive's, or the default of the file's language."""
    language = program_language_of(file)
    valid = TABLE[language].personalities
    if wanted and wanted not in valid:
        raise Diagnostic(f"no personality {wanted}", call.verb.name, f"valid for {file}: {', '.join(valid)}")
    selected = call.workspace.selected
    own = selected.product if selected else ""
    return wanted or (own if own in valid else PROGRAMS[language].drive.personality)
