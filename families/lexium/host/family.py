"""What Lexium drives have in common on the host's side, over whichever protocol: the words of MCode."""

from __future__ import annotations

from multidrop.dialects.family import Family
from multidrop.families.lexium.host import classify
from multidrop.families.lexium.manual import guards, points
from multidrop.families.lexium.manual.guards import CYBER_SECURITY


class LexiumFamily(Family):
    """A Lexium drive: its lines are those of MCode, also where its frames are those of Modbus."""

    protection = CYBER_SECURITY

    @classmethod
    def word_of(cls, text: str) -> str:
        return guards.word_of(text)

    @classmethod
    def only_ends(cls, text: str) -> bool:
        return guards.only_ends(text)

    @classmethod
    def only_reads(cls, text: str) -> bool:
        return guards.only_reads(text)

    @classmethod
    def question(cls, word: str) -> str | None:
        return f"PR {word}"

    @classmethod
    def move(cls, axis: str, distance: int | str) -> tuple[str, ...]:
        return points.move(axis, distance)

    @classmethod
    def move_to(cls, axis: str, position: int | str) -> tuple[str, ...]:
        return points.move_to(axis, position)

    @classmethod
    def assign(cls, word: str, value: str) -> str | None:
        return points.assign(word, value)

    @classmethod
    def vouched(cls, text: str, product: str) -> bool:
        return classify.vouched(text, product)
