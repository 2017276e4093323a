"""Recordings of real radars, one module a format."""
