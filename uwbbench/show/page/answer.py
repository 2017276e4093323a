"""What a run says in a sentence: the one place where the page words its result."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from uwbbench.results.verdicts import WITHIN
from uwbbench.show.text.numbers import times

if TYPE_CHECKING:
    from uwbbench.show.page.content import Content


def sentences(content: Content) -> Iterator[str]:
    """One sentence for each dataset: who leads, how sure that is, and at what cost."""
    for about, estimates in content.estimates:
        key = about["dataset"], about["source"]
        if content.leads(about) and content.leaders[key] == about["detector"]:
            yield _sentence(content, about, estimates)


def _sentence(content: Content, about: Mapping[str, Any], estimates: Mapping[str, Any]) -> str:
    metrics, exhaustive = content.report.metrics.of(about["scoring"]), about["exhaustive"]
    main = content.quantities[metrics.ranking(exhaustive=exhaustive)]
    said = [main, *(content.quantities[name] for name in metrics.error(exhaustive=exhaustive))]
    figures = " and ".join(f"{by.title} {by.value_of(estimates[by.name])}" for by in said)
    plural = "capture" if about["captures"] == 1 else "captures"
    what = f"{about['captures']} {about['source']} {plural} of {content.datasets[about['dataset']]}"
    leader = content.detectors[about["detector"]]
    scored = "" if metrics[main.name].of.of_run else f"{about['scored_frames']} scored frames, "
    text = f"On {what} ({scored}{about['scoring']} scoring), "
    if not estimates[main.name].value > 0 and main.better == "higher":
        return f"{text}no detector found anything."
    board = about["dataset"], about["source"], about["scoring"], about["table"]
    text += content.report.ranks[board].opening(content.detectors, figures)
    if estimates[main.name].within:
        text += f" (intervals {WITHIN})"
    speed = content.speeds.get(about["dataset"], {}).get(about["detector"])
    if speed is None:
        return f"{text}; it was not timed."
    against = content.detectors.get(speed.reference, speed.reference)
    if leader == against:
        return f"{text}; it is the reference of times."
    return f"{text}, at {times(speed.ratio)} the time a frame of {against}."
