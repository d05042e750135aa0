"""Report: a comparison as one HTML page with plots, readable without a network, in light and in dark; well-formed XML too."""

import math
from collections.abc import Sequence
from typing import Any
from xml.sax.saxutils import escape

from mpp_taichi.accuracy import svg
from mpp_taichi.accuracy.report import framed
from mpp_taichi.accuracy.svg import Plot, PlotMark, Series
from mpp_taichi.compare import table
from mpp_taichi.compare.words import EXPLANATION, circumstances, machine


def page(found: dict[str, Any]) -> str:
    """The page; `found` is the comparison as plain data, with its `sentence`."""
    title = f"Backends side by side: {found['title'] or found['scene']}"
    numbers = {name: k for k, name in enumerate(dict.fromkeys(row["label"] for row in found["rows"]))}
    figures = [
        f'<figure style="max-width: 760px">{svg.draw(plot)}<figcaption>{escape(" ".join(plot.notes))}</figcaption></figure>'
        for plot in _plots(found, numbers)
    ]
    body = [
        _table(found["rows"]),
        f'<p class="key">{escape(EXPLANATION)}</p>',
        _legend(found["rows"], numbers),
        f'<div class="plots">{"".join(figures)}</div>',
        "<h2>Every comparison with the reference</h2>",
        f'<p class="quiet">{escape(_chance(found))}</p>',
        _findings(found["rows"]),
    ]
    return framed(title, found["sentence"], circumstances(found), body, machine(found))


def _chance(found: dict[str, Any]) -> str:
    return (
        "Allowances are derived from the number of roundings and from what the motion makes of them; the chance that a sound "
        f"backend exceeds one is {found['chance_of_false_alarm']:.0e} for a certificate."
    )


def _plots(found: dict[str, Any], numbers: dict[str, int]) -> list[Plot]:
    plots = []
    apart = [series for row in found["rows"] for series in _apart(row, numbers)]
    if apart:
        said = "Largest distance of a particle from the reference, or later from a backend; dashed: what rounding may make."
        plots.append(Plot("Distance from the reference", "steps", "distance, of the system’s size", apart, (said,)))
    curves = [
        Series(
            f"{row['label']} {row['precision']}",
            numbers[row["label"]],
            [
                PlotMark(point["particle_count"], 1.0 / point["step_seconds"], f"{row['label']} {row['precision']}")
                for point in row["scaling"]
            ],
            dashed=row["precision"] != "f64",
            labelled=True,
        )
        for row in found["rows"]
        if row["scaling"]
    ]
    if curves:
        said = "Generated scenes of the same effects. Dashed: not f64."
        plots.append(Plot("Steps per second", "particles", "steps / s", curves, (said,)))
    return plots


def _apart(row: dict[str, Any], numbers: dict[str, int]) -> list[Series]:
    looks = [*row.get("looks", ()), *row.get("looks_beside", {}).get("looks", ())]
    name, number = f"{row['label']} {row['precision']}", numbers[row["label"]]
    apart = [PlotMark(look["steps"], _finite(look["distance"]), name) for look in looks]
    allowed = [PlotMark(look["steps"], _finite(look["allowed"])) for look in looks]
    return [
        Series(name, number, apart, labelled=True),
        Series(f"{name}: allowed", number, allowed, marked=False, dashed=True),
    ]


def _finite(value: float | None) -> float:
    """A number to draw; None stands for a number that is not finite, which plots leave out."""
    return math.nan if value is None else value


def _legend(rows: Sequence[dict[str, Any]], numbers: dict[str, int]) -> str:
    """An entry for each backend and precision: a colour for a backend, and a dashed line for all precisions but f64."""
    entries = []
    for row in rows:
        if row["status"] != "ok":
            continue
        number, dashes = numbers[row["label"]], "" if row["precision"] == "f64" else ' stroke-dasharray="5 4"'
        line = f'<polyline class="l{number % 8}"{dashes} points="0,7 26,7"/>'
        name = escape(f"{row['label']} {row['precision']}")
        entries.append(f'<li><svg viewBox="0 0 26 14">{line}{svg.marker(number, 13, 7)}</svg>{name}</li>')
    return f'<ul class="legend">{"".join(entries)}</ul>'


def _table(rows: Sequence[dict[str, Any]]) -> str:
    columns = table.head(rows)
    body = [(table.cells(row, columns), "broken" if row["status"] != "ok" else "") for row in rows]
    return _html_table(columns, body, style="many")


def _findings(rows: Sequence[dict[str, Any]]) -> str:
    head = ("backend", "", "comparison", "off", "allowed", "share", "of", "particle", "looked at")
    body = []
    for row in rows:
        for finding in row.get("findings", ()):
            ratio = finding["ratio"]
            texts = (
                row["label"],
                row["precision"],
                finding["check"],
                *(table.number(finding[key]) for key in ("difference", "allowance")),
                "∞" if ratio is None else f"{ratio:.2g}",
                finding["of"],
                f"{finding['particle']:,}",
                finding["looked_at"],
            )
            body.append((texts, ""))
    return _html_table(head, body)


def _html_table(head: Sequence[str], body: Sequence[tuple[Sequence[str], str]], *, style: str = "") -> str:
    top = "".join(f"<th>{escape(name)}</th>" for name in head)
    rows = []
    for texts, row_style in body:
        tags = [f"<td>{escape(text)}</td>" for text in texts]
        if len(texts) < len(head):  # the last text has the rest of the row
            tags[-1] = f'<td colspan="{len(head) - len(texts) + 1}" style="text-align: left">{escape(texts[-1])}</td>'
        rows.append(f'<tr class="{row_style}">{"".join(tags)}</tr>')
    return f'<div class="wide"><table class="{style}"><thead><tr>{top}</tr></thead><tbody>{"".join(rows)}</tbody></table></div>'
