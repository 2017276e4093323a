"""Tracks: what belongs together from frame to frame."""
