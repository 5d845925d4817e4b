"""The prompt: its keys, what it shows, and the lines that are typed there or piped in."""
