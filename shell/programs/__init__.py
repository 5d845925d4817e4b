"""Programs of drives: checked, edited, downloaded, listed, debugged."""
