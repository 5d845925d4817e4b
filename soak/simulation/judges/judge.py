"""The judge: rules that hold in every history, each with a name, a sentence, and the place that promises it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from soak.simulation.judges.departures import DEPARTURES
from soak.simulation.judges.noted import NOTED
from soak.simulation.judges.outcomes import OUTCOMES
from soak.simulation.judges.promises import PROMISES
from soak.simulation.judges.rule import Lived, Rule
from soak.simulation.judges.stops import STOPS

RULES = (*OUTCOMES, *PROMISES, *DEPARTURES, *STOPS, *NOTED)


@dataclass
class Judgement:
    """The breaches of one history, and the number of those that each grant excepts."""

    breaches: list[tuple[Rule, str]] = field(default_factory=list)
    granted: Counter[str] = field(default_factory=Counter)

    @property
    def rules(self) -> list[str]:
        """The names of the rules that broke, each once."""
        return list(dict.fromkeys(rule.name for rule, _ in self.breaches))


def judged(life: Lived) -> Judgement:
    """Judge a history by every rule."""
    judgement = Judgement()
    for rule in RULES:
        wrong = (each.words for each in life.history.told.facts if each.rule == rule.name and not each.holds)
        for found in (*wrong, *rule.check(life)):
            if isinstance(found, str):
                judgement.breaches.append((rule, found))
            else:
                assert found.grant in rule.grants, f"{rule.name} has no grant {found.grant.name!r}"
                judgement.granted[f"{rule.name}, but for {found.grant.name}"] += 1
    return judgement


def broken(life: Lived) -> list[tuple[Rule, str]]:
    """Every breach."""
    return judged(life).breaches
