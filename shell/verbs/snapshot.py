"""The verb for a snapshot of everything that is open."""

from __future__ import annotations

from multidrop.shell.verbs.registry import Call, as_typed, verb


@verb("/snapshot FILE", recorded=as_typed)
async def snapshot(call: Call) -> None:
    """Read every drive and write a new cell file, which the simulator opens as the same machine.

    Nothing moves. The file has identity, settings, variables, program, position and inputs of each drive.
    """
    from multidrop.shell import snapshots  # and with it the simulator, which no other verb needs

    (file,) = call.words(1, 1)
    await snapshots.save(call.workspace, call.output_file(file))
