"""Classifiers of single frames: what, if anything, is in front of the radar."""
