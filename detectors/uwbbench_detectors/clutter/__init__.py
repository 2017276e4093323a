"""Backgrounds, estimated and subtracted."""
