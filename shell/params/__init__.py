"""Parameters between drives and files: backup, comparison, restore."""
