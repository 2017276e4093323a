"""A report as tables of text, as Markdown, and as a file in its run folder."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from uwbbench.api.text import counted, one_line
from uwbbench.measure.accuracy.evidence import LEAST_RUNS
from uwbbench.measure.accuracy.intervals import INNER_UNITS, failing_share
from uwbbench.measure.accuracy.metrics.choice import MetricChoice
from uwbbench.results.report import Report
from uwbbench.results.times import ROWS
from uwbbench.results.verdicts import BOUNDS, RUN_INTERVALS, WITHIN, rank_text
from uwbbench.show.text.captures_sheets import captures_sheet, each_capture_sheet
from uwbbench.show.text.class_sheets import class_sheets
from uwbbench.show.text.error_sheets import cause_sheets, curve_sheets, main_causes
from uwbbench.show.text.limits_sheets import limits_sheets
from uwbbench.show.text.numbers import between, interval, number, time_us
from uwbbench.show.text.paper_sheets import paper_sheets, published_sheets
from uwbbench.show.text.quantity import Quantity, undefined_titles
from uwbbench.show.text.reported_sheets import reported_sheets
from uwbbench.show.text.sheet import Sheet, escaped, sentence, shown
from uwbbench.show.text.wording import ERRORS, TRACK_ERRORS, set_aside_warning, table_name


def sheets(report: Report) -> list[Sheet]:
    """All tables of a report: leaderboards, the paper's tables, times, and what did not work."""
    tables = Tables(report)
    parts = (
        tables.published,
        tables.limits,
        tables.leaderboards,
        tables.reported,
        tables.classes,
        tables.causes,
        tables.curves,
        tables.paper,
        tables.latency,
        tables.stability,
        tables.captures,
        tables.failed,
    )
    return [sheet for part in parts for sheet in part()]


class Tables:
    """The tables of a report by what they are about; one that would be empty is left out.

    Parameters
    ----------
    report : Report
    """

    def __init__(self, report: Report) -> None:
        self._report = report

    def published(self) -> Iterator[Sheet]:
        """Published figures beside this run's, where it covers the rows of the paper."""
        return self._labelled(published_sheets(self._report))

    def reported(self) -> Iterator[Sheet]:
        """What sources report of their methods, where any detector here is after one that does."""
        return self._labelled(reported_sheets(self._report))

    def classes(self) -> Iterator[Sheet]:
        """Which classes were taken for which, where detectors tell classes apart."""
        return self._labelled(class_sheets(self._report))

    def leaderboards(self) -> Iterator[Sheet]:
        """One for each dataset, scoring and table; test signals have tables of their own, and no leader."""
        signals = self._report.limits.datasets
        rows = [row for row in self._report.estimates if row[0]["dataset"] not in signals]
        return self._labelled(_leaderboards(self._report, rows))

    def causes(self) -> Iterator[Sheet]:
        """What each cause of errors costs, on one board of each dataset."""
        known = [one for one in self._report.causes if one.board[0] not in self._report.limits.datasets]
        return self._labelled(cause_sheets(main_causes(known)))

    def curves(self) -> Iterator[Sheet]:
        """Detectors without their thresholds."""
        every = self._report.curves
        return self._labelled(
            curve_sheets({k: v for k, v in every.items() if k[0] not in self._report.limits.datasets})
        )

    def paper(self) -> Iterator[Sheet]:
        """The two tables of arXiv 2512.01018."""
        return self._labelled(paper_sheets(self._report))

    def limits(self) -> Iterator[Sheet]:
        """Detectors against physical limits, where the run has test signals."""
        return self._labelled(limits_sheets(self._report.limits))

    def latency(self) -> Iterator[Sheet]:
        """Times of every detector and timed capture."""
        if not self._report.latency.empty:
            yield _latency(self._report)

    def stability(self) -> Iterator[Sheet]:
        """Results of the detectors in the hard cases."""
        if self._report.stability:
            yield _stability(self._report)

    def captures(self) -> Iterator[Sheet]:
        """What was compared on, with licence: one row for captures of the same description."""
        if self._report.captures:
            yield captures_sheet(self._report.captures)

    def each_capture(self) -> Iterator[Sheet]:
        """Every capture with what distinguishes it from those of the same description."""
        if self._report.captures:
            yield each_capture_sheet(self._report.captures)

    def failed(self) -> Iterator[Sheet]:
        """What did not run, and what could not be scored, with reasons."""
        if self._report.failures:
            failed = tuple(
                (str(e.kind), shown(e.detector), shown(e.dataset), shown(e.capture), sentence(e.reason))
                for e in self._report.failures
            )
            yield from self._labelled([Sheet("Failed", ("what", "detector", "dataset", "capture", "reason"), failed)])
        if self._report.unscored:
            rows = tuple(
                (shown(e.detector), shown(e.capture), scoring, sentence(reason))
                for e, scoring, reason in self._report.unscored
            )
            yield from self._labelled([Sheet("Not scored", ("detector", "capture", "scoring", "reason"), rows)])

    def _labelled(self, tables: Iterable[Sheet]) -> Iterator[Sheet]:
        """Tables that mark the rows of bounds, and of detectors whose results were read from files."""
        marked = self._report.read_only | self._report.bounds
        labels = {shown(name): self._report.label(name, shown(name)) for name in marked}
        return (table.renamed("detector", labels) for table in tables)


