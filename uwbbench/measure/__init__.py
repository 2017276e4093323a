"""What a detector is worth: accuracy, latency, robustness."""
