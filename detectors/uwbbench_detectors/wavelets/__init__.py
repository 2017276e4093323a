"""Responses taken apart by wavelets."""
