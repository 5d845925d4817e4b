"""Runs without a screen: lines, scripts, replayed logs; reports and exit codes."""
