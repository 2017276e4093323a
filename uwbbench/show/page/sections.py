"""The sections of a page in the order in which they are read: what the experiment asks first, then why, then the rest.

A new section is a function in :data:`SECTIONS`. It returns None where it has nothing to say, and is then not on the
page.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from uwbbench.api.text import counted
from uwbbench.measure.accuracy.rules import outcome_of
from uwbbench.results.verdicts import BOUNDS, INTERVALS, RUN_INTERVALS
from uwbbench.show.page import answer, error_sections, limits_section
from uwbbench.show.page.drives import drives
from uwbbench.show.page.limits_section import limits
from uwbbench.show.page.section import Section
from uwbbench.show.text.report import Tables
from uwbbench.show.text.sheet import sentence, shown
from uwbbench.show.text.wording import TRACK_ERRORS, set_aside_warning

if TYPE_CHECKING:
    from uwbbench.show.page.content import Content

Writer = Callable[["Content"], Section | None]


def sections(content: Content) -> list[Section]:
    """All sections that have something to say."""
    return [section for write in SECTIONS if (section := write(content)) is not None]


def summary(content: Content) -> Section:
    """What the run says in a sentence for each dataset, and how much it is made of."""
    report = content.report
    said = [*limits_section.sentences(content), *answer.sentences(content)]
    none = () if said else ("Nothing could be scored; the reasons are under Failed.",)
    flattered = (one for one in report.set_aside if content.leaders.get((one.dataset, one.source)) == one.detector)
    warnings = (*none, *map(set_aside_warning, flattered))
    return Section("summary", "Summary", sentences=tuple(said), warnings=warnings, notes=(_counts(content),))


def published(content: Content) -> Section | None:
    """Published figures beside this run's, and the difference."""
    sheets = tuple(Tables(content.report).published())
    return Section("published", "Published and here", sheets=sheets) if sheets else None


def reported(content: Content) -> Section | None:
    """What sources report of their methods, beside this run."""
    sheets = tuple(Tables(content.report).reported())
    return Section("reported", "Reported by source", sheets=sheets) if sheets else None


def paper_first(content: Content) -> Section | None:
    """The paper's tables where the run repeats all of them: they are what it was made for."""
    return _paper(content) if content.report.repeats_the_paper else None


def leaderboard(content: Content) -> Section | None:
    """All detectors on the chosen board."""
    if not content.boards:
        return None
    confidence = f"{content.report.experiment['intervals']['confidence']:.0%}"
    note = (
        f"Value, and below it its {confidence} interval. {INTERVALS} Errors are those of all retained detections; "
        "\u201cof matches\u201d counts true positives only: read it with recall. n/a: undefined. Times of a frame are "
        f"{content.report.timed}; absolute ones hold on one machine only, the ratio travels."
    )
    tracks = [TRACK_ERRORS] if any(board[2] == "track" for board in content.boards) else []
    runs = [RUN_INTERVALS] if any(outcome_of(board[2]).of_run for board in content.boards) else []
    bounds = [BOUNDS] if content.report.bounds else []
    return Section("leaderboard", "Leaderboard", layout="leaderboard", notes=(note, *tracks, *runs, *bounds))


def pareto(content: Content) -> Section | None:
    """Speed against the chosen metric."""
    if not content.boards or not any(content.speeds.values()):
        return None
    settings = content.report.experiment["intervals"]
    note = (
        "Across: time a frame in times of the reference detector, measured in alternating blocks. Up: the chosen "
        f"metric. Bars: {settings['confidence']:.0%} intervals. P: share of draws in which no other "
        "detector is both as fast and as good; values are drawn from their joint distribution over scenes, and time "
        "ratios from a log-normal distribution through their stored intervals. Detectors that find nothing are "
        "not drawn."
    )
    return Section("pareto", "Speed against error", of_board=("pareto",), notes=(note,))


def classes(content: Content) -> Section | None:
    """Which classes were taken for which."""
    sheets = tuple(Tables(content.report).classes())
    return Section("classes", "Classes", sheets=sheets) if sheets else None


def by_range(content: Content) -> Section | None:
    """The chosen metric against distance."""
    return Section("range", "Error by distance", of_board=("range",)) if _draws(content, "range") else None


def errors(content: Content) -> Section | None:
    """The distribution of all errors."""
    return Section("errors", "Distribution of errors", of_board=("errors",)) if _draws(content, "errors") else None


def looks(content: Content) -> Section | None:
    """The best and the worst capture of each dataset."""
    return Section("captures-seen", "Best and worst captures", layout="looks") if content.looks else None


def latency(content: Content) -> Section | None:
    """Times of calls."""
    sheets = tuple(Tables(content.report).latency())
    return Section("latency", "Latency", charts=tuple(content.timings), sheets=sheets) if sheets else None


def paper_later(content: Content) -> Section | None:
    """Scores by channel and material, where that is a detail."""
    return None if content.report.repeats_the_paper else _paper(content)


def stability(content: Content) -> Section | None:
    """Hard cases."""
    sheets = tuple(Tables(content.report).stability())
    return Section("stability", "Stability", sheets=sheets) if sheets else None


def compared(content: Content) -> Section | None:
    """What was compared on."""
    tables = Tables(content.report)
    sheets, each = tuple(tables.captures()), tuple(tables.each_capture())
    return Section("compared", "What was compared", sheets=sheets, folded=each) if sheets else None


def failed(content: Content) -> Section | None:
    """What did not run, and what could not be scored."""
    sheets = tuple(Tables(content.report).failed())
    return Section("failed", "Failed and not scored", sheets=sheets) if sheets else None


def notes(content: Content) -> Section | None:
    """What detectors and the journal want the reader to know."""
    said = tuple(sentence(note) for note in content.report.notes)
    return Section("notes", "Notes", notes=said) if said else None


def manifest(content: Content) -> Section:  # noqa: ARG001 - the template shows the manifest itself
    """How the run was made."""
    return Section("manifest", "Manifest", layout="manifest")


SECTIONS: tuple[Writer, ...] = (
    summary,
    published,
    limits,
    paper_first,
    leaderboard,
    reported,
    classes,
    pareto,
    by_range,
    errors,
    error_sections.causes,
    error_sections.curves,
    looks,
    drives,
    latency,
    paper_later,
    stability,
    failed,
    compared,
    notes,
    manifest,
)
"""In the order of the page."""


def _draws(content: Content, kind: str) -> bool:
    return any(spec is not None for of_board in content.board_charts[kind] for spec in of_board.values())


def _paper(content: Content) -> Section | None:
    sheets = tuple(Tables(content.report).paper()) if content.boards else ()
    return Section("paper", "By channel and material", sheets=sheets) if sheets else None


def _counts(content: Content) -> str:
    report = content.report
    captures = report.captures
    licences = sorted({shown(one["license"]) for one in captures})
    failures = f"{len(report.failures)} units failed" if report.failures else "no unit failed"
    return (
        f"{counted(len(report.detectors), 'detector')}, {counted(len(captures), 'capture')} in "
        f"{counted(len(content.datasets), 'dataset')} "
        f"(licence: {', '.join(licences) or 'none'}), {sum(one['frames'] for one in captures)} frames; {failures}."
    )
