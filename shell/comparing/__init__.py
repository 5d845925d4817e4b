"""A drive beside a prediction of it: where the two differ, since when, and why that may be."""
