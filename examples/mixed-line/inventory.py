"""Prints each drive of the line, its product, and whether its settings can be read."""

from multidrop.script import session

for drive in session.drives:
    settings = drive.parameters.read()
    print(drive.name, drive.product, "read" if len(settings.values) > 20 else "not read")
