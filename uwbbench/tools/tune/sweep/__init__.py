"""Threshold sweeps: the peaks of a capture are described once, then any number of threshold sets is evaluated.

A filter looks at one peak at a time, so it does not matter which of them comes first: a detector without the filters
whose thresholds are swept, and without the selection behind them, finds all peaks that any threshold set could retain.
What each set retains follows from their columns alone, and equals what the detector finds with these thresholds.
"""
