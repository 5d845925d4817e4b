"""Scripts: lines with blocks, checks and calls, checked whole and then executed, with a report of each line."""
