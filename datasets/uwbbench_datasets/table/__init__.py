"""Tables of any kind, read by a mapping."""
