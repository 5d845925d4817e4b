"""Homes the table, turns it by degrees and prints its velocity and where it stands."""

from multidrop.script import session

table = session.drive("1")
table.home()
table.wait()
for angle in (90, 180, 0):
    table.move_to(angle, "deg")
    table.wait()
print("homed:", table.homed, "velocity:", table.read("maximum_velocity"), "position:", table.position)
