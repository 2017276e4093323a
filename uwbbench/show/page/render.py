"""The page of a report, and its charts as pictures.

The script of the charts (Vega, Vega-Lite and Vega-Embed) is bundled by vl-convert and is in the page once.
Expressions of charts are interpreted, not compiled, as the page's policy asks.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from uwbbench.run.folder.files import replacing, write_json, write_text
from uwbbench.show import drawing
from uwbbench.show.charts import scene_charts
from uwbbench.show.charts.chart import Spec
from uwbbench.show.charts.theme import PAGE, PRINT
from uwbbench.show.html.cell import Table, table_of
from uwbbench.show.html.render import badge, document, embedded, packed
from uwbbench.show.page.content import Content
from uwbbench.show.page.sections import sections
from uwbbench.show.text.formats import INDEX, MARK
from uwbbench.show.text.sheet import Sheet, sentence, shown

FIGURE_WIDTH = 620


def page(content: Content) -> str:
    """HTML of a report.

    Raises
    ------
    ReportToolsError
        If Jinja2 or vl-convert is not installed, or charts cannot be drawn here.
    """
    report = content.report
    manifest = report.folder.manifest
    session = manifest["sessions"][-1]
    name = shown(report.experiment["name"])
    sources = {one["source"] for one in report.captures}
    parts = sections(content)
    return document(
        "page/page",
        _bundle(),
        generator=MARK,
        badge=badge(sources),
        name=name,
        simulated="simulated" in sources,
        lead=sentence(report.experiment["description"]),
        sections=[(part, _tables(content, part.sheets), _tables(content, part.folded)) for part in parts],
        looks=content.looks,
        drives=content.drives,
        facts=_facts(session, report.experiment),
        manifest=json.dumps(_without_hashes(manifest), indent=2, ensure_ascii=False),
        made=f"Made by uwbbench {session['versions']['uwbbench']} from a run started {session['started']}.",
        data=packed({**content.data(), "fixed": {part.id: part.charts for part in parts if part.charts}}),
        config=embedded(PAGE),
    )


def _tables(content: Content, sheets: Sequence[Sheet]) -> list[Table]:
    return [table_of(sheet, content.marks) for sheet in sheets]


@dataclass(frozen=True)
class Picture:
    """A chart with a name for its file.

    Attributes
    ----------
    name : str
    spec : dict
        Vega-Lite.
    """

    name: str
    spec: Spec


def pictures(content: Content) -> Iterator[Picture]:
    """Every chart that the page can show, with names for files."""
    for kind, boards in content.board_charts.items():
        for place, (board, charts) in enumerate(zip(content.boards, boards, strict=True)):
            for metric, spec in charts.items():
                if spec is not None:
                    name = "-".join(part for part in (kind, str(place + 1), board[2], board[3], metric) if part)
                    yield Picture(name, spec)
    for section in sections(content):
        for place, spec in enumerate(section.charts):
            yield Picture(f"{section.id}-{place + 1}", spec)
    for place, look in enumerate(content.looks):
        for kind in ("radargram", "map"):
            if look[kind] is not None:
                yield Picture(f"{kind}-{place + 1}", scene_charts.titled(look[kind]))
    for place, drive in enumerate(content.drives):
        for kind in ("map", "errors"):
            yield Picture(f"drive-{kind}-{place + 1}", scene_charts.titled(drive[kind]))


def write_figures(content: Content, folder: Path) -> list[Path]:
    """Write every chart as PNG (at twice the size), SVG and Vega-Lite.

    Raises
    ------
    ReportToolsError
        If vl-convert is not installed.
    StoreError
        If a file cannot be written.
    """
    written = []
    for picture in pictures(content):
        spec = {**picture.spec, "width": FIGURE_WIDTH, "config": {**PRINT, "background": "white"}}
        write_json(folder / f"{picture.name}.vl.json", spec)
        drawn = drawing.svg(spec)
        write_text(folder / f"{picture.name}.svg", drawn)
        with replacing(folder / f"{picture.name}.png") as partial:
            partial.write_bytes(drawing.png(drawn))
        written.append(folder / f"{picture.name}.png")
    write_json(folder / INDEX, {"generator": MARK, "figures": [path.name for path in written]})
    return written


@lru_cache(maxsize=1)
def _bundle() -> str:
    """Script of the charts; it must not hold what would end its element."""
    return drawing.script().replace("</script", "<\\/script").replace("<!--", "<\\!--")


def _without_hashes(manifest: Mapping[str, Any]) -> dict[str, Any]:
    """The manifest for people: of the hashes of all files, which are thousands, it says how many there are."""
    shown = dict(manifest)
    if "files" in shown:
        shown["files"] = f"SHA-256 of {len(shown['files'])} files: in manifest.json of the run folder"
    return shown


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
