"""A run in a notebook: its leaderboards, what failed, and what a reader must know."""

from __future__ import annotations

from uwbbench.results.report import Report
from uwbbench.show.notebook import elements
from uwbbench.show.text.report import Tables


def run(shown: Report) -> str:
    """HTML of a run: who is best on each dataset, with intervals, and what did not work."""
    manifest = shown.folder.manifest
    started = manifest["sessions"][-1]["started"]
    facts = {"folder": shown.folder.path, "about": shown.experiment["description"], "started": started}
    parts = [elements.facts(facts)]
    for sheet in (*Tables(shown).leaderboards(), *Tables(shown).failed()):
        table = elements.table(sheet.columns, sheet.rows, numbers=True)
        parts.append(f"<div>{elements.text(sheet.title)}</div>{table}{elements.notes(sheet.notes)}")
    simulated = any(one["source"] == "simulated" for one in shown.captures)
    return elements.frame("run", shown.experiment["name"], *parts, elements.notes(shown.notes), simulated=simulated)
