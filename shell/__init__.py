"""Everything that is open, and the one path a typed line takes to it: session, verbs, completion, scripts, prompt."""
