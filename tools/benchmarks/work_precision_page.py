"""The picture of benchmark_work_precision.py: one panel for each problem, drawn as the program's own reports are."""

import tempfile
from pathlib import Path

import numpy as np
from headless_browser import HeadlessBrowser
from work_precision_ours import is_ours

COLUMNS, PANEL = 3, 520
# One curve for all methods of a kind, the front of their runs: colour and marker by number, and which contenders belong to it.
CURVES = {
    "our methods": (0, is_ours),
    "heyoka, Taylor": (2, lambda name: name == "heyoka"),
    "REBOUND leapfrog, orders 2 and 8": (1, lambda name: "rebound leapfrog" in name),
    "REBOUND WHFast and SABA": (7, lambda name: "whfast" in name or "saba" in name),
    "REBOUND Bulirsch–Stoer": (3, lambda name: name == "rebound bs"),
    "REBOUND IAS15": (4, lambda name: name == "rebound ias15"),
    "SciPy DOP853": (5, lambda name: name == "scipy dop853"),
}
STYLE = (
    f"body {{ max-width: none; width: {COLUMNS * PANEL}px; margin: 0; padding: 12px; background: #fff }}"
    "body { display: flex; flex-wrap: wrap }"
    f"section {{ width: {PANEL - 12}px; margin: 0 6px 8px }} h2 {{ font-size: 17px; margin: 0 0 0 56px }}"
    "ul.legend { width: 100%; justify-content: center; font-size: 16px; margin: 4px 0 10px }"
    "svg .tick { font-size: 14px !important } svg .label { font-size: 15px !important } svg polyline { stroke-width: 2 }"
)


def front(rows):
    """The runs than which none is both faster and better, from the fastest on."""
    best, least = [], np.inf
    for row in sorted(rows, key=lambda row: row[2]):
        if row[1] < least:
            least = row[1]
            best.append(row)
    return best


def page(results):
    """One HTML page with a plot of each problem, and one legend."""
    from mpp_taichi.accuracy.report import style_sheet
    from mpp_taichi.accuracy.svg import Plot, PlotMark, Series, draw, marker

    keys = "".join(f'<li><svg viewBox="0 0 26 14">{marker(k, 13, 7)}</svg>{name}</li>' for name, (k, _) in CURVES.items())
    parts = [f"<!doctype html><meta charset='utf-8'><title>Work and precision</title><style>{style_sheet()}{STYLE}</style>"]
    parts.append(f"<ul class='legend'>{keys}</ul>")
    for result in results.values():
        series = []
        for name, (k, belongs) in CURVES.items():
            rows = front(
                row for contender, rows in result["runs"].items() if belongs(contender) for row in rows if row[1] <= 1.0
            )
            marks = [PlotMark(row[2], row[1], f"{row[0]}: {row[1]:.1e}, {1e3 * row[2]:.3g} ms") for row in rows]
            if marks:
                series.append(Series(name, k, marks))
        plot = Plot(result["title"], "processor time of the steps [s]", "error of the positions at the end", series)
        parts.append(f"<section><h2>{result['title']}</h2>{draw(plot)}</section>")
    return "\n".join(parts)


def picture(results):
    """The page as a PNG, in light colours."""
    rows = -(-len(results) // COLUMNS)
    with tempfile.TemporaryDirectory() as folder, HeadlessBrowser((COLUMNS * PANEL + 24, rows * 370 + 70)) as browser:
        path = Path(folder) / "page.html"
        path.write_text(page(results), encoding="utf-8")
        browser.ask("Page.navigate", url=path.resolve().as_uri())
        browser.wait_for("document.querySelectorAll('section').length > 0")
        browser.settle()
        return browser.picture()
