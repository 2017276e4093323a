"""Simulated captures: a scene, the terms it names, and the engine that adds them up."""
