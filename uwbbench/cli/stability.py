"""The command that puts hard cases to a detector: ``stability``."""

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
    """Put hard cases to a detector.

    Inputs at which numerical code breaks, each with the behaviour that is expected. Exits with 1 if a case fails.
    """
    import uwbbench
    from uwbbench.api.override import parse_settings
    from uwbbench.measure.robustness import case_named, examine

    chosen = [case_named(name) for name in case] if case else None
    found = examine(uwbbench.load_detector(detector, changes=parse_settings(settings or ())), chosen)
    if json:
        render.print_json(found.to_dict())
    else:
        _print(found)
    if not found.passed:
        raise typer.Exit(CHECK_FAILED)


def _print(found: Stability) -> None:
    rows = [(one.check.name, one.check.asked, one.status, one.detail or one.found) for one in found.results]
    render.print_table(f"hard cases for {found.detector}", ("case", "expected", "outcome", "detail"), rows)
    figures = found.summary()
    counts = f"{figures['passed']} passed, {figures['failed']} failed, {figures['not_applicable']} not applicable"
    told = {
        "cases": counts,
        "largest error": ", ".join(_small(figures[f"largest_error_{unit}"], unit) for unit in ("m", "ulp")),
        "echo found": f"in {figures['usual_hits']:.0%} of undisturbed frames",
        "changed by float32": _share(figures["flips_float32"]),
        "changed by one ulp": _share(figures["flips_one_ulp"]),
    }
    render.print_facts(told)


def _small(value: float | None, unit: str) -> str:
    return f"n/a {unit}" if value is None else f"{value:.2g} {unit}"


def _share(value: float | None) -> str:
    return "n/a" if value is None else f"{value:.2%} of the detections"


def register(app: typer.Typer) -> None:
    """Add this command."""
    app.command(epilog="Example: uwbbench stability --detector cfar-os --case zero-frames")(stability)
