"""A leaderboard of several runs as an object: its tables, and its site."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uwbbench.results.leaderboard import read_runs, suites
from uwbbench.run.folder.identity import plain
from uwbbench.show.site import Content, check_site, rendered, write_site
from uwbbench.tools.stored_run import Run

if TYPE_CHECKING:
    import pandas as pd

_BOARD = ("dataset", "source", "scoring", "table")
_STANDING = ("rank", "rank_high", "detector", "identity", "bound", "captures")


class Leaderboard:
    """Verified runs, put together: :func:`uwbbench.leaderboard` makes one.

    Parameters
    ----------
    content : Content
        What the site shows.
    """

    def __init__(self, content: Content) -> None:
        self.content = content

    @cached_property
    def files(self) -> Mapping[str, str]:
        """Text of each file of the site, by its address.

        Raises
        ------
        ReportToolsError
            If the libraries that make pages are not installed.
        """
        return rendered(self.content)

    @property
    def table(self) -> pd.DataFrame:
        """One row for each board and detector, best first.

        A board is a suite, dataset, source, scoring and table. ``rank`` is the smallest that a detector may have and
        ``rank_high`` the largest, as captures may not tell detectors apart. They are missing where a detector was not
        scored on all captures, and for a ``bound``, which only says what detectors can reach. Each metric has its value
        and the ends of its interval; ``time_ratio`` is relative to the suite's reference detector.
        """
        import pandas as pd

        rows = []
        for about, board in self._boards():
            for place in board["standings"]:
                row = {**about, **{key: place[key] for key in _STANDING}, "runs": ", ".join(place["runs"])}
                for name, estimate in place["estimates"].items():
                    row |= {name: estimate["value"], f"{name}_low": estimate["low"], f"{name}_high": estimate["high"]}
                ratio = place["time_ratio"] or {"reference": "", **dict.fromkeys(("ratio", "low", "high"), math.nan)}
                row |= {"time_ratio": ratio["ratio"], "reference": ratio["reference"]}
                row |= {"time_ratio_low": ratio["low"], "time_ratio_high": ratio["high"]}
                rows.append(row)
        return pd.DataFrame(rows).astype({"rank": "Int64", "rank_high": "Int64"}) if rows else pd.DataFrame()

    @property
    def pairs(self) -> pd.DataFrame:
        """One row for each two detectors of a board and each metric: difference, interval, adjusted p and verdict."""
        import pandas as pd

        rows = []
        for about, board in self._boards():
            for pair in board["pairs"]:
                names = {side: pair[side]["detector"] for side in ("first", "second")}
                rows.append({**about, **pair, **names})
        return pd.DataFrame(rows)

    def _boards(self) -> list[tuple[dict[str, Any], dict[str, Any]]]:
        return [
            ({"suite": suite["name"], "version": suite["version"][:12], **{key: board[key] for key in _BOARD}}, board)
            for suite in self.content.to_dict()["suites"]
            for board in suite["boards"]
        ]

    def to_dict(self) -> dict[str, Any]:
        """Everything as plain values, as the command prints it with ``--json``."""
        return dict(plain(self.content.to_dict()))

    def write(self, folder: str | Path) -> Path:
        """Write the site: static pages that open offline.

        Parameters
        ----------
        folder : str or Path
            New, empty, or made by this before.

        Returns
        -------
        Path
            Its first page.

        Raises
        ------
        StoreError
            If the folder holds something else, or a file cannot be written.
        ReportToolsError
            If the libraries that make pages are not installed.
        """
        target = Path(folder)
        check_site(target)
        write_site(target, self.files)
        return target / "index.html"

    def __repr__(self) -> str:
        names = ", ".join(dict.fromkeys(suite.name for suite in self.content.suites))
        return f"Leaderboard({len(self.content.runs)} runs of {names})"


def leaderboard(
    runs: Sequence[str | Path | Run],
    out: str | Path | None = None,
    *,
    progress: Callable[[str], None] | None = None,
) -> Leaderboard:
    """Put runs of several machines together, as the command ``leaderboard`` does.

    Every run is verified first. Runs are compared where experiment, content of captures and scoring rules agree; times
    only as ratios to the common reference detector.

    Parameters
    ----------
    runs : sequence of str, Path or Run
        Run folders.
    out : str or Path, optional
        Write the site there.
    progress : callable, optional
        Called with what is about to be done.

    Returns
    -------
    Leaderboard

    Raises
    ------
    Unverified
        If something in a run does not hold; nothing is written then.
    StoreError
        If a path is no run folder, two are the same run, or ``out`` holds something else.
    """
    if out is not None:
        check_site(Path(out))
    verified = read_runs([run.path if isinstance(run, Run) else Path(run) for run in runs], progress)
    board = Leaderboard(Content(suites(verified), verified))
    if out is not None:
        board.write(out)
    return board
