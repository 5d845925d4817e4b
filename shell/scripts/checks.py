"""A comparison of values of drives that a script makes."""

from __future__ import annotations

from multidrop.shell.scripts.expression import Comparison, Word, evaluate, number, quoted, unknowns, written
from multidrop.shell.scripts.questions import converted, drive_of
from multidrop.shell.scripts.use import CheckFailed, Use


async def compare(use: Use, text: str) -> None:
    """Compare two values now. Raises CheckFailed where that does not hold."""
    heard, tree = use.heard, use.comparison(text)
    for word in (each for each in unknowns(tree) if isinstance(each, Word)):
        drive = drive_of(use.session, use.origin, word, use.place)
        heard.target = heard.target or (drive.link.name, drive.address)
    measured, checks = await converted(use.session, use.origin, tree, use.place)
    assert isinstance(measured, Comparison)
    tree, found = measured, await use.known(measured, checks)
    if evaluate(tree, found):
        return
    within = evaluate(tree.within, found)
    wanted = f"{tree.sign} {quoted(evaluate(tree.right, found))}" + (f" +- {written(within)}" if within else "")
    seen = quoted(evaluate(tree.left, found))
    units = (f" ({each.shown(number(found[word]))})" for word, each in checks.items())
    raise CheckFailed(f"{use.text}: wanted {wanted}, seen {seen}{''.join(units)}")
