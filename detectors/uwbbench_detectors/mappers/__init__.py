"""Mappers: poses and maps from what the receivers of a robot find."""
