"""Noise floor, profile, peaks of it, their score, and places between taps."""
