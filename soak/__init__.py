"""What is tried at length: noise, kills, long runs, the simulated life, drawn mutants, deleted features."""
