"""A gate's result where CI shows it: JUnit XML, and Markdown for the summary of a GitHub step."""

from __future__ import annotations

import platform
from collections.abc import Iterator
from datetime import UTC, datetime
from xml.etree import ElementTree as ET

from uwbbench.api.text import one_line
from uwbbench.show.text.sheet import Sheet
from uwbbench.tools.gate.check import Check, GateResult, GateVerdict

_OUTCOME = {GateVerdict.REGRESSION: "failure", GateVerdict.INVALID: "error", GateVerdict.INCONCLUSIVE: "error"}

COLUMNS = ("check", "measured", "limit", "verdict", "why, and what next")


def rows(result: GateResult) -> Iterator[tuple[str, ...]]:
    """One row of text for each check, under :data:`COLUMNS`."""
    for check in result.checks:
        why = "; ".join(part for part in (check.reason, check.advice) if part)
        yield tuple(
            map(one_line, (check.name, check.measured_text, check.limit_text, check.verdict.value.upper(), why))
        )


def markdown(result: GateResult) -> str:
    """Summary as GitHub-flavoured Markdown; every name is escaped."""
    compared = f"head {one_line(result.head)}" + (f" against base {one_line(result.base)}" if result.base else "")
    notes = (compared, f"{one_line(result.machine['cpu'])}; times hold on this machine only, their ratio travels.")
    title = f"Gate {one_line(result.gate)}: {result.verdict.value.upper()}"
    return Sheet(title, COLUMNS, tuple(rows(result)), notes).markdown()


def junit(result: GateResult) -> str:
    """Result as JUnit XML.

    One ``testsuite`` for each kind of check, one ``testcase`` for each check: a regression is a ``failure``, what is
    invalid or inconclusive an ``error`` of that type, so that a server that only reads this file is green where the
    gate passes and nowhere else. Attributes and order follow both common schemas, those of Ant and of Jenkins.
    """
    root = ET.Element("testsuites")
    stamp = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%S")
    for number, kind in enumerate(dict.fromkeys(check.kind for check in result.checks)):
        checks = [check for check in result.checks if check.kind == kind]
        outcomes = [_OUTCOME.get(check.verdict) for check in checks]
        suite = ET.SubElement(
            root,
            "testsuite",
            id=str(number),
            package="uwbbench.tools.gate",
            name=one_line(f"{result.gate} {kind}"),
            timestamp=stamp,
            hostname=platform.node() or "localhost",
            tests=str(len(checks)),
            failures=str(outcomes.count("failure")),
            errors=str(outcomes.count("error")),
            skipped="0",
            time=f"{sum(check.elapsed_s for check in checks):.3f}",
        )
        facts = ET.SubElement(suite, "properties")
        for name in ("head", "base"):
            if getattr(result, name):
                ET.SubElement(facts, "property", name=name, value=one_line(getattr(result, name)))
        for check in checks:
            _testcase(suite, result.gate, check)
        ET.SubElement(suite, "system-out")
        ET.SubElement(suite, "system-err")
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _testcase(suite: ET.Element, gate: str, check: Check) -> None:
    case = ET.SubElement(
        suite,
        "testcase",
        classname=one_line(f"{gate}.{check.kind}"),
        name=one_line(check.name),
        time=f"{check.elapsed_s:.3f}",
    )
    outcome = _OUTCOME.get(check.verdict)
    if outcome is None:
        return
    said = [part for part in (check.measured_text, check.limit_text, check.advice) if part]
    element = ET.SubElement(
        case, outcome, message=one_line(check.reason or check.verdict.value), type=check.verdict.value
    )
    element.text = one_line("; ".join(said))
