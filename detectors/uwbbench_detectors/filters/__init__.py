"""What keeps or drops detections: thresholds of one column, and selections within a frame."""
