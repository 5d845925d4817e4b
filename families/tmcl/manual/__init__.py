"""What host and simulator share of TMCL: commands, parameters, status codes, grammar, help."""
