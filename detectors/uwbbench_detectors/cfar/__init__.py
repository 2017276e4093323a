"""Thresholds of constant false-alarm rate."""
