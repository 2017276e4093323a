"""The page of a report, and its charts as pictures.

The script of the charts (Vega, Vega-Lite and Vega-Embed) is bundled by vl-convert and is in the page once.
Expressions of charts are interpreted, not compiled, as the page's policy asks.
"""

from __future__ import annotations

import json
from functools import lru_cache
from pathlib import Path
from typing import Any

from uwbbench.measure.accuracy.stats import MINIMUM_GROUPS
from uwbbench.run.folder.files import replacing, write_json, write_text
from uwbbench.show.charts.theme import PAGE, PRINT
from uwbbench.show.extras import report_tools
from uwbbench.show.html.render import badge, document, embedded
from uwbbench.show.page.content import Content
from uwbbench.show.text.formats import INDEX, MARK
from uwbbench.show.text.report import Tables
from uwbbench.show.text.sheet import sentence, shown

FIGURE_WIDTH = 620


def page(content: Content) -> str:
    """HTML of a report.

    Raises
    ------
    ReportToolsError
        If Jinja2 or vl-convert is not installed.
    """
    report = content.report
    manifest = report.folder.manifest
    session = manifest["sessions"][-1]
    name = shown(report.experiment["name"])
    tables = _tables(Tables(report))
    sources = {board[1] for board in content.boards}
    return document(
        "page/page",
        _bundle(),
        generator=MARK,
        badge=badge(sources or {one["source"] for one in report.captures}),
        name=name,
        simulated="simulated" in sources,
        lead=sentence(report.experiment["description"]),
        sections=_sections(content, tables),
        summary=content.summary(),
        counts=_counts(content),
        boards=bool(content.boards),
        confidence=f"{report.experiment['intervals']['confidence']:.0%}",
        resamples=report.experiment["intervals"]["resamples"],
        minimum_groups=MINIMUM_GROUPS,
        looks=content.looks,
        tables=tables,
        latencies=content.timings,
        notes=[sentence(note) for note in report.notes],
        facts=_facts(session, report.experiment),
        timed=report.timed,
        manifest=json.dumps(manifest, indent=2, ensure_ascii=False),
        made=f"Made by uwbbench {session['versions']['uwbbench']} from a run started {session['started']}.",
        data=embedded(content.data()),
        config=embedded(PAGE),
    )


def write_figures(content: Content, folder: Path) -> list[Path]:
    """Write every chart as PNG (at twice the size), SVG and Vega-Lite.

    Raises
    ------
    ReportToolsError
        If vl-convert is not installed.
    StoreError
        If a file cannot be written.
    """
    with report_tools():
        import vl_convert
    written = []
    for picture in content.pictures():
        spec = {**picture.spec, "width": FIGURE_WIDTH, "config": {**PRINT, "background": "white"}}
        write_json(folder / f"{picture.name}.vl.json", spec)
        drawn = vl_convert.vegalite_to_svg(spec)
        write_text(folder / f"{picture.name}.svg", drawn)
        with replacing(folder / f"{picture.name}.png") as partial:
            partial.write_bytes(vl_convert.svg_to_png(drawn, scale=2))
        written.append(folder / f"{picture.name}.png")
    write_json(folder / INDEX, {"generator": MARK, "figures": [path.name for path in written]})
    return written


@lru_cache(maxsize=1)
def _bundle() -> str:
    """Script of the charts; it must not hold what would end its element."""
    with report_tools():
        import vl_convert
    script: str = vl_convert.javascript_bundle()  # type: ignore[call-arg]  # its stub knows no default
    return script.replace("</script", "<\\/script").replace("<!--", "<\\!--")


def _counts(content: Content) -> str:
    report = content.report
    captures = report.captures
    licences = sorted({shown(one["license"]) for one in captures})
    failed = f"{len(report.failures)} units failed" if report.failures else "no unit failed"
    return (
        f"{len(report.detectors)} detectors, {len(captures)} captures in {len(content.datasets)} datasets "
        f"(licence: {', '.join(licences) or 'none'}), {sum(one['frames'] for one in captures)} frames; {failed}."
    )


def _tables(tables: Tables) -> list[tuple[str, str, list[Any], str]]:
    """Sections made of tables: identifier, title, sheets, and what else the section holds."""
    sections = [
        ("compared", "What was compared", list(tables.captures()), ""),
        ("paper", "By channel and material", list(tables.paper()), ""),
        ("latency", "Latency", list(tables.latency()), "latency"),
        ("stability", "Stability", list(tables.stability()), ""),
        ("limits", "Physical limits", list(tables.limits()), ""),
        ("failed", "Failed and not scored", list(tables.failed()), ""),
    ]
    return [section for section in sections if section[2] or section[0] not in ("limits", "paper")]


def _sections(content: Content, tables: list[tuple[str, str, list[Any], str]]) -> list[tuple[str, str]]:
    sections = [("summary", "Summary")]
    if content.boards:
        sections += [("leaderboard", "Leaderboard"), ("pareto", "Speed against error")]
        sections += [("range", "By distance"), ("errors", "Errors")]
    if content.looks:
        sections.append(("captures-seen", "Best and worst"))
    sections += [(identifier, title) for identifier, title, *_ in tables]
    return [*sections, ("notes", "Notes"), ("manifest", "Manifest")]


def _facts(session: dict[str, Any], experiment: dict[str, Any]) -> list[tuple[str, str]]:
    machine, versions = session["machine"], session["versions"]
    region = {key: value for key, value in experiment["region"].items() if value is not None}
    return [
        ("started", session["started"]),
        ("command", sentence(" ".join(session["command"]))),
        ("machine", f"{machine['cpu']}, {machine['usable_cores']} cores, {machine['os']}"),
        ("versions", ", ".join(f"{name} {number}" for name, number in versions.items())),
        ("scoring", f"{', '.join(experiment['scoring'])}; gate {100 * experiment['gate_m']:g} cm"),
        ("region", ", ".join(f"{key} {value:g}" for key, value in region.items()) or "none"),
        ("seed", str(experiment["seed"])),
    ]
