"""The verb that plots to rerun."""
