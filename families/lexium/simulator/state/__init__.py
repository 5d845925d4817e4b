"""The memory of a simulated drive, its virtual time, and the interpreter of its program."""
