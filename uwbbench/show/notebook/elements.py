"""The parts that every display is made of: text that is safe, facts, tables, notes and what folds out."""

from __future__ import annotations

import html
from collections.abc import Iterable, Mapping, Sequence

from uwbbench.api.text import one_line

LONGEST = 400
"""Characters of a name or value that are shown; no name, however long, pushes the rest away."""

# Colours follow the notebook where it defines them (JupyterLab's variables), else the text around.
_STYLE = """
.uwbbench{font-size:13px;line-height:1.45;max-width:60em;overflow-wrap:anywhere}
.uwbbench .kind{opacity:.7}
.uwbbench .simulated{border:1px solid currentColor;border-radius:3px;padding:0 .35em;font-size:85%}
.uwbbench table.facts,.uwbbench table.rows{border-collapse:collapse;margin:.4em 0;display:block;overflow-x:auto}
.uwbbench th,.uwbbench td{padding:.1em .8em .1em 0;text-align:left;vertical-align:top;background:none;font-size:13px}
.uwbbench table.rows th,.uwbbench table.rows td:not(:last-child){overflow-wrap:normal}
.uwbbench td.number{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}
.uwbbench table.facts th{font-weight:normal;opacity:.7;white-space:nowrap}
.uwbbench table.rows thead th{border-bottom:1px solid currentColor}
.uwbbench details{border-left:3px solid var(--jp-brand-color1,#0072b2);padding-left:.6em;margin:.25em 0}
.uwbbench details.optional{border-left-style:dashed}
.uwbbench summary{cursor:pointer}
.uwbbench ul{margin:.3em 0;padding-left:1.3em}
.uwbbench svg{max-width:100%;height:auto}
""".replace("\n", "")


def text(value: object) -> str:
    r"""Value as escaped text on one line, cut where it is very long.

    Examples
    --------
    >>> text("<b>run\n1</b>")
    '&lt;b&gt;run 1&lt;/b&gt;'
    """
    return html.escape(one_line(value, LONGEST))


def frame(kind: str, name: object, *parts: str, simulated: bool = False) -> str:
    """Everything about one object, under its kind and name.

    Parameters
    ----------
    kind : str
        What it is, such as "capture".
    name : object
        Escaped here.
    *parts : str
        Markup already.
    simulated : bool
        Whether to say SIMULATED beside the name.
    """
    label = ' <span class="simulated">SIMULATED</span>' if simulated else ""
    head = f'<div><span class="kind">{text(kind)}</span> <strong>{text(name)}</strong>{label}</div>'
    return f'<div class="uwbbench"><style>{_STYLE}</style>{head}{"".join(parts)}</div>'


def facts(named: Mapping[str, object]) -> str:
    """Named facts, one a line; empty ones are left out."""
    lines = [
        f"<tr><th scope='row'>{text(key)}</th><td>{text(value)}</td></tr>" for key, value in named.items() if value
    ]
    return f'<table class="facts"><tbody>{"".join(lines)}</tbody></table>' if lines else ""


def table(columns: Sequence[str], rows: Iterable[Sequence[object]], numbers: bool = False) -> str:
    """Table with a head.

    Parameters
    ----------
    columns : sequence of str
    rows : iterable of sequence of object
        As many cells as columns in each; escaped here.
    numbers : bool
        Align all columns but the first to the right.
    """
    head = "".join(f"<th scope='col'>{text(column)}</th>" for column in columns)
    body = "".join(f"<tr>{_cells(row, numbers)}</tr>" for row in rows)
    return f'<table class="rows"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>'


def _cells(row: Sequence[object], numbers: bool) -> str:
    look = ' class="number"' if numbers else ""
    return "".join(f"<td{look if place else ''}>{text(cell)}</td>" for place, cell in enumerate(row))


def notes(lines: Iterable[object]) -> str:
    """What a reader must know, as a list; nothing where there is nothing to say."""
    items = "".join(f"<li>{text(line)}</li>" for line in lines)
    return f"<ul>{items}</ul>" if items else ""


def folded(summary: str, *parts: str, optional: bool = False) -> str:
    """Parts that fold out below a summary, which is markup already."""
    look = ' class="optional"' if optional else ""
    return f"<details{look}><summary>{summary}</summary>{''.join(parts)}</details>"
