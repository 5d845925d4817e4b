"""Prints each drive of the line with its language and its settings, as an acceptance report needs them."""

from multidrop.script import session

for drive in session.drives:
    settings = drive.parameters.read()
    print(drive.name, drive.product, len(settings.values) > 20)
