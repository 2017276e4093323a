"""Intervals of range that hold an obstacle: runs of taps in place of single peaks."""
