"""A report in formats for other programs: CSV tables, LaTeX, JSON; and never over a file that is no report.

Conventions
-----------
* Text files say in their first line that they are a report of uwbbench; only such files are replaced without being
  asked.
* CSV holds whole numbers of significant digits in SI units, as the names of the columns say. ``nan`` is undefined, an
  empty cell was not measured. A text that a spreadsheet would take for a formula gets an apostrophe in front.
* LaTeX tables are those of the Markdown report, for ``booktabs``, with every special character escaped.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from uwbbench.api.errors import StoreError
from uwbbench.api.text import one_line
from uwbbench.results.report import Report, facts_of
from uwbbench.run.folder.files import write_json, write_text
from uwbbench.run.folder.identity import plain
from uwbbench.show.extras import report_tools
from uwbbench.show.text.report import sheets
from uwbbench.show.text.sheet import Sheet

MARK = "uwbbench report"
INDEX = "tables.json"
"""File that distinguishes a folder of CSV tables from any other folder."""

_LATEX = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "$": r"\$",
    "&": r"\&",
    "#": r"\#",
    "%": r"\%",
    "_": r"\_",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': r"\textquotedbl{}",
    "`": r"\textasciigrave{}",
}


def check_replaceable(path: Path, *, force: bool) -> None:
    """Refuse to write over a file or folder that is no report.

    Raises
    ------
    StoreError
        If there is one, unless forced. A folder is never replaced by a file, nor a file by a folder.
    """
    if not path.exists() or force:
        return
    if path.is_dir():
        ours = (path / INDEX).is_file() or not any(path.iterdir())
    else:
        with path.open("rb") as file:
            ours = MARK.encode() in file.read(4096)
    if not ours:
        raise StoreError(f"{path}: exists and is no report of uwbbench; give another name, or --force to replace it")


def write_csv(report: Report, folder: Path) -> None:
    """Write every table into a folder, one file each, with an index.

    Raises
    ------
    StoreError
        If a file cannot be written.
    """
    written = {}
    for name, rows in _csv_tables(report).items():
        write_text(folder / f"{name}.csv", _csv(rows))
        written[name] = len(rows)
    write_json(folder / INDEX, {"generator": MARK, "experiment": report.experiment["name"], "rows": written})


def _csv_tables(report: Report) -> dict[str, list[dict[str, Any]]]:
    leaderboard: list[dict[str, Any]] = report.leaderboard.to_dict("records")  # type: ignore[assignment]
    for row in leaderboard:
        if math.isnan(row["p50_us"]):  # not undefined: not measured
            row |= {"p50_us": None, "p99_us": None}
    stability = [{key: value for key, value in one.items() if key != "cases"} for one in report.stability]
    keys = ("kind", "detector", "dataset", "capture", "reason")
    return {
        "leaderboard": leaderboard,
        "causes": _cause_rows(report),
        "curves": _curve_rows(report),
        "paper_tables": report.paper_tables.to_dict("records"),  # type: ignore[dict-item]
        "latency": report.latency.drop(columns=["notes"], errors="ignore").to_dict("records"),  # type: ignore[dict-item]
        "captures": report.captures,
        "stability": stability,
        "failures": [{key: getattr(entry, key) for key in keys} for entry in report.failures],
        "unscored": [
            {**facts_of(entry), "scoring": scoring, "reason": reason} for entry, scoring, reason in report.unscored
        ],
    }


def _cause_rows(report: Report) -> list[dict[str, Any]]:
    """One row for each cause of each detector on each board."""
    rows = []
    for one in report.causes:
        about = {key: value for key, value in one.to_dict().items() if key not in ("causes", "set_aside")}
        rows += [{**about, **vars(cost), "f1": one.f1, "f1_without": cost.f1} for cost in one.costs]
    return rows


def _curve_rows(report: Report) -> list[dict[str, Any]]:
    """One row for each detector on each dataset; its whole curve is in the JSON."""
    rows = []
    for (dataset, source, detector), curve in report.curves.items():
        row: dict[str, Any] = {"dataset": dataset, "source": source, "detector": detector, "order": curve.order}
        intervals = {"average_precision": curve.average_precision}
        intervals |= {f"{name}_as_set": one for name, one in curve.setting.items()}
        for name, one in intervals.items():
            row |= {name: float(one.value), f"{name}_low": float(one.low), f"{name}_high": float(one.high)}
        rows.append({**row, "captures": curve.captures, "scenes": curve.scenes})
    return rows


def _csv(rows: Sequence[Mapping[str, Any]]) -> str:
    columns = list(dict.fromkeys(name for row in rows for name in row))
    cells = [[_cell(row.get(name)) for name in columns] for row in rows]
    return str(pd.DataFrame(cells, columns=columns).to_csv(index=False, lineterminator="\n"))


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.9g}"
    return csv_text(str(value))


def csv_text(text: str) -> str:
    """Text that no spreadsheet takes for a formula: an apostrophe goes before what could start one.

    Examples
    --------
    >>> csv_text("=1+1"), csv_text("paper")
    ("'=1+1", 'paper')
    """
    return f"'{text}" if text[:1] in ("=", "+", "-", "@", "\t", "\r") else text


def latex(report: Report) -> str:
    """Every table for LaTeX; the preamble needs ``booktabs``, ``textcomp`` and T1 fonts.

    Raises
    ------
    ReportToolsError
        If Jinja2, which pandas writes tables with, is not installed.
    """
    with report_tools():
        tables = [_latex_table(sheet) for sheet in sheets(report)]
    return "\n".join((f"% {MARK}; needs \\usepackage{{booktabs}} and \\usepackage[T1]{{fontenc}}", *tables, ""))


def _latex_table(sheet: Sheet) -> str:
    empty = ("None.", *[""] * (len(sheet.columns) - 1))
    rows = [[latex_escaped(cell) for cell in row] for row in sheet.rows or (empty,)]
    table = pd.DataFrame(rows, columns=[latex_escaped(name) for name in sheet.columns])
    # Escaped here: pandas lets quotes, ligatures and brackets behind a line break through.
    tabular = table.to_latex(index=False, escape=False, column_format=f"l{'r' * (len(sheet.columns) - 1)}")
    notes = [rf"\par\footnotesize {latex_escaped(note)}" for note in sheet.notes]
    head = (r"\begin{table*}", r"\centering\small", rf"\caption{{{latex_escaped(sheet.title)}}}")
    return "\n".join((*head, tabular.rstrip(), *notes, r"\end{table*}", ""))


def latex_escaped(text: str) -> str:
    r"""Text that LaTeX shows as it is, on one line.

    Examples
    --------
    >>> print(latex_escaped("50 % of a_b -- [x]"))
    50 \% of a\_b -{}- [x]
    """
    line = "".join(_LATEX.get(char, char) for char in one_line(text)).replace("--", "-{}-")
    return f"{{}}{line}" if line[:1] in ("[", "*") else line  # behind a line break these would be its options


def as_json(report: Report) -> dict[str, Any]:
    """Whole report as plain values, undefined numbers as None."""
    values: dict[str, Any] = plain({"generator": MARK, **report.to_dict()})
    return values
