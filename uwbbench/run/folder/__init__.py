"""Run folders: the only place where results are written, and where they are read back."""

from uwbbench.run.folder.folder import RunFolder
from uwbbench.run.folder.journal import Entry

__all__ = ["Entry", "RunFolder"]
