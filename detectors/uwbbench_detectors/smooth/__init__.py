"""Smoothing: of energy along the taps, of ranges along the frames."""
