"""What tables are called where people read them, and what they are warned of."""

from __future__ import annotations

import math

from uwbbench.results.set_aside import SetAside
from uwbbench.show.text.numbers import number, significant
from uwbbench.show.text.sheet import shown

TABLES = {"filtering": "after filtering (range)", "mapping": "after mapping (position)"}
"""Names of the paper's two tables."""

_OF_RUNS = {
    ("pose", "filtering"): "as handed out on the way",
    ("pose", "mapping"): "smoothed",
    ("map", "filtering"): "at the end",
}


def table_name(scoring: str, table: str) -> str:
    """Name of a table of a scoring.

    Examples
    --------
    >>> table_name("object", "filtering"), table_name("pose", "mapping")
    ('after filtering (range)', 'smoothed')
    """
    return _OF_RUNS.get((scoring, table)) or TABLES[table]


ERRORS = "Errors are those of all retained detections; 'of matches' counts true positives only: read it with recall."
TRACK_ERRORS = "Errors of tracks are those where a track is matched with an object: read them with recall."
"""What the errors of a scoring are of."""


def set_aside_warning(one: SetAside) -> str:
    """What a reader must know of a detector most of whose detections its scoring did not look at."""
    text = (
        f"{shown(one.detector)}: {one.scoring} scoring looked at {one.judged} of its {one.found} detections and set "
        f"{one.share:.0%} aside ({significant(one.found / one.frames)} a frame were found)."
    )
    if math.isnan(one.precision):
        return f"{text} Its numbers say nothing about the others."
    return (
        f"{text} Judged by object, with all of them, its precision is {number(one.precision, 3)}, with "
        f"{significant(one.false_alarms_per_minute, 3)} false alarms a minute."
    )
