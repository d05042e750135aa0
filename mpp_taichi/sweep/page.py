"""Page: the maps of a sweep for a browser; a click on a member shows its numbers and the command that repeats it."""

import json
import math
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np

from mpp_taichi.accuracy.report import framed
from mpp_taichi.atomic_file import whole_text
from mpp_taichi.plots import map as maps
from mpp_taichi.sweep.picture import SIZE, map_of
from mpp_taichi.sweep.results import SweepResults
from mpp_taichi.version import __version__

MOST_MEMBERS = 100_000  # of a page; with more a browser would load for minutes
DIGITS = 9

SCRIPT = """
const data = JSON.parse(document.getElementById('data').textContent);
function show(member) {
  const rows = [['member', member]];
  data.paths.forEach((path, k) => rows.push([path, data.varied[k][member]]));
  data.names.forEach((name, k) => rows.push([data.units[k] ? `${name} [${data.units[k]}]` : name, data.values[k][member]]));
  rows.push(['status', data.words[data.status[member]]]);
  if (data.reasons[member]) rows.push(['reason', data.reasons[member]]);
  const table = document.getElementById('member');
  table.replaceChildren(...rows.map(([name, value]) => {
    const row = document.createElement('tr');
    for (const text of [name, value === null ? 'no number' : value]) {
      const cell = document.createElement('td');
      cell.textContent = text;
      row.append(cell);
    }
    return row;
  }));
  document.getElementById('command').textContent = data.command + member;
}
for (const map of document.querySelectorAll('svg[data-map]')) {
  map.addEventListener('click', event => {
    const box = map.getBoundingClientRect(), [left, top, right, bottom] = data.field, [columns, lines] = data.shape;
    const x = (event.clientX - box.left) / box.width * data.size[0], y = (event.clientY - box.top) / box.height * data.size[1];
    const column = Math.floor((x - left) / (right - left) * columns), line = Math.floor((bottom - y) / (bottom - top) * lines);
    if (column >= 0 && column < columns && line >= 0 && line < lines) show(column * lines + line);
  });
}
for (const row of document.querySelectorAll('tr[data-member]')) row.addEventListener('click', () => show(+row.dataset.member));
show(0);
"""


def write_page(results: SweepResults, path: Path) -> bool:
    """The page of a sweep; False where it has too many members for a page.

    Raises:
        OutputError: it cannot be written.
    """
    if results.count > MOST_MEMBERS:
        return False
    whole_text(path, page(results), "the page of the sweep")
    return True


def page(results: SweepResults) -> str:
    """The page, which needs nothing from elsewhere."""
    counts = ", ".join(f"{number:,} {word}" for word, number in results.counts().items())
    body = ["<p>A click on a member shows its numbers, and the command that runs it by itself.</p>"]
    if results.is_map:
        for name in results.names:
            drawn = maps.draw_svg(map_of(results, name), SIZE)
            body.append(drawn.replace("<svg ", '<svg data-map="1" style="max-width:100%;height:auto;cursor:crosshair" ', 1))
    else:
        body.append(_list(results))
    body.append('<table id="member"></table><p><code id="command"></code></p>')
    body.append(f'<script type="application/json" id="data">{_data(results)}</script><script>{SCRIPT}</script>')
    title = results.store.scene.title or Path(results.store.source).stem
    return framed(f"Sweep of {title}", f"{results.count:,} members: {counts}", [], body, f"mpp_taichi {__version__}")


def _list(results: SweepResults) -> str:
    """A row for each of the first members, to be clicked."""
    paths = [axis.path for axis in results.store.plan.axes]
    rows = [f"<tr><th>member</th>{''.join(f'<th>{escape(each)}</th>' for each in (*paths, *results.names))}</tr>"]
    for member, given in enumerate(results.store.plan.values(range(min(results.count, 1000)))):
        measured = [_number(results.column(name)[member]) for name in results.names]
        cells = "".join(f"<td>{escape(str(each))}</td>" for each in (*map(_number, given.values()), *measured))
        rows.append(f'<tr data-member="{member}"><td>{member}</td>{cells}</tr>')
    return f'<div class="wide"><table>{"".join(rows)}</table></div>'


def _data(results: SweepResults) -> str:
    columns = results.store.plan.columns(np.arange(results.count))
    words = sorted(set(results.status.tolist()))
    reasons = results.column("reason")
    frame = maps.MapFrame(SIZE, maps.letters_of(SIZE))
    found = {
        "paths": list(columns),
        "varied": [[_number(each) for each in column.tolist()] for column in columns.values()],
        "names": results.names,
        "units": [results.units.get(name, "") for name in results.names],
        "values": [[_number(each) for each in results.column(name).tolist()] for name in results.names],
        "words": words,
        "status": [words.index(each) for each in results.status.tolist()],
        "reasons": {k: str(each) for k, each in enumerate(reasons.tolist()) if each},
        "command": f"mpp-taichi run {results.store.folder} --member ",
        "size": list(SIZE),
        "field": list(frame.field),
        "shape": [results.shape[k] for k in results.wide] if results.is_map else [0, 0],
    }
    return json.dumps(found, separators=(",", ":")).replace("</", "<\\/")


def _number(value: Any) -> Any:
    """A number with so many digits as a reader wants; None where it is none."""
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None
    return value
