"""Mutants that nobody thought of: drawn by a seed from the product's own syntax tree, and tried against the tests.

`make mutants ROOM=drives N=100 SEED=7` draws, plants each in a copy of the tree, and runs what executes the changed
line: the tests (`tests_of`), the fast ones first, then seeds of the simulated life. What none of them sees is printed.
"""
