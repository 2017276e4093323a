"""Which detections are true, and the numbers made of it."""
