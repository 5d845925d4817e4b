"""The judge and its rules. They read records, and know neither acts nor the world."""
