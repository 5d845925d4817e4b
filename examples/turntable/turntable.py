"""Turns the table by degrees and prints its velocity and where it stands."""

from multidrop.script import session

table = session.drive("1")
for angle in (90, 180, 0):
    table.move_to(angle, "deg")
    table.wait()
print("velocity", *table.send("GAP 4, 0"), "position", table.position)
