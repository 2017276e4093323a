"""The command that runs the hard cases on a detector: ``stability``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from uwbbench.cli import options, render

if TYPE_CHECKING:
    from uwbbench.measure.robustness import Stability

CHECK_FAILED = 1


def stability(
    detector: options.Detector,
    case: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Only this case; may be repeated.", show_default=False)
    ] = None,
    settings: options.Settings = None,
    json: options.Json = False,
) -> None:
    """Run the hard cases on a detector.

    Inputs at which numerical code breaks, each with the behaviour that is expected. Exits with 1 if a case fails.
    """
    import uwbbench
    from uwbbench.api.override import parse_settings
    from uwbbench.measure.robustness import case_named, examine

    chosen = [case_named(name) for name in case] if case else None
    outcome = examine(uwbbench.load_detector(detector, changes=parse_settings(settings or ())), chosen)
    if json:
        render.print_json(outcome.to_dict())
    else:
        _print(outcome)
    if not outcome.passed:
        raise typer.Exit(CHECK_FAILED)


def _print(outcome: Stability) -> None:
    rows = [
        (result.check.name, result.check.asked, result.status, result.detail or result.found)
        for result in outcome.results
    ]
    render.print_table(f"hard cases for {outcome.detector}", ("case", "expected", "outcome", "detail"), rows)
    figures = outcome.summary()
    counts = f"{figures['passed']} passed, {figures['failed']} failed, {figures['not_applicable']} not applicable"
    facts = {
        "cases": counts,
        "largest error": ", ".join(_small(figures[f"largest_error_{unit}"], unit) for unit in ("m", "ulp")),
        "echo found": f"in {figures['usual_hits']:.0%} of undisturbed frames",
        "changed by float32": _share(figures["flips_float32"]),
        "changed by one ulp": _share(figures["flips_one_ulp"]),
    }
    render.print_facts(facts)


def _small(value: float | None, unit: str) -> str:
    return f"n/a {unit}" if value is None else f"{value:.2g} {unit}"


def _share(value: float | None) -> str:
    return "n/a" if value is None else f"{value:.2%} of the detections"


def register(app: typer.Typer) -> None:
    """Add this command."""
    app.command(epilog="Example: uwbbench stability --detector cfar-os --case zero-frames")(stability)
