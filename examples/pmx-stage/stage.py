"""Homes both axes, visits places of the stage, both axes at a time, and prints where it stood."""

from multidrop.script import session

session.send("HSPD=5000")
x, y = session.drive("00", axis="x"), session.drive("00", axis="y")
for axis in (x, y):
    axis.home("-")
    axis.wait()
for place in ((1000, 0), (1000, 2000), (0, 0)):
    for axis, goal in zip((x, y), place, strict=True):
        axis.move_to(goal)
        axis.wait()
    print(x.position, y.position)
