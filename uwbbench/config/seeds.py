"""Secret seeds: captures of the same scenes that nobody could tune to.

Conventions
-----------
* A seed file holds one random number of 256 bits as 64 hexadecimal digits. Only its owner may read it.
* Each dataset that has a parameter ``seed`` gets one of 128 bits, SHA-256 of the number and the dataset's label: too
  long to be found by trying, from whatever a run leaves.
* What a run stores of a seed file is its hash, also SHA-256. It reveals nothing of the number, as that is random.
"""

from __future__ import annotations

import hashlib
import os
import re
import secrets
import stat
from dataclasses import dataclass, field
from pathlib import Path

from uwbbench.api.errors import ConfigError, StoreError

HIDDEN = "(secret seed)"
"""What stands for a seed in messages of plugins."""


@dataclass(frozen=True)
class Seeds:
    """The seeds of a private half.

    Parameters
    ----------
    number : bytes
        The 32 bytes that all seeds follow from.
    """

    number: bytes = field(repr=False)

    @property
    def sha256(self) -> str:
        """Hash by which runs with the same seeds are known."""
        return hashlib.sha256(b"uwbbench seeds" + self.number).hexdigest()

    def of(self, label: str) -> int:
        """Seed of the dataset of a label."""
        return int.from_bytes(hashlib.sha256(b"uwbbench dataset" + self.number + label.encode()).digest()[:16])


def read_seeds(path: Path) -> Seeds:
    """Read a seed file.

    Raises
    ------
    ConfigError
        If it cannot be read, holds something else, or others than its owner may read or write it.
    """
    try:
        with path.open("rb") as file:
            mode = stat.S_IMODE(os.fstat(file.fileno()).st_mode)
            if mode & 0o077:
                raise ConfigError(
                    f"{path}: others may read this seed file (mode {mode:04o}), so its seeds are not secret: make a "
                    f"new one by 'uwbbench seeds FILE', or, if nobody has read it, 'chmod 600 {path}'"
                )
            text = file.read(4096).decode("ascii", "replace").strip()
    except OSError as error:
        raise ConfigError(f"{path}: the seed file cannot be read: {error.strerror or error}") from error
    if not re.fullmatch(r"[0-9a-f]{64}", text):
        raise ConfigError(f"{path}: expected 64 hexadecimal digits, as 'uwbbench seeds FILE' writes them")
    return Seeds(bytes.fromhex(text))


def write_seeds(path: Path) -> Seeds:
    """Draw new seeds, and write them into a file that only its owner may read.

    Raises
    ------
    StoreError
        If there is a file already, or it cannot be written.
    """
    number = secrets.token_bytes(32)
    try:
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="ascii") as file:
            file.write(f"{number.hex()}\n")
    except FileExistsError:
        raise StoreError(f"{path}: already exists; seeds are never replaced, as they cannot be had back") from None
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror or error}") from error
    return Seeds(number)
