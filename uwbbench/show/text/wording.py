"""What tables are called where people read them."""

from __future__ import annotations

TABLES = {"filtering": "after filtering (range)", "mapping": "after mapping (position)"}
"""Names of the paper's two tables."""
