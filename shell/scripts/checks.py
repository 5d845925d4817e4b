"""A comparison of values of drives that a script makes."""

from __future__ import annotations

from multidrop.shell.scripts.expression import Comparison, DriveQuestion, evaluate, number, quoted, unknowns, written
from multidrop.shell.scripts.questions import converted, drive_of
from multidrop.shell.scripts.use import CheckFailed, LineUse


async def compare(use: LineUse, text: str) -> None:
    """Compare two values now. Raises CheckFailed where that does not hold."""
    heard, tree = use.heard, use.comparison(text)
    for word in (unknown for unknown in unknowns(tree) if isinstance(unknown, DriveQuestion)):
        drive = drive_of(use.session, use.origin, word, use.place)
        heard.target = heard.target or (drive.link.name, drive.address)
    measured, checks = await converted(use.session, use.origin, tree, use.place)
    assert isinstance(measured, Comparison)
    tree, value = measured, await use.known(measured, checks)
    if evaluate(tree, value):
        return
    within = evaluate(tree.within, value)
    wanted = f"{tree.sign} {quoted(evaluate(tree.right, value))}" + (f" +- {written(within)}" if within else "")
    seen = quoted(evaluate(tree.left, value))
    units = (f" ({check.shown(number(value[word]))})" for word, check in checks.items())
    raise CheckFailed(f"{use.text}: wanted {wanted}, seen {seen}{''.join(units)}")
