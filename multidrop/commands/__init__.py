"""The commands: one file per command group. Each takes the parsed arguments and returns the exit code."""
