"""What a run over test signals says about physical limits: in sentences, in charts, and in tables."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from uwbbench.api.geometry import SPEED_OF_LIGHT_M_S
from uwbbench.results.limits import Limits
from uwbbench.show.charts import limits_charts
from uwbbench.show.charts.chart import Spec
from uwbbench.show.charts.limits_charts import USUAL
from uwbbench.show.page.section import Section
from uwbbench.show.text.limits_sheets import limits_sheets
from uwbbench.show.text.numbers import number, times

if TYPE_CHECKING:
    from uwbbench.show.page.content import Content


def limits(content: Content) -> Section | None:
    """Error against SNR with the Cramer-Rao bound first, then false alarms and resolution, then all in numbers."""
    known = content.report.limits
    charts = tuple(_charts(content))
    if not charts:
        return None
    return Section("limits", "Against physical limits", charts=charts, sheets=tuple(limits_sheets(known)))


def sentences(content: Content) -> Iterator[str]:
    """What stands out, one sentence for each question that the test signals ask."""
    known = content.report.limits
    if not known.accuracy.empty:
        yield from _error(known, content)
    if not known.false_alarms.empty:
        yield from _rates(known, content)
    if not known.resolution.empty:
        yield from _apart(known, content)


def _charts(content: Content) -> Iterator[Spec]:
    known, names = content.report.limits, content.detectors
    if not known.accuracy.empty:
        yield limits_charts.error_against_snr(known.accuracy, names)
    if not known.false_alarms.empty:
        yield limits_charts.false_alarms(known.false_alarms, names)
    if not known.resolution.empty:
        yield limits_charts.resolution(known.resolution, names)
    if not known.accuracy.empty:
        yield limits_charts.detection_against_snr(known.accuracy, names)


def _error(known: Limits, content: Content) -> Iterator[str]:
    """Nearest to the bound at the lowest and the highest SNR, among those that find nearly all echoes."""
    rows = [row for row in known.accuracy.to_dict("records") if row["detector"] not in content.report.bounds]
    usual = [row for row in rows if row["share"] >= USUAL and row["rmse_m"] > 0]
    if not usual:
        yield f"At no signal-to-noise ratio does any detector find {USUAL:.0%} of single echoes."
        return
    said = []
    ratios = [row["snr_db"] for row in usual]
    for snr_db in sorted({min(ratios), max(ratios)}):
        at = [row for row in usual if row["snr_db"] == snr_db]
        best = min(at, key=lambda row: float(row["rmse_m"]))
        said.append(
            f"at {snr_db:g} dB {content.detectors[best['detector']]} has {number(best['rmse_m'], 2, 100)} cm RMS, "
            f"{times(best['ratio'])} the Cramer-Rao bound, the least of {len(at)}"
        )
    yield f"Range error, of the detectors that find at least {USUAL:.0%} of single echoes: {'; '.join(said)}."


def _rates(known: Limits, content: Content) -> Iterator[str]:
    """Measured against requested rate, of those that report every cell over their threshold."""
    said = [
        f"{content.detectors[row['detector']]} {times(row['share'] / row['requested'])} "
        f"({row['condition'].removeprefix('all, ')} noise assumed)"
        for row in known.false_alarms.to_dict("records")
        if row["requested"] > 0 and row["condition"].startswith("all")
    ]
    if said:
        yield f"False alarms, measured in times of the requested rate a cell: {', '.join(said)}."


def _apart(known: Limits, content: Content) -> Iterator[str]:
    """Smallest distance at which any detector resolves most pairs."""
    rows = [row for row in known.resolution.to_dict("records") if row["detector"] not in content.report.bounds]
    if not rows:
        return
    most = [row for row in rows if row["low"] > 0.5]
    nearest = min((row["separation_ns"] for row in most), default=None)
    best = max((row for row in most or rows if nearest in (None, row["separation_ns"])), key=lambda row: row["share"])
    apart_cm = 100 * SPEED_OF_LIGHT_M_S * 1e-9 / 2 * best["separation_ns"]
    where = f"{best['separation_ns']:g} ns ({apart_cm:.0f} cm)"
    who = f"{content.detectors[best['detector']]}, {best['share']:.0%} of them"
    if most:
        yield f"Resolution: two equal echoes {where} apart are the closest that most pairs are resolved at: {who}."
    else:
        yield f"Resolution: no detector resolves most pairs of equal echoes; the most are resolved at {where}: {who}."
