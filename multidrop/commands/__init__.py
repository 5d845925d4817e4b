"""The commands: one file per group. Each takes the parsed arguments and returns the exit code."""
