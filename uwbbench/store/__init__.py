"""Run folders: the only place where results are written, and where they are read back."""

from uwbbench.store.folder import RunFolder
from uwbbench.store.journal import Entry

__all__ = ["Entry", "RunFolder"]
