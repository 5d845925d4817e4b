"""The values and roles of a macro that is to be played: as given, else asked for where there is a person."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from functools import partial

from multidrop.base.errors import Diagnostic
from multidrop.macros import Macro, checked_values, is_role, missing
from multidrop.macros.model import written
from multidrop.shell.channel import AskedValue
from multidrop.shell.workspace import Workspace


async def settled(
    workspace: Workspace, macro: Macro, given: Mapping[str, str]
) -> tuple[dict[str, str], dict[str, str]]:
    """The text of each value of a macro, and an open bus for each role.

    `given` names values, and roles with the name of a bus. What is missing is asked for, if there is a person. Raises
    Diagnostic for what is wrong or missing; nothing was sent then.
    """
    roles = {name: bus for name, bus in given.items() if name in macro.roles}
    values = {name: value for name, value in given.items() if name not in macro.roles}
    for role, bus in roles.items():
        check_bus(workspace, macro, role, bus)
    for role in macro.roles:
        if role not in roles and (bus := only_bus(workspace, macro, role)):
            roles[role] = bus
    buses, fields = tuple(workspace.buses), []
    for role in macro.roles:
        if role not in roles:
            take = partial(check_bus, workspace, macro, role)
            fields.append(AskedValue(role, f"an open bus: {' or '.join(buses)}", None, take, buses))
    if not fields or workspace.front.fill is not None:
        examples = {parameter.name: parameter.example for parameter in missing(macro, values)}
        checked_values(macro, {**examples, **values})  # what is given is right
    if (fields or missing(macro, values)) and workspace.front.fill is not None:
        fields += value_fields(macro, values)
        answers = await workspace.questions.fill_in(f"macro {macro.name}", fields)
        roles |= {name: text for name, text in answers.items() if name in macro.roles}
        values |= {name: text for name, text in answers.items() if name not in macro.roles}
    elif fields:
        raise unbound(workspace, macro, fields[0].name)
    if hides := workspace.macros.hides(macro.name):
        workspace.notify(hides, warning=True)
    for role, bus in roles.items():
        if role != bus:
            workspace.notify(f"macro {macro.name}: {role} is {bus}")
    return checked_values(macro, values), roles


def value_fields(macro: Macro, given: Mapping[str, str]) -> list[AskedValue]:
    """The values of a macro that are not given, as a form asks for them."""
    where = f"macro {macro.name}"
    return [
        AskedValue(
            parameter.name,
            parameter.valid,
            None if parameter.default is None else written(parameter.default),
            partial(parameter.take, where=where),
            parameter.choices,
        )
        for parameter in macro.parameters
        if parameter.name not in given
    ]


def only_bus(workspace: Workspace, macro: Macro, role: str) -> str:
    """The bus of a role that needs no question: the one of that name, or the only one for the only role."""
    if role in workspace.buses:
        return role
    return next(iter(workspace.buses)) if len(workspace.buses) == len(macro.roles) == 1 else ""


def check_bus(workspace: Workspace, macro: Macro, role: str, bus: str) -> None:
    """Raise Diagnostic for a role of a bus that is not open, and of another bus than the open one of that name."""
    if role in workspace.buses and bus != role:
        hint = f"leave {role}={bus} out, or /close {role}"
        raise Diagnostic(f"role {role} cannot be {bus}: a bus {role} is open", f"macro {macro.name}", hint)
    if bus not in workspace.buses:
        hint = f"open: {', '.join(workspace.buses)}" if workspace.buses else "nothing is open"
        raise Diagnostic(f"no bus {bus} for the role {role}", f"macro {macro.name}", hint)


def unbound(workspace: Workspace, macro: Macro, role: str) -> Diagnostic:
    """The failure of a role without a bus."""
    hint = f"--role {role}=URL opens one; /play {macro.name} {role}=BUS takes an open one"
    return Diagnostic(f"no bus for the role {role}", f"macro {macro.name}", hint)


# The recording that is not ended


def roles_in(macro: Macro, buses: list[str]) -> tuple[str, ...]:
    """The buses that its lines name, if several are open: names for next year's buses."""
    if len(buses) < 2:
        return ()
    named = {bus: re.compile(rf"(?<![\w:/.-]){re.escape(bus)}:") for bus in buses if is_role(bus)}
    return tuple(bus for bus, place in named.items() if any(map(place.search, macro.lines)))


def keep_unended(workspace: Workspace) -> str:
    """Save a recording that was not ended under a name that no macro has; return what was done, in one line."""
    recorder, store = workspace.recorder, workspace.macros
    if not recorder.name:
        return ""
    try:
        macro = recorder.macro()
    except Diagnostic as problem:
        return f"the recording was not ended; {problem}"
    try:
        name = macro.name if store.contents(macro.name) is None else store.free_name(macro.name)
        path = store.save(replace(macro, name=name, roles=roles_in(macro, list(workspace.buses))))
    except Diagnostic as problem:
        return f"the recording was not ended, and is lost: {problem}"
    finally:
        recorder.discard()
    return f"the recording {macro.name} was not ended: {macro.length} kept in {path}"
