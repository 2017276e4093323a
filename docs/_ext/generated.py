"""Pages that the program writes itself: commands from their help, plugins from what ``uwbbench show`` says.

A page names what belongs into it by a comment, ``<!-- generated: commands -->``. Nothing is stored, so that nothing can
be out of date.
"""

from __future__ import annotations

import html
import re
from collections.abc import Callable, Iterator
from typing import Any

import click
import typer
from sphinx.application import Sphinx

from uwbbench.api import registry
from uwbbench.api.locate import shipped
from uwbbench.api.stage import describe
from uwbbench.cli import app as program
from uwbbench.cli.describe import parameters
from uwbbench.detect.pipeline import load_detector

MARK = re.compile(r"<!-- generated: ([a-z]+) -->")


def setup(app: Sphinx) -> dict[str, bool]:
    """Fill generated parts in as pages are read."""
    app.connect("source-read", _fill)
    return {"parallel_read_safe": True}


def _fill(_: Sphinx, __: str, source: list[str]) -> None:
    source[0] = MARK.sub(lambda match: "\n".join(_WRITERS[match[1]]()), source[0])


def _commands() -> Iterator[str]:
    """Every command with its help, as the terminal prints it."""
    group: Any = typer.main.get_command(program)
    for name, command in group.commands.items():
        context = click.Context(command, info_name=f"uwbbench {name}", terminal_width=88, max_content_width=88)
        yield from (f"## {name}", "", "```text", command.get_help(context), "```", "")


def _stages() -> Iterator[str]:
    """Every stage with its ports and parameters."""
    for name in sorted(registry.entries("stages")):
        stage = registry.load_plugin("stages", name)
        yield from (f"## {name}", "", _plain(describe(stage)), "")
        for port in ("needs", "consumes", "produces"):
            if getattr(stage, port):
                yield f"* {port}: {', '.join(f'`{one}`' for one in sorted(getattr(stage, port)))}"
        yield from (f"* fidelity: {stage.fidelity}", "", *_table(stage), "")


def _mappers() -> Iterator[str]:
    """Every mapper with what it needs and its parameters."""
    for name in sorted(registry.entries("mappers")):
        mapper = registry.load_plugin("mappers", name)
        yield from (f"## {name}", "", _plain(describe(mapper)), "")
        for port in ("needs", "consumes"):
            if getattr(mapper, port):
                yield f"* {port}: {', '.join(f'`{one}`' for one in sorted(getattr(mapper, port)))}"
        yield f"* receivers: {mapper.receivers} or more"
        yield from (f"* fidelity: {mapper.fidelity}", "", *_table(mapper), "")


def _datasets() -> Iterator[str]:
    """Every dataset with its card and parameters."""
    for name in sorted(registry.entries("datasets")):
        adapter = registry.load_plugin("datasets", name)
        card = adapter.card
        yield from (f"## {name}", "", _plain(describe(adapter)), "")
        yield from (f"* {card.origin}, licence {_plain(card.license)}", f"* {_plain(card.citation or card.title)}", "")
        yield from (*_table(adapter), "")


def _terms() -> Iterator[str]:
    """Every term of the simulator with its parameters."""
    for name in sorted(registry.entries("terms")):
        term = registry.load_plugin("terms", name)
        yield from (f"## {name}", "", _plain(describe(term)), "")
        if term.of_robot:
            yield from ("* part of a [robot](../howto/scenes.md)", "")
        yield from (*_table(term), "")


def _detectors() -> Iterator[str]:
    """Every shipped detector with its description and chain."""
    for name in shipped("detectors"):
        config = load_detector(name).config
        ends = [config.mapper.use] if config.mapper else []
        chain = " → ".join(f"`{name}`" for name in [*(step.label for step in config.steps), *ends])
        yield from (f"## {name}", "", _plain(config.description), "", chain, "")


def _table(plugin: Any) -> Iterator[str]:
    rows = parameters(plugin.params_type())
    if rows:
        yield from ("| parameter | type | default | |", "| --- | --- | --- | --- |")
    for row in rows:
        yield f"| `{row['name']}` | {' | '.join(_plain(row[key]) for key in ('type', 'default', 'description'))} |"


def _plain(text: object) -> str:
    """Text that Markdown leaves as it is, on one line."""
    line = html.escape(" ".join(str(text).split()), quote=False)
    return re.sub(r"([\\`*_{}\[\]|$])", r"\\\1", line)


_WRITERS: dict[str, Callable[[], Iterator[str]]] = {
    "commands": _commands,
    "stages": _stages,
    "mappers": _mappers,
    "datasets": _datasets,
    "terms": _terms,
    "detectors": _detectors,
}
