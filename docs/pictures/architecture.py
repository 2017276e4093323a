"""Draw the map of the house from its imports; run as a script it writes ``docs/images/architecture.svg``.

Rooms are in the order that the layers contract in ``pyproject.toml`` gives them. An arrow says that some module of a
room imports something of another, also inside a function or for type checkers only; imports that the contract excuses
by name are at the left, dashed. What the package ``uwbbench`` itself imports is left out: those are its public names,
from all rooms. A test compares the stored picture with what
this script makes of the code.
"""

from __future__ import annotations

import ast
import tomllib
from collections import defaultdict
from functools import cache
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

ROOT = Path(__file__).parents[2]
PICTURE = ROOT / "docs" / "images" / "architecture.svg"
PLUGINS = {"uwbbench_detectors": "detectors", "uwbbench_datasets": "datasets"}
ROOMS = {
    "api": "contracts and data; all that a plugin imports",
    "config": "YAML in: files, overrides, captures by name",
    "detect": "a detector at work: pipeline, stream, sources",
    "measure": "how right, how fast, how robust",
    "run": "carries out an experiment; the only writer of results",
    "results": "numbers made of stored runs",
    "show": "text, charts, pages, pictures, notebooks",
    "tools": "checks, gates, tuning, scaffolds, Python functions",
    "cli": "the commands",
}
WIDTH, BOX, HEIGHT, GAP, LEFT, TOP = 940, 470, 62, 20, 84, 132
COLOURS = ("#000000", "#0072B2", "#009E73", "#D55E00", "#CC79A7", "#56B4E9", "#B8860B", "#7A4FBF", "#666666")


