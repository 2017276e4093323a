"""Detectors of this package, as YAML."""
