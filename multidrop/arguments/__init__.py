"""The arguments of each command, by groups of commands."""