def contract() -> dict[str, Any]:
    """The layers contract."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    (layers,) = (one for one in contracts if one["type"] == "layers")
    return layers


def rooms() -> list[str]:
    """Rooms in the order of data, the lowest first."""
    return [name for name in reversed(contract()["layers"]) if (ROOT / "uwbbench" / name).is_dir()]


def sub_rooms(room: str) -> list[str]:
    """Packages inside a room."""
    return sorted(path.parent.name for path in (ROOT / "uwbbench" / room).glob("*/__init__.py"))


@cache
def imports() -> tuple[set[tuple[str, str]], set[tuple[str, str]]]:
    """Pairs of places of which the first imports the second, and those that only excused imports join.

    A plugin package is a place as a room is.
    """
    known = {*rooms(), *PLUGINS}
    excuses = [tuple(line.split(" -> ")) for line in contract().get("ignore_imports", [])]
    found, excused = set(), set()
    for folder in (ROOT / "uwbbench", *(ROOT / parent / name for name, parent in PLUGINS.items())):
        for path in folder.rglob("*.py"):
            module = ".".join(path.relative_to(folder.parent).with_suffix("").parts).removesuffix(".__init__")
            for name in _imported(path):
                pair = _place(module), _place(name)
                if pair[0] != pair[1] and known.issuperset(pair):
                    by_name = any(module == source and f"{name}.".startswith(f"{to}.") for source, to in excuses)
                    (excused if by_name else found).add(pair)
    return found, excused - found


def _place(module: str) -> str:
    """Room, or plugin package, that a module belongs to."""
    package, _, rest = module.partition(".")
    return rest.partition(".")[0] if package == "uwbbench" else package


def _imported(path: Path) -> set[str]:
    """Modules that a file names in its imports, wherever they are; the project has no relative imports."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def draw() -> str:
    """The map as SVG."""
    order = rooms()
    used, excused = (
        sorted(pairs, key=lambda pair: [[*PLUGINS, *order].index(name) for name in pair]) for pairs in imports()
    )
    top = {room: TOP + place * (HEIGHT + GAP) for place, room in enumerate(order)}
    bottom = top[order[-1]] + HEIGHT
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {bottom + 62}" font-family="sans-serif">',
        "<title>The rooms of uwbbench in the order of data; every arrow goes up, to a room that is used</title>",
        f'<rect width="{WIDTH}" height="{bottom + 62}" fill="white"/>',
        "<defs>",
        *(_head(number) for number in range(len(order))),
        "</defs>",
    ]
    for number, plugin in enumerate(PLUGINS):
        x = LEFT + number * (BOX // 2 + 5)
        parts += [_box(x, 24, BOX // 2 - 5, 50, "#FFF6E0"), _text(x + 14, 46, f"{PLUGINS[plugin]}/", 16, "bold")]
        parts.append(_text(x + 14, 64, "plugins, found by entry points", 12))
    for place, other in used:
        if place in PLUGINS and other == order[0]:
            x = LEFT + list(PLUGINS).index(place) * (BOX // 2 + 5) + BOX // 4
            parts.append(f'<path d="M{x} 74V{TOP - 3}" stroke="#000" fill="none" marker-end="url(#head-0)"/>')
    parts += [part for room in order for part in _room(room, top[room])]
    parts += _arrows([pair for pair in used if pair[0] in top], order, top)
    parts += [_excuse(source, target, top, place) for place, (source, target) in enumerate(excused)]
    legend = "Data flows down. An arrow leads from a room to one that it uses: all solid ones go up."
    parts.append(_text(LEFT, bottom + 30, legend, 14))
    if excused:
        parts.append(_text(LEFT, bottom + 50, "Dashed: excused by name; a notebook asks an object how it looks.", 14))
    return "\n".join([*parts, "</svg>", ""])


def _head(number: int) -> str:
    colour = COLOURS[number % len(COLOURS)]
    size = 'markerWidth="9" markerHeight="9" refX="7" refY="4" orient="auto" markerUnits="userSpaceOnUse"'
    return f'<marker id="head-{number}" {size}><path d="M0 0L8 4L0 8z" fill="{colour}"/></marker>'


def _box(x: float, y: float, width: float, height: float, fill: str) -> str:
    return f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="6" fill="{fill}" stroke="#555"/>'


def _text(x: float, y: float, words: str, size: int, weight: str = "normal", colour: str = "#222") -> str:
    look = f'font-size="{size}" font-weight="{weight}" fill="{colour}"'
    return f'<text x="{x}" y="{y}" {look}>{escape(words)}</text>'


def _room(room: str, y: float) -> list[str]:
    """Box of a room: name, what it is for, and its packages."""
    inside = sub_rooms(room)
    lines = [_box(LEFT, y, BOX, HEIGHT, "#EEF4FA"), _text(LEFT + 14, y + (26 if inside else 36), room, 17, "bold")]
    lines.append(_text(LEFT + 100, y + (26 if inside else 36), ROOMS[room], 14))
    return lines + ([_text(LEFT + 100, y + 47, " · ".join(inside), 12, colour="#555")] if inside else [])


def _arrows(edges: list[tuple[str, str]], order: list[str], top: dict[str, int]) -> list[str]:
    """Curves at the right of the boxes, each room's in a colour; none shares its ends with another."""
    leaving, arriving = defaultdict(list), defaultdict(list)
    for source, target in edges:
        leaving[source].append(target)
        arriving[target].append(source)
    parts = []
    for source, target in edges:
        # The nearest leaves above and arrives below all others, so that curves of a room do not cross.
        out = sorted(leaving[source], key=order.index, reverse=True).index(target)
        into = sorted(arriving[target], key=order.index, reverse=True).index(source)
        start = top[source] + 6 + 4 * out
        end = top[target] + HEIGHT - 6 - 5 * (len(arriving[target]) - 1 - into)
        right = LEFT + BOX
        bend = right + 14 + 0.68 * abs(start - end)
        number = order.index(source)
        curve = f"M{right} {start}C{bend:.0f} {start} {bend:.0f} {end} {right + 3} {end}"
        look = (
            f'fill="none" stroke="{COLOURS[number % len(COLOURS)]}" stroke-width="1.4" marker-end="url(#head-{number})"'
        )
        parts.append(f'<path d="{curve}" {look}><title>{source} uses {target}</title></path>')
    return parts


def _excuse(source: str, target: str, top: dict[str, int], number: int) -> str:
    """Dashed curve at the left of the boxes."""
    start, end = top[source] + HEIGHT / 2, top[target] + 16 + 9 * number
    bend = LEFT - 14 - 0.16 * abs(end - start)
    look = 'fill="none" stroke="#666" stroke-dasharray="5 4" marker-end="url(#head-8)"'
    return f'<path d="M{LEFT} {start}C{bend:.0f} {start} {bend:.0f} {end} {LEFT - 3} {end}" {look}/>'


if __name__ == "__main__":
    PICTURE.write_text(draw(), encoding="utf-8")
