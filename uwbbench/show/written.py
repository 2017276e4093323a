"""A report as files: the suffix decides the format, and nothing but an earlier report is replaced unasked."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

from uwbbench.api.errors import ConfigError

if TYPE_CHECKING:
    from uwbbench.results import Report


class Format(StrEnum):
    """What a report is written as."""

    HTML = "html"
    MARKDOWN = "md"
    CSV = "csv"
    LATEX = "latex"
    JSON = "json"


_SUFFIXES = {
    ".html": Format.HTML,
    ".htm": Format.HTML,
    ".md": Format.MARKDOWN,
    ".tex": Format.LATEX,
    ".json": Format.JSON,
}


def format_of(path: Path) -> Format:
    """Format that a file name asks for.

    Raises
    ------
    ConfigError
        If its suffix is that of no format; a folder of CSV tables has none.
    """
    form = _SUFFIXES.get(path.suffix.lower())
    if form is None:
        raise ConfigError(f"{path}: expected a name that ends in {', '.join(_SUFFIXES)}, or the format csv")
    return form


def as_text(report: Report, form: Format, roots: Sequence[Path]) -> str:
    """Report in a format that is one text: a page, Markdown or LaTeX.

    Parameters
    ----------
    report : Report
    form : {Format.HTML, Format.MARKDOWN, Format.LATEX}
    roots : sequence of Path
        Folders in which captures are looked for, to draw their samples on the page.

    Raises
    ------
    ReportToolsError
        If the libraries that a page needs are not installed.
    """
    from uwbbench.show.text import formats
    from uwbbench.show.text.report import markdown

    if form is Format.HTML:
        from uwbbench.show.page import Content, page

        return page(Content(report, roots))
    return markdown(report) if form is Format.MARKDOWN else formats.latex(report)


def write(report: Report, path: Path, form: Format, roots: Sequence[Path], *, force: bool = False) -> None:
    """Write a report.

    Parameters
    ----------
    report : Report
    path : Path
        File, or folder of CSV tables.
    form : Format
    roots : sequence of Path
        As in :func:`as_text`.
    force : bool
        Replace a file that is no report.

    Raises
    ------
    ReportToolsError
        If the libraries that a page needs are not installed.
    StoreError
        If something else is there, or it cannot be written.
    """
    from uwbbench.run.folder.files import write_json, write_text
    from uwbbench.show.text import formats

    formats.check_replaceable(path, force=force)
    if form is Format.CSV:
        formats.write_csv(report, path)
    elif form is Format.JSON:
        write_json(path, formats.as_json(report))
    else:
        write_text(path, as_text(report, form, roots))


def write_figures(report: Report, folder: Path, roots: Sequence[Path], *, force: bool = False) -> list[Path]:
    """Write every chart of a report as PNG, SVG and Vega-Lite.

    Parameters
    ----------
    report : Report
    folder : Path
    roots : sequence of Path
        As in :func:`as_text`.
    force : bool
        Write into a folder that holds other files.

    Returns
    -------
    list of Path
        The PNG files.

    Raises
    ------
    ReportToolsError
        If the libraries that draw are not installed.
    StoreError
        If something else is there, or a file cannot be written.
    """
    from uwbbench.show import page
    from uwbbench.show.text import formats

    formats.check_replaceable(folder, force=force)
    return page.write_figures(page.Content(report, roots), folder)


def write_into_run(report: Report, roots: Sequence[Path]) -> tuple[Path, str]:
    """Write ``report.md`` and ``report.html`` into the run folder; of a quick run only the first, to save time.

    Parameters
    ----------
    report : Report
    roots : sequence of Path
        As in :func:`as_text`.

    Returns
    -------
    path : Path
        The page, or ``report.md`` where a page cannot be made.
    missing : str
        Why there is no page; empty where there is one.
    """
    from uwbbench.show.extras import ReportToolsError
    from uwbbench.show.text.report import write_report

    path = write_report(report)
    if report.experiment.get("suite", {}).get("quick"):
        return path, f"no page of a quick run; 'uwbbench report {report.folder.path} -o report.html' writes one"
    try:
        return report.folder.write_text("report.html", as_text(report, Format.HTML, roots)), ""
    except ReportToolsError as error:
        return path, f"no report.html: {error}"