def markdown(report: Report) -> str:
    """Whole report as Markdown."""
    name, about = report.experiment["name"], report.experiment["description"]
    lines = ["<!-- uwbbench report -->", f"# {escaped(shown(name))}", ""]
    if about:
        lines += [escaped(one_line(about)), ""]
    lines += [sheet.markdown() for sheet in sheets(report)]
    if report.notes:
        lines += ["## Notes", "", *(f"* {escaped(sentence(note))}" for note in report.notes), ""]
    session = report.folder.manifest["sessions"][-1]
    machine, versions = session["machine"], session["versions"]
    versions_line = f"uwbbench {versions['uwbbench']}, Python {versions['python']}, {machine['cpu']}, {machine['os']}"
    lines += [f"Made with {escaped(versions_line)}; started {session['started']}."]
    return "\n".join(lines) + "\n"


def write_report(report: Report) -> Path:
    """Write ``report.md`` into its run folder."""
    return report.folder.write_text("report.md", markdown(report))


def _leaderboards(report: Report, rows_of: Sequence[tuple[dict[str, Any], Any]]) -> Iterator[Sheet]:
    """One sheet for each dataset, source, scoring and table."""
    quantities = Quantity.of_all(report.metrics)
    groups: dict[tuple[str, ...], list[tuple[dict[str, Any], Any]]] = {}
    for about, estimates in rows_of:
        key = about["dataset"], about["source"], about["scoring"], about["table"]
        groups.setdefault(key, []).append((about, estimates))
    for (dataset, source, scoring, table), members in groups.items():
        open_world = any(not about["exhaustive"] for about, _ in members)
        metrics = report.metrics.of(scoring)
        main = metrics.ranking(exhaustive=not open_world)
        columns = [quantities[name] for name in metrics.defined(exhaustive=not open_world)]
        columns.sort(key=lambda by: by.name != main)
        heads = [columns[0].axis, "p50 (us)", "p99 (us)", *(by.axis for by in columns[1:])]
        extra = (["chance recall"] if open_world else []) + ["n", "frames"]
        rows = []
        for about, estimates in members:
            shown_here = [(estimates[by.name], by) for by in columns]
            cells = [interval(e.value, e.low, e.high, by.digits, by.factor) for e, by in shown_here]
            cells[1:1] = [time_us(about, "p50_us"), time_us(about, "p99_us")]
            cells += [number(about["chance_recall"], 3)] if open_world else []
            of_run = metrics[main].of.of_run
            cells += [str(estimates[main].n if of_run else about["errors"])]
            cells += [
                f"{about['frames'] - about['unprocessed'] if of_run else about['scored_frames']} of {about['frames']}"
            ]
            ranks = None if about["rank_low"] is None else (about["rank_low"], about["rank_high"])
            rows.append((shown(about["detector"]), rank_text(ranks), *cells))
        title = f"{shown(dataset)}, {source.upper()}: {scoring} scoring, {table_name(scoring, table)}"
        board = dataset, source, scoring, table
        few = [one for one in report.set_aside if (one.dataset, one.source, one.scoring, "filtering") == board]
        seen = table == "mapping" and report.folder.rules[0].surface == "visible"
        faces = ["Errors are distances to the part of an outline that the receiver can see (surface: visible)."] * seen
        faces += [f"Scored {text}."] if (text := _own_region(report, dataset)) else []
        said = _leaderboard_notes(members, quantities, metrics, report.timed)
        notes = (*map(set_aside_warning, few), *faces, *said)
        yield Sheet(title, ("detector", "rank", *heads, *extra), tuple(rows), notes)


