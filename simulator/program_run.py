"""What runs of a program file on a simulated drive, in virtual time, have in common: how long they last at most."""

LONGEST = 3600.0
"""Virtual seconds after which a run without a time of its own is given up."""
MOST_LINES = 20_000_000
"""Executed lines after which it is given up as well: a program that never waits, on a drive set up to be fast."""
SLICE = 1.0
"""Virtual seconds between two looks at what the drive has done: some thousand lines."""
