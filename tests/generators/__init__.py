"""Generators of captures that share no code with the shipped simulator, to test what was chosen on the latter."""
