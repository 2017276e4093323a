"""Captures to look at on the page: over time and range and from above, each with what a reader must know."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from uwbbench.api.errors import CaptureError
from uwbbench.results import radargram
from uwbbench.results.cases import Case
from uwbbench.show.charts import scene_charts
from uwbbench.show.text.sheet import labels

if TYPE_CHECKING:
    from uwbbench.show.page.content import Content

_WHICH = {"best": "Best", "worst": "Worst", "only": "The"}


def look(content: Content, case: Case) -> dict[str, Any]:
    """Charts of a capture, and the detectors whose detections they can show."""
    image, missing = _image(content, case)
    quantity = content.quantities[case.metric]
    source, which = case.header.source, _WHICH[case.which]
    capture = labels([case.capture], 40)[case.capture]
    text = (
        f"{which} capture of {content.detectors[case.leader]} on {content.datasets[case.dataset]}: {capture}, "
        f"{quantity.title} {quantity.text(case.score)} in {case.scoring} scoring, {len(case.header)} frames."
    )
    order = {name: place for place, name in enumerate(content.report.detectors)}
    chosen = [
        {
            "label": content.detectors[marks.detector],
            "count": marks.count,
            "shown": len(marks.near),
            "placed": marks.placed,
        }
        for marks in sorted(case.marks, key=lambda marks: order[marks.detector])
    ]
    title = content.title(f"Detections of {scene_charts.DETECTOR}, {capture}", case.dataset, source)
    above = content.title(f"Places found by {scene_charts.DETECTOR}, {capture}", case.dataset, source)
    return {
        "text": text,
        "missing": missing,
        "detectors": chosen,
        "leader": content.detectors[case.leader],
        "placing": content.detectors[scene_charts.placing(case)],
        "radargram": scene_charts.radargram(title, case, image, content.detectors),
        "map": scene_charts.top_view(above, case, content.detectors) if any(one["placed"] for one in chosen) else None,
    }


def _image(content: Content, case: Case) -> tuple[tuple[str, float] | None, str]:
    if content.roots is None:
        return None, "Captures were not looked for."
    if content.report.experiment.get("suite", {}).get("seeds"):
        return None, "Capture not at hand: it was drawn from secret seeds."
    used = next(one for one in content.report.experiment["datasets"] if one["label"] == case.dataset)
    sha256 = content.report.folder.content(case.capture_id)
    try:
        return radargram.picture(radargram.reopened(used, case.capture, sha256, content.roots)), ""
    except CaptureError as error:
        return None, f"Capture not at hand: {error}"
