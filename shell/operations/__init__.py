"""Every operation is declared here once: its verb with completion, its command with `--help`, where its work is."""
