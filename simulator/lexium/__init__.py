"""Lexium."""