def _own_region(report: Report, dataset: str) -> str:
    """Where the captures of a dataset are scored, if not where all others are; else empty."""
    rule = report.folder.rules[0]
    region, gate_m = dict(rule.regions).get(dataset), dict(rule.gates).get(dataset)
    gate = "" if gate_m is None else f"with a gate of {gate_m:g} m"
    if region is None:
        return gate
    to = "" if region.max_range_m is None else f" to {region.max_range_m:g} m"
    angle = "" if region.half_angle_rad is None else f", up to {math.degrees(region.half_angle_rad):g} degrees aside"
    return f"from {region.min_range_m:g} m{to}{angle} {gate}".rstrip()


def _leaderboard_notes(
    members: list[tuple[dict[str, Any], Any]], quantities: Mapping[str, Quantity], metrics: MetricChoice, timed: str
) -> Iterator[str]:
    open_world = any(not about["exhaustive"] for about, _ in members)
    main = quantities[metrics.ranking(exhaustive=not open_world)]
    of_run = metrics[main.name].of.of_run
    if not of_run:
        yield TRACK_ERRORS if members[0][0]["scoring"] == "track" else ERRORS
    if metrics.listed:
        yield f"Ranked by {main.title}."
    if any(about["bound"] for about, _ in members):
        yield BOUNDS
    if open_world:
        yield (
            "The truth does not name all that is visible, so an unmatched detection proves nothing: "
            f"{undefined_titles(metrics)} are undefined; errors are of matches, and recall is to be read against that "
            "of random ranges."
        )
    yield from _evidence_of_runs(members, main) if of_run else _evidence(members, main)
    for about, _ in members:
        if about["invalid"] or about["unprocessed"]:
            yield (
                f"{shown(about['detector'])}: {about['invalid']} frames invalid or not processed, "
                f"{about['unprocessed']} of them with known truth"
            )
    if any(not math.isnan(about["p50_us"]) for about, _ in members):
        yield f"Times are {timed}, and hold on this machine only."


def _evidence(members: list[tuple[dict[str, Any], Any]], main: Quantity) -> Iterator[str]:
    """What the intervals rest on, and what the scenes do not show."""
    scenes = max(about["scenes"] for about, _ in members)
    what = counted(scenes, "scene")
    yield f"{what}: if none of them fails, at most {failing_share(scenes):.0%} of such scenes do (95 % confidence)."
    if any(estimates[main.name].within for _, estimates in members):
        yield f"Intervals: {WITHIN}."
    elif scenes < INNER_UNITS:
        yield f"Intervals: outer ones, as if each scene ended all or nothing; inner ones from {INNER_UNITS} scenes on."
    else:
        outer = "; ".join(
            f"{shown(about['detector'])} {between(e.outer_low, e.outer_high, main.digits, main.factor)}"
            for about, e in ((about, estimates[main.name]) for about, estimates in members)
        )
        yield f"Intervals: inner ones, for scenes like these. Outer ones of {main.axis}, at worst: {outer}."
    if 1 < scenes < INNER_UNITS:
        yield from _values(members, main, "scene")


def _evidence_of_runs(members: list[tuple[dict[str, Any], Any]], main: Quantity) -> Iterator[str]:
    """The same where each run is one number."""
    runs = max(about["captures"] for about, _ in members)
    yield f"{counted(runs, 'run')}{'' if runs >= LEAST_RUNS else ': no interval'}. {RUN_INTERVALS}"
    if 1 < runs < INNER_UNITS:
        yield from _values(members, main, "run")


def _values(members: list[tuple[dict[str, Any], Any]], main: Quantity, unit: str) -> Iterator[str]:
    """Values of each of a few scenes or runs."""
    for about, estimates in members:
        values = ", ".join(number(value, main.digits, main.factor) for value in estimates[main.name].per_group)
        yield f"{main.axis} of each {unit}, {shown(about['detector'])}: {values or 'none'}"


