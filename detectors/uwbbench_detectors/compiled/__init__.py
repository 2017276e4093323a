"""Runs of stages compiled into one search of a frame."""
