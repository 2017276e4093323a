"""Judges, one for each family of scorings; :mod:`uwbbench.measure.accuracy.judge` says which judges what."""
