"""A radar that stands still: alignment on the first path, statistics of windows, difference from a background."""
