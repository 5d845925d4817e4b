"""Everything that is open, and the one path of a typed line: workspace, verbs, session, prompt, scripts."""
