"""The families of drives, a folder each: its manual, its host's side, and its simulated drives."""
