"""Options that several commands share, so that they read and behave alike everywhere."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from uwbbench.api.errors import StoreError


class Scoring(StrEnum):
    """How detections are counted against the truth."""

    FRAME = "frame"
    PEAK = "peak"
    OBJECT = "object"
    LATEST = "latest"
    TRACK = "track"
    SEGMENT = "segment"
    PRESENCE = "presence"
    POSE = "pose"
    MAP = "map"


class Surface(StrEnum):
    """What the error of a position is the distance to."""

    OUTLINE = "outline"
    VISIBLE = "visible"


class Table(StrEnum):
    """Which errors, or which poses."""

    FILTERING = "filtering"
    MAPPING = "mapping"


CaptureFile = Annotated[Path, typer.Argument(metavar="CAPTURE", help="Capture file (.h5).", show_default=False)]
Detector = Annotated[
    str, typer.Option("--detector", "-d", metavar="NAME|FILE", help="Detector by name, or a YAML file.")
]
Receiver = Annotated[
    str | None, typer.Option(metavar="NAME", help="Receiver, where the capture has several.", show_default=False)
]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change one value, by its path; may be repeated."),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON for programs.")]
DataDir = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="Folder of measured recordings; else UWBBENCH_DATA.", show_default=False),
]


def format_of(target: Path, *allowed: str) -> str:
    """Suffix of a file to write, in lower case, as it decides the format.

    Raises
    ------
    StoreError
        If it is none of the allowed ones.
    """
    suffix = target.suffix.lower()
    if suffix not in allowed:
        raise StoreError(f"{target}: the suffix decides the format; expected {' or '.join(allowed)}")
    return suffix
