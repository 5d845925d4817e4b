"""The verbs: lines that begin with a slash."""
