"""Frames of a moving radar added up, and what is read off the sums."""
