"""Moves the beam in three steps and prints how far its two sides were apart."""

from multidrop.script import session

left, right = session.drive("a"), session.drive("b")
apart = []
for place in (20, 40, 0):
    for side in (left, right):
        side.move_to(place, "mm")
    for side in (left, right):
        side.wait()
    apart.append(abs(left.position - right.position))
print("largest difference:", max(apart), "steps")