def _stability(report: Report) -> Sheet:
    columns: tuple[str, ...] = ("detector", "echo found (%)", "passed", "failed", "not applicable", "largest error (m)")
    columns += ("largest error (ulp)", "flips by float32 (%)", "flips by one ulp (%)")
    rows: list[tuple[str, ...]] = []
    notes: list[str] = []
    for result in report.stability:
        name = shown(result["detector"])
        if "refused" in result:
            rows.append((name, *["n/a"] * (len(columns) - 1)))
            notes.append(f"{name} cannot run on the capture of the hard cases: {sentence(result['refused'])}")
            continue
        counts = [str(result[key]) for key in ("passed", "failed", "not_applicable")]
        sizes = [
            "n/a" if result[key] is None else f"{result[key]:.1e}" for key in ("largest_error_m", "largest_error_ulp")
        ]
        flips = [number(result[key], 2, 100.0) for key in ("flips_float32", "flips_one_ulp")]
        rows.append((name, number(result["usual_hits"], 0, 100.0), *counts, *sizes, *flips))
        failed = [
            f"{case['case']} ({sentence(case['detail'])})" for case in result["cases"] if case["status"] == "failed"
        ]
        notes += [f"{name} failed: {shown('; '.join(failed))}"] if failed else []
    about = (
        "Inputs at which numerical code breaks, made by uwbbench and SIMULATED; 'uwbbench stability' shows each case."
    )
    return Sheet("Hard cases", columns, tuple(rows), (about, *notes))


def _latency(report: Report) -> Sheet:
    table = report.latency
    rows = []
    for row in table.to_dict("records"):
        whole = row["timed"] == ROWS
        cells = [shown(row["detector"]), shown(row["capture"])]
        cells += [number(row[name], 1) if whole else UNKNOWN for name in _TIMES]
        cells += [number(row[f"step_{name}"], 1) for name in _STEP_TIMES]
        cells += [interval(row["ratio"], row["ratio_low"], row["ratio_high"], 3), number(row["total_ratio"], 3)]
        cells += [number(row[f"age_{name}"], digits, factor) for name, digits, factor in _AGES]
        cells += [number(row["missed_share"], 2, 100.0), number(row["missed_share_high"], 2, 100.0)]
        cells += [str(row["longest_burst"]), number(row["startup_s"], 2), number(row["peak_memory_bytes"], 0, 1e-6)]
        rows.append((*cells, number(row["overhead_us"], 1), str(row["n"])))
    references = ", ".join(sorted({name for name in table["reference"] if isinstance(name, str)})) or "none"
    columns = ("detector", "capture", *(f"{head} (us)" for head in _TIME_HEADS), "step p50 (us)", "step p99 (us)")
    columns += ("ratio to reference", "ratio of all time", *_AGE_HEADS)
    columns += ("missed (%)", "at most (%)", "longest burst", "start-up (s)", "memory (MB)", "uwbbench (us)", "calls")
    notes: tuple[str, ...] = (
        "THIS MACHINE ONLY: times in us of single calls, one frame each, on one core with one thread, from raw samples "
        "in memory to rows as plain records. Step: the part of it that the detector's own step takes.",
        f"What travels is the ratio to a reference detector ({references}), measured in alternating blocks, "
        f"{report.timed}.",
        "Ratio of all time: of all blocks together, in which rare expensive calls count as much as they take.",
        "Age: from the arrival of a frame to the call that hands out its detection, as seen by driving the detector "
        "frame by frame; in frames, and in ms with the time of that call. At the end: share that only the flush gave.",
        "n/a: too few calls for that percentile (36, 72 and 368 for P90, P95 and P99), or the detector reports none.",
        "At most: upper end of the 95 % interval of the share of missed deadlines, for independent calls.",
        "uwbbench: the same loop with a detector that does nothing.",
    )
    old = dict.fromkeys(shown(row["detector"]) for row in table.to_dict("records") if row["timed"] != ROWS)
    notes += tuple(
        f"{name}: measured by an earlier version, which timed the step alone, also for ratio, deadlines and harness"
        for name in old
    )
    detector_notes = dict.fromkeys(
        f"{shown(row['detector'])}: {row['notes']}" for row in table.to_dict("records") if row["notes"]
    )
    return Sheet("Latency", columns, tuple(rows), (*notes, *detector_notes))


_TIMES = ("p50_us", "p90_us", "p95_us", "p99_us", "max_us", "clustering_p50_us", "amortised_us", "throughput_us")
_TIME_HEADS = ("p50", "p90", "p95", "p99", "max", "clustering call", "amortised", "batch a frame")
_STEP_TIMES = ("p50_us", "p99_us")
_AGES = (("p50_frames", 1, 1.0), ("p95_frames", 1, 1.0), ("p50_s", 2, 1e3), ("p95_s", 2, 1e3), ("end_share", 1, 100.0))
_AGE_HEADS = ("age p50 (frames)", "age p95 (frames)", "age p50 (ms)", "age p95 (ms)", "at the end (%)")
UNKNOWN = "not known"
"""A time that an earlier version did not measure."""
