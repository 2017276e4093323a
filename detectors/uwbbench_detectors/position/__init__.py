"""From a delay and a phase to range, azimuth and place."""
