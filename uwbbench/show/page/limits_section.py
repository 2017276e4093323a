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
    table = known.accuracy
    usual = table[(table["share"] >= USUAL) & (table["rmse_m"] > 0)]
    if usual.empty:
        yield f"At no signal-to-noise ratio does any detector find {USUAL:.0%} of single echoes."
        return
    said = []
    for snr_db in sorted({usual["snr_db"].min(), usual["snr_db"].max()}):
        at = usual[usual["snr_db"] == snr_db]
        best = at.loc[at["rmse_m"].idxmin()]
        said.append(
            f"at {snr_db:g} dB {content.detectors[best['detector']]} has {number(best['rmse_m'], 2, 100)} cm RMS, "
            f"{times(best['ratio'])} the Cramer-Rao bound, the least of {len(at)}"
        )
    yield f"Range error, of the detectors that find at least {USUAL:.0%} of single echoes: {'; '.join(said)}."


def _rates(known: Limits, content: Content) -> Iterator[str]:
    """Measured against requested rate, of those that report every cell over their threshold."""
    table = known.false_alarms
    asked = table[(table["requested"] > 0) & table["condition"].str.startswith("all")]
    said = [
        f"{content.detectors[row['detector']]} {times(row['share'] / row['requested'])} "
        f"({row['condition'].removeprefix('all, ')} noise assumed)"
        for row in asked.to_dict("records")
    ]
    if said:
        yield f"False alarms, measured in times of the requested rate a cell: {', '.join(said)}."


def _apart(known: Limits, content: Content) -> Iterator[str]:
    """Smallest distance at which any detector resolves most pairs."""
    table = known.resolution
    most = table[table["low"] > 0.5]
    if most.empty:
        best = table.loc[table["share"].idxmax()]
        apart_cm = 100 * SPEED_OF_LIGHT_M_S * 1e-9 / 2 * best["separation_ns"]
        yield (
            f"Resolution: no detector resolves most pairs of equal echoes; {content.detectors[best['detector']]} comes "
            f"nearest, with {best['share']:.0%} at {best['separation_ns']:g} ns ({apart_cm:.0f} cm)."
        )
        return
    nearest = most["separation_ns"].min()
    best = most[most["separation_ns"] == nearest]
    who = best.loc[best["share"].idxmax()]
    apart_cm = 100 * SPEED_OF_LIGHT_M_S * 1e-9 / 2 * nearest
    yield (
        f"Resolution: two equal echoes {nearest:g} ns ({apart_cm:.0f} cm) apart are the closest that any detector "
        f"resolves in most cases, {content.detectors[who['detector']]} in {who['share']:.0%} of them."
    )
