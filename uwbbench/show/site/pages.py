"""The pages of a site: an index, one for each dataset, one for each detector, and one about the runs."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from uwbbench.measure.accuracy.boards import EQUAL_CONFIDENCE, RANKED_UNITS, SIGNIFICANCE
from uwbbench.measure.accuracy.intervals import INNER_UNITS
from uwbbench.results.leaderboard.ranking import SETTINGS, speeds_by_machine
from uwbbench.results.leaderboard.suites import Contender, Suite
from uwbbench.results.times import WORDS as TIMED
from uwbbench.results.verdicts import BOUNDS, INTERVALS, WORDS
from uwbbench.show.html.cell import Cell, Table
from uwbbench.show.html.render import badge
from uwbbench.show.site.cells import metric_cell, pair_cell, quantity, rank_cell
from uwbbench.show.site.content import Content, Section
from uwbbench.show.site.halves import halves_shown
from uwbbench.show.site.matrix import CSV, matrix
from uwbbench.show.text.numbers import interval, number, p_value
from uwbbench.show.text.sheet import sentence, shown
from uwbbench.show.text.wording import table_name


@dataclass(frozen=True)
class Part:
    """A section of a page.

    Attributes
    ----------
    title : str
    sentences, notes : tuple of str
        Above and below the rest.
    facts : tuple of (str, str)
    charts : tuple of (str, str)
        SVG, and what it says in words.
    tables : tuple of Table
    folded : tuple of Table
        Tables that are opened on demand.
    download : str
        Address of the first table as a file; where there is one, the table has a filter.
    text : str
        Shown as it is, opened on demand.
    link : (str, str)
        Address and text of where there is more; empty if nowhere.
    """

    title: str
    sentences: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    facts: tuple[tuple[str, str], ...] = ()
    charts: tuple[tuple[str, str], ...] = ()
    tables: tuple[Table, ...] = ()
    folded: tuple[Table, ...] = ()
    download: str = ""
    text: str = ""
    link: tuple[str, str] = ("", "")


@dataclass(frozen=True)
class Page:
    """A page before it is HTML.

    Attributes
    ----------
    address : str
        Seen from the root of the site.
    title, badge, lead : str
        The badge says whether captures are measured or simulated.
    parts : tuple of Part
    """

    address: str
    title: str
    badge: str
    lead: str
    parts: tuple[Part, ...]

    @property
    def root(self) -> str:
        """From this page to the root of the site."""
        return "../" * self.address.count("/")


HOW = (
    "Rank: a set, such as 1-3: one more than the number of detectors that are better by more than chance (adjusted p "
    f"below {SIGNIFICANCE:g}) and more than the margin, up to all but those that are worse. Below {RANKED_UNITS} "
    "scenes nobody is ranked.",
    f"Practically equal: the whole {EQUAL_CONFIDENCE:.0%} interval of the difference lies within the metric's margin, "
    f"from {INNER_UNITS} scenes on. Not told apart: the scenes do not decide.",
    f"Pairs are compared on the captures that both were scored on. Brackets: {SETTINGS['confidence']:.0%} intervals. "
    + INTERVALS,
    "Time is only given as a ratio to the common reference detector, measured in alternating blocks on one machine. "
    "Over several machines: geometric mean, and the interval from the lowest end to the highest.",
)


def pages(content: Content) -> Iterator[Page]:
    """All pages of a site."""
    yield _index(content)
    for section in content.sections:
        yield _dataset(content, section)
    seen = set()
    for suite in content.suites:
        for contender in suite.contenders:
            if contender.key not in seen:
                seen.add(contender.key)
                yield _detector(content, contender)
    yield _runs(content)


def _index(content: Content) -> Page:
    parts = []
    if content.sections:
        parts.append(Part("All detectors on all datasets", tables=(matrix(content),), download=CSV))
    parts += [Part(title, (text,), tables=(table,)) for title, text, table in halves_shown(content)]
    for suite in content.suites:
        sections = content.of_suite(suite)
        name = content.names.suite(suite)
        if not sections:
            parts.append(
                Part(name, sentences=("Nothing could be scored; the pages of its detectors and runs say why.",))
            )
        for place, section in enumerate(sections):
            chart = content.pareto(section, section.main.main)
            none = "No chart: no detector was both timed against the reference and scored on all captures."
            parts.append(
                Part(
                    title=f"{name}: {section.title}",
                    sentences=(content.sentence(section),),
                    facts=tuple(content.suite_facts(suite)) if place == 0 else (),
                    charts=() if chart is None else (chart,),
                    notes=(none,) if chart is None else (),
                    tables=(content.board(section.main, headline=True),),
                    link=(section.address, "All scorings, captures and comparisons"),
                )
            )
    detectors = len(content.names.detectors)
    lead = f"{detectors} detectors in {len(content.runs)} consistent runs. "
    lead += "Only what was measured on the same captures under the same scoring rules is compared."
    parts.append(Part("How to read it", notes=(*HOW, *_margins(content.sections))))
    return Page("index.html", "Leaderboard", badge({one.source for one in content.sections}), lead, tuple(parts))


def _margins(sections: Sequence[Section]) -> Iterator[str]:
    """Differences that do not matter, of each metric that is compared."""
    margins = {}
    for section in sections:
        for pair in section.main.pairs:
            by = quantity(section.main, pair.metric)
            margins[by.title] = by.text(section.main.metrics[pair.metric].margin)
    if margins:
        yield f"Margins: {', '.join(f'{title} {margin}' for title, margin in margins.items())}."


def _dataset(content: Content, section: Section) -> Page:
    suite = section.suite
    main = section.main
    charted = (main.main, *main.metrics.error(exhaustive=main.exhaustive))
    drawn = [content.pareto(section, name) for name in charted] + [content.errors(section)]
    first = Part(
        title="Speed and error",
        sentences=(content.sentence(section),),
        charts=tuple(chart for chart in drawn if chart is not None),
    )
    boards = [
        Part(
            title=f"{ranking.board[2]} scoring, {table_name(ranking.board[2], ranking.board[3])}",
            tables=(content.board(ranking),),
            folded=(content.pairs(ranking),),
        )
        for ranking in section.rankings
    ]
    facts = Part("What was compared", facts=tuple(content.suite_facts(suite)), tables=(_captures(section),))
    lead = f"Dataset of {content.names.suite(suite)}."
    explained = Part("Causes of errors, and every threshold", charts=content.causes_and_curves(section))
    parts = (
        first,
        *boards,
        *([explained] if explained.charts else []),
        facts,
        Part("How to read it", notes=(*HOW, *_margins([section]))),
    )
    return Page(section.address, section.label, badge({section.source}), lead, parts)


def _captures(section: Section) -> Table:
    """Captures with licence and content; one that nobody could open is listed too."""
    rows = []
    for capture in section.suite.captures_of(section.dataset):
        sha256 = section.suite.captures[section.dataset, capture]
        header = _header(section, capture)
        about = (
            ["n/a"] * 5
            if header is None
            else [
                str(len(header)),
                "none" if header.radar.channel is None else str(header.radar.channel),
                sentence(header.license),
                sentence(header.citation),
                sentence(header.description),
            ]
        )
        rows.append(tuple(Cell(text) for text in (shown(capture), *about, sha256[:12] or "not opened by any run")))
    columns = ("capture", "frames", "channel", "licence", "citation", "description", "content")
    return Table("Captures", columns, tuple(rows))


def _header(section: Section, capture: str) -> Any:
    for contender in section.suite.contenders:
        run, entry = contender.chosen.get((section.dataset, capture), (None, None))
        if run is not None and entry is not None and entry.status == "done":
            return run.folder.header(entry.capture_id)
    return None


# Detectors -----------------------------------------------------------------------------------------------------


def _detector(content: Content, contender: Contender) -> Page:
    mine = [(suite, one) for suite in content.suites for one in suite.contenders if one.key == contender.key]
    sections = [section for section in content.sections if any(suite is section.suite for suite, _ in mine)]
    label = content.names.detectors[contender.key]
    said = (BOUNDS,) if contender.bound else ()
    parts = [
        Part("Results", tables=(_results(content, contender, sections),)),
        Part("Against the others", notes=said, tables=tuple(_others(content, contender, () if said else sections))),
        Part(
            "Time",
            tables=(_times(content, mine),),
            notes=(
                "The ratio to the reference travels between machines; the median time holds on its own machine only.",
            ),
        ),
        Part("What did not work", tables=(_failures(mine),), notes=tuple(_notes(mine))),
        Part("Detector", facts=tuple(_facts(mine)), text=json.dumps(contender.config, indent=2, ensure_ascii=False)),
    ]
    others = [
        content.names.detectors[one.key]
        for suite in content.suites
        for one in suite.contenders
        if one.name == contender.name and one.key != contender.key
    ]
    versions = f" Other versions of the same name: {', '.join(dict.fromkeys(others))}." if others else ""
    lead = f"Identity {contender.identity[:12]}: steps, parameters and sources.{versions}"
    return Page(content.names.detector_page(contender), label, badge({s.source for s in sections}), lead, tuple(parts))


def _results(content: Content, contender: Contender, sections: list[Section]) -> Table:
    quantities = {
        name: quantity(section.main, name)
        for section in sections
        for name in section.main.metrics.defined(exhaustive=True)
    }
    rows = []
    for section in sections:
        for ranking in section.rankings:
            for one in ranking.standings:
                if one.contender.key != contender.key:
                    continue
                about = [
                    Cell(section.title, link=section.address),
                    Cell(content.names.suite(section.suite)),
                    Cell(f"{ranking.board[2]}, after {ranking.board[3]}"),
                    replace(rank_cell(one), title=f"of {len(ranking.standings) - len(ranking.ranks.bounds)}"),
                ]
                captures = Cell(f"{len(one.scored)} of {ranking.captures}")
                cells = [
                    metric_cell(by, one.estimates[name]) if name in one.estimates else Cell("–", key="n/a")
                    for name, by in quantities.items()
                ]
                rows.append((*about, *cells, captures))
    columns = ("dataset", "suite", "scoring", "rank", *(by.axis for by in quantities.values()), "captures")
    return Table("On each dataset", columns, tuple(rows))


def _others(content: Content, contender: Contender, sections: Sequence[Section]) -> Iterator[Table]:
    """Comparisons with all others on the first board of each dataset."""
    for section in sections:
        ranking = section.main
        rows = []
        for one in ranking.standings:
            for name in ranking.headline:
                pair = ranking.pair(contender.key, one.contender.key, name)
                if pair is None:
                    continue
                word = WORDS[pair.verdict]
                if pair.better is not None:
                    word = "better" if pair.better == contender.key else "worse"
                cells = (
                    Cell(quantity(ranking, name).title),
                    pair_cell(ranking, pair),
                    Cell(p_value(pair.adjusted)),
                    Cell(word),
                )
                rows.append((content.detector_cell(one), *cells, Cell(str(pair.captures))))
        columns = ("other detector", "metric", "difference: this one minus the other", "adjusted p", "this one is")
        yield Table(f"{section.title}, {ranking.board[2]} scoring", (*columns, "captures"), tuple(rows))


def _times(content: Content, mine: list[tuple[Suite, Contender]]) -> Table:
    rows = []
    for suite, contender in mine:
        for dataset in suite.datasets:
            for machine, speed in speeds_by_machine(suite, contender, dataset).items():
                ratio = interval(speed.ratio, speed.low, speed.high, 3)
                about: tuple[str, ...] = (
                    sentence(machine),
                    content.names.suite(suite),
                    shown(dataset),
                    shown(speed.reference),
                )
                about += (TIMED[speed.timed],)
                times = (
                    Cell(ratio, key=f"{speed.ratio:.6g}"),
                    Cell(number(speed.p50_us, 0)),
                    Cell(str(speed.captures)),
                )
                rows.append((*map(Cell, about), *times))
    columns = ("machine", "suite", "dataset", "reference", "times are", "time ratio", "median of a frame (us)")
    return Table("On each machine", (*columns, "timed captures (n)"), tuple(rows))


def _failures(mine: list[tuple[Suite, Contender]]) -> Table:
    """Captures on which it failed, and scorings that were impossible, with reasons."""
    rows = []
    for suite, contender in mine:
        for run, entry in contender.chosen.values():
            reasons = [entry.reason] if entry.status == "failed" else []
            reasons += [f"{row['scoring']}: {row['reason']}" for row in entry.scores if row["status"] == "unscored"]
            about = (suite.name, entry.dataset, entry.capture, run.name)
            rows += [tuple(Cell(sentence(text)) for text in (*about, reason)) for reason in reasons]
    return Table("Failed or not scored", ("suite", "dataset", "capture", "run", "reason"), tuple(rows))


def _notes(mine: list[tuple[Suite, Contender]]) -> Iterator[str]:
    for _, contender in mine:
        yield from (sentence(text) for text in contender.disagreements)
        hard = contender.stability
        if hard is not None and "refused" in hard:
            yield f"It refuses the capture of the hard cases: {sentence(hard['refused'])}"
        elif hard is not None:
            yield (
                f"Hard cases (SIMULATED): {hard['passed']} passed, {hard['failed']} failed, "
                f"{hard['not_applicable']} not applicable."
            )


def _facts(mine: list[tuple[Suite, Contender]]) -> Iterator[tuple[str, str]]:
    contender = mine[0][1]
    newest = contender.runs[-1]
    yield "name", sentence(contender.name)
    yield "identity", contender.identity
    yield "fidelity", str(contender.config["fidelity"])
    yield "runs", ", ".join(dict.fromkeys(shown(run.name) for _, one in mine for run in one.runs))
    for use in dict.fromkeys(step["use"] for step in contender.config["pipeline"]):
        yield f"source of {shown(use)}", newest.manifest["sources"][use][:12]


# Runs ----------------------------------------------------------------------------------------------------------


def _runs(content: Content) -> Page:
    rows = []
    for run in content.runs:
        suite = next(suite for suite in content.suites if run in suite.runs)
        failed = sum(entry.status == "failed" for entry in run.entries)
        versions = run.manifest["sessions"][-1]["versions"]
        checked = ", ".join(f"{count} {what}" for what, count in run.checked.items())
        cells = (
            shown(run.name),
            content.names.suite(suite),
            run.started,
            "; ".join(sentence(machine) for machine in run.machines),
            f"uwbbench {shown(versions['uwbbench'])}, numpy {shown(versions['numpy'])}",
            str(len(run.manifest["detectors"])),
            f"{len(run.entries) - failed} done, {failed} failed",
            checked,
        )
        rows.append(tuple(map(Cell, cells)))
    columns = ("run", "suite", "started", "machine", "versions", "detectors", "units", "checked")
    failures = [
        tuple(Cell(sentence(text)) for text in (run.name, entry.kind, entry.detector, entry.dataset, entry.reason))
        for run in content.runs
        for entry in run.entries
        if entry.status == "failed" and entry.kind != "accuracy"
    ]
    kinds = ("run", "what", "detector", "dataset", "reason")
    parts = (
        Part("Runs", tables=(Table("Runs", columns, tuple(rows)),)),
        Part("What could not be listed, timed or examined", tables=(Table("Failures", kinds, tuple(failures)),)),
    )
    lead = (
        "Every run is consistent: files have their hashes, names and identities are those of the manifest, and scores "
        "follow from the stored detections. Detections themselves are taken as they are: that is no proof of them."
    )
    return Page("runs.html", "Runs", badge({one.source for one in content.sections}), lead, parts)
