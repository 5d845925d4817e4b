"""Cell files: their tables, read strictly, and what they describe."""
