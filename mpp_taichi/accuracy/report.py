"""Report: one HTML page about a study, with plots, readable without a network, in light and in dark; well-formed XML too."""

import itertools
import math
from collections.abc import Sequence
from typing import Any
from xml.sax.saxutils import escape

from mpp_taichi.accuracy import svg, table
from mpp_taichi.accuracy.front import StudyRow
from mpp_taichi.accuracy.prominent import Key, groups, prominent
from mpp_taichi.accuracy.svg import Plot, PlotMark, Series
from mpp_taichi.accuracy.verdict import duration

LIGHT = ("#2a6fcf", "#0f8a5f", "#b97a00", "#5b3db0", "#d23c3c", "#c2528b", "#0a7f8c", "#7a5a36")
DARK = ("#6ea8ff", "#3ccb98", "#e8b13a", "#a994ff", "#ff7d7d", "#f08cc0", "#4cc6d4", "#c9a47a")
EPSILON = 2.0**-52
DECADES_APART = 2  # energy errors of two runs in the plot of energies
STYLE = """
:root { color-scheme: light dark; --paper: #ffffff; --field: #fafafa; --ink: #1c1f24; --quiet: #5a616b; --line: #d9dde3; %s }
@media (prefers-color-scheme: dark) { :root { --paper: #14171b; --field: #1a1e23; --ink: #e8eaed; --quiet: #a3abb6;
  --line: #353b44; %s } }
body { background: var(--paper); color: var(--ink); font: 15px/1.5 system-ui, sans-serif; max-width: 1360px;
  margin: 1.5rem auto; padding: 0 1rem; }
h1 { font-size: 1.5rem; margin: 0 0 .3rem } h2 { font-size: 1.1rem; margin: 1.6rem 0 .4rem }
.said { font-size: 1.15rem; max-width: 60rem } .quiet { color: var(--quiet) }
.plots { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%%, 520px), 1fr)); gap: 1rem }
figure { margin: 0 } figcaption { color: var(--quiet); font-size: .85rem }
svg { width: 100%%; height: auto; font: 12px system-ui, sans-serif }
svg text { fill: var(--quiet) } svg .label { fill: var(--ink); font-size: 13px }
.field { fill: var(--field) } .grid { stroke: var(--line); stroke-width: 1 }
.ring { fill: none; stroke: var(--ink); stroke-width: 1.5 }
polyline { fill: none; stroke-width: 1.6 } .hollow { fill: var(--paper); stroke-width: 1.6 }
.l-front { stroke: var(--quiet) } .cq { fill: var(--quiet); stroke: var(--quiet) }
.rest { opacity: .3 } .rest polyline { stroke-width: 1.1; pointer-events: stroke }
.rest:hover { opacity: 1 } .rest:hover polyline { stroke-width: 3; stroke: var(--ink) } .rest:hover .cq { fill: var(--ink) }
.many th, .many td { padding: .15rem .38rem } .many :is(th, td):last-child { white-space: normal; text-align: left }
.key { color: var(--quiet); max-width: 60rem }
.legend { display: flex; flex-wrap: wrap; gap: .3rem 1.1rem; list-style: none; padding: 0 }
.legend svg { width: 26px; height: 14px; vertical-align: middle; margin-right: .35rem }
.wide { overflow-x: auto } table { border-collapse: collapse; font-size: .88rem; font-variant-numeric: tabular-nums }
th, td { padding: .15rem .7rem; text-align: right; border-bottom: 1px solid var(--line); white-space: nowrap }
th:nth-child(-n+3), td:nth-child(-n+3) { text-align: left } .front td { font-weight: 600 } .broken td { color: var(--quiet) }
"""


def page(found: dict[str, Any], rows: Sequence[StudyRow], phases: Sequence[Sequence[StudyRow]] = ()) -> str:
    """The page; `found` is the study as plain data with `verdict` and `sentence`; `phases` are the rows of each phase."""
    shown = [] if found["quantity"] is None else prominent(rows, found["verdict"], found["quantity"])
    numbers = {name: k for k, name in enumerate(dict.fromkeys(integrator for integrator, _, _ in shown))}
    title = f"What accuracy costs: {found['title'] or found['scene']}"
    plots = _plots(found, rows, numbers, shown)
    figures = [f"<figure>{svg.draw(plot)}<figcaption>{escape(' '.join(plot.notes))}</figcaption></figure>" for plot in plots]
    body = [
        _legend(rows, numbers),
        f'<div class="plots">{"".join(figures)}</div>',
        "<h2>Every run</h2>",
        _table(rows, found["verdict"], wanted_of(found)),
        f'<p class="key">{escape(" ".join(table.key(wanted_of(found))))}</p>',
        *(_phase(*each) for each in zip(found["phases"], phases)),
    ]
    return framed(title, found["sentence"], circumstances(found), body, machine(found))


def framed(title: str, sentence: str, circumstances: Sequence[str], body: Sequence[str], machine: str) -> str:
    """A page of a report: its title, the sentence that sums it up, the circumstances, the body, and the machine."""
    parts = [
        "<!DOCTYPE html>",
        '<html lang="en" xmlns="http://www.w3.org/1999/xhtml"><head><meta charset="utf-8"/>',
        '<meta name="viewport" content="width=device-width, initial-scale=1"/>',
        f"<title>{escape(title)}</title><style>{style_sheet()}</style></head><body>",
        f"<h1>{escape(title)}</h1>",
        f'<p class="said">{escape(sentence[:1].upper() + sentence[1:])}.</p>',
        *(f'<p class="quiet">{escape(line)}</p>' for line in circumstances),
        *body,
        "<h2>Where and with what</h2>",
        f'<p class="quiet">{escape(machine)}</p>',
        "</body></html>",
    ]
    return "\n".join(parts)


def wanted_of(found: dict[str, Any]) -> str | None:
    """The name of the quantity of `expect:` that was asked for; None for positions and energies."""
    return None if found["wanted"] is None else str(found["wanted"])


def circumstances(found: dict[str, Any]) -> list[str]:
    """The reference, the chaos and the omissions of a study: lines for a person."""
    reference, chaos = found["reference"], found["chaos"]
    span = f"Over t = {found['span']:.6g}"
    if found["span"] < found["whole_span"]:
        span += f", the first part of the scene's {found['whole_span']:.6g}"
    lines = [f"{span}; {found['particle_count']:,} particles."]
    if found["wanted"] is not None:
        known = found["values"]
        lines.append(
            f"There is no reference: {found['quantity_because']}." if known is None else f"Reference: {known['told']}."
        )
        if known is not None and known["runs"] > 1:
            lines.append(_scatter(found["wanted"], known))
    elif reference is None:
        lines.append(f"There is no reference: {found['quantity_because']}.")
    else:
        shown = f"its end positions are good to {reference['bar']:.0e} of the system's size ({reference['size']:.4g})"
        if not reference["trusted"]:
            shown = f"it was not shown to have converged; two of its runs differ by {reference['bar']:.0e} of the system's size"
        lines.append(f"Reference: {reference['integrator']}, f64, {reference['steps']:,} steps; {shown}.")
        if reference["meaning"] is not None:
            lines.append(f"Positions of two of its runs agree until t = {reference['meaning']:.4g}.")
    if found["quantity"] == "energy":
        lines.append(f"Energies are compared: {found['quantity_because']}.")
    if chaos is not None and chaos["lyapunov_time"] is not None:
        lines.append(
            f"The motion is chaotic: Lyapunov time {chaos['lyapunov_time']:.3g}. Round-off reaches a thousandth of the "
            f"system's size after t = {chaos['horizon_f64']:.3g} in f64, {chaos['horizon_f32']:.3g} in f32."
        )
    return [*lines, *(f"Left undone: {remark}." for remark in found["remarks"])]


def _scatter(name: str, known: dict[str, Any]) -> str:
    largest = max(scatter / scale for scatter, scale in zip(known["scatters"], known["scales"]))
    runs, shift = known["runs"], known["shift"]
    by = f"starts that differ by {shift:g} of the system's size over the run decide it" if shift else "rounding decides it"
    told = f"{name} of a single run scatters by {largest:.1e}, as {by}: every setting is the mean of {runs} runs"
    return f"{told}, and a number with ≤ says that it differs by less than their scatter."


def machine(found: dict[str, Any]) -> str:
    """Machine, versions and effort in one line."""
    known = found["known"]
    versions = ", ".join(f"{name} {known[name]}" for name in ("mpp_taichi", "taichi", "numpy", "python"))
    effort = f"{found['spent_seconds']:.0f} s of a budget of {found['budget_seconds']:.0f} s, {len(found['rows'])} runs"
    again = f", {found['resumed_samples']} of them from before" if found["resumed_samples"] else ""
    others = "".join(f"; {backend}: {device}" for backend, device in found["other_devices"].items())
    return f"{known['cpu']}, {known['system']}{others}; {versions}; {effort}{again}; {found['status']}"


def _plots(found: dict[str, Any], rows: Sequence[StudyRow], numbers: dict[str, int], shown: Sequence[Key]) -> list[Plot]:
    quantity = found["quantity"]
    if quantity is None:
        return []
    told = f"error of {'position at the end' if quantity == 'position' else quantity}"
    verdict = found["verdict"]
    ringed = (
        "In colour: the front, the scene’s own setting and well-known methods. Grey: all others, named under the pointer. "
        "Rings: the front. Hollow: at most so much, the reference is no better. Dashed: not f64."
    )
    return [
        Plot(
            "Error against time",
            "time of the stepping [s]",
            told,
            _work(rows, numbers, shown, quantity, verdict["time_front"], lambda row: row.seconds or math.nan),
            (ringed,),
        ),
        Plot(
            "Error against force evaluations",
            "force evaluations",
            told,
            _work(rows, numbers, shown, quantity, verdict["evaluations_front"], lambda row: float(row.sample.evaluations)),
            (ringed,),
        ),
        *([_drift(rows, numbers, verdict)] if any(row.sample.energy_errors for row in rows) else []),
    ]


def _work(
    rows: Sequence[StudyRow],
    numbers: dict[str, int],
    shown: Sequence[Key],
    quantity: str,
    front: Sequence[str],
    cost: Any,
) -> list[Series]:
    """A series for each method, precision and backend; those that are not `shown` are grey, and have no number."""
    series = []
    found = groups(rows)
    for integrator, precision, backend in (*(key for key in found if key not in shown), *shown):
        group, is_shown = found[integrator, precision, backend], (integrator, precision, backend) in shown
        points = []
        for row in sorted(group, key=lambda row: row.sample.dt, reverse=True):
            error = row.error(quantity)
            if not error.bound < 10.0:
                continue
            said = f"{integrator} {precision} {backend}, {row.sample.setting}: {error}, {duration(row.seconds)}"
            strong = row.sample.configuration.key in front
            points.append(PlotMark(cost(row), error.bound, said, strong=strong, bound=error.value is None))
        number = numbers[integrator] if is_shown else -1
        name = _short_name(integrator, precision, backend) if is_shown else f"{integrator} {precision} {backend}"
        series.append(Series(name, number, points, dashed=precision != "f64", labelled=is_shown))
    return series


def _short_name(integrator: str, precision: str, backend: str) -> str:
    """The name at the end of a line: f64 and the CPU are not told."""
    return " ".join([integrator, *([precision] if precision != "f64" else []), *([backend] if backend != "cpu" else [])])


def _drift(rows: Sequence[StudyRow], numbers: dict[str, int], verdict: dict[str, Any]) -> Plot:
    """The largest energy error up to each time, for some rows, and the error by nothing but round-off."""
    shown = _some(rows, verdict)
    series = []
    for row in shown:
        configuration = row.sample.configuration
        name = f"{configuration.integrator} {configuration.precision}, {row.sample.setting}"
        highest = itertools.accumulate(row.sample.energy_errors, max)
        points = [PlotMark(time, error, name) for time, error in zip(row.sample.times, highest)]
        number, dashed = numbers.get(configuration.integrator, -1), configuration.precision != "f64"
        series.append(Series(name, number, points, marked=False, dashed=dashed, labelled=True))
    if shown:
        finest = min(shown, key=lambda row: row.sample.dt).sample
        points = [PlotMark(time, EPSILON * math.sqrt(time / finest.dt)) for time in finest.times if time > 0.0]
        series.append(Series("√t: a random walk of round-off", -1, points, marked=False, dashed=True))
    said = "The scene’s own setting, and of the front one run for each decade of error. Grey: 2⁻⁵² √steps, the random walk of "
    said += "round-off in f64 at the finest of these steps."
    return Plot("Energy error over time", "t", "largest relative energy error until then", series, (said,))


def _some(rows: Sequence[StudyRow], verdict: dict[str, Any]) -> list[StudyRow]:
    """The scene's own setting, and the front's rows whose energy errors are decades apart."""
    found: dict[int, StudyRow] = {}
    for row in rows:
        energy = row.sample.energy
        if energy and row.sample.configuration.key in verdict["time_front"]:
            found.setdefault(round(math.log10(energy) / DECADES_APART), row)
    return [*found.values(), *(row for row in rows if row.is_own and row.sample.energy and row not in found.values())]


def _legend(rows: Sequence[StudyRow], numbers: dict[str, int]) -> str:
    used = {integrator for integrator, _, _ in groups(rows)}
    entries = []
    for name, number in numbers.items():
        if name in used:
            line = f'<polyline class="l{number % 8}" points="0,7 26,7"/>'
            entries.append(f'<li><svg viewBox="0 0 26 14">{line}{svg.marker(number, 13, 7)}</svg>{escape(name)}</li>')
    if others := len(used - set(numbers)):
        line = '<g class="rest"><polyline class="l-front" points="0,7 26,7"/></g>'
        entries.append(f'<li><svg viewBox="0 0 26 14">{line}</svg>{others} more method{"s" if others > 1 else ""}</li>')
    return f'<ul class="legend">{"".join(entries)}</ul>'


def _phase(facts: dict[str, Any], rows: Sequence[StudyRow]) -> str:
    """A phase of a timeline: its sentence and its runs."""
    said = facts["sentence"]
    parts = [facts["told"], f"{said[:1].upper()}{said[1:]}."]
    heading, sentence = (escape(f"{part[:1].upper()}{part[1:]}") for part in parts)
    return f"<h2>{heading}</h2><p>{sentence}</p>{_table(rows, facts['verdict'], None)}"


def _table(rows: Sequence[StudyRow], verdict: dict[str, Any], wanted: str | None) -> str:
    fronts = {name: verdict.get(f"{name}_front", ()) for name in ("time", "evaluations")}
    joules = table.has_joules(rows)
    names = table.head(wanted, joules=joules)
    head = "".join(f"<th>{escape(name)}</th>" for name in names)
    body = []
    for row in rows:
        cells = table.cells(row, fronts, wanted, joules=joules)
        style = "broken" if row.sample.status != "ok" else "front" if row.sample.configuration.key in fronts["time"] else ""
        last = len(cells) - 1
        span = len(names) - last
        tags = "".join(
            f'<td colspan="{span}">{escape(text)}</td>' if span > 1 and k == last else f"<td>{escape(text)}</td>"
            for k, text in enumerate(cells)
        )
        body.append(f'<tr class="{style}">{tags}</tr>')
    return f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{"".join(body)}</tbody></table></div>'


def style_sheet() -> str:
    """The style sheet of a page, with the colours of its series in light and dark."""
    light, dark = (" ".join(f"--s{k}: {color};" for k, color in enumerate(colors)) for colors in (LIGHT, DARK))
    rules = ".c{k} { fill: var(--s{k}); stroke: var(--s{k}) } .l{k} { stroke: var(--s{k}) } svg .n{k} { fill: var(--s{k}) }\n"
    series = "".join(rules.replace("{k}", str(k)) for k in range(8))
    return STYLE.replace("%%", "%").replace("%s", light, 1).replace("%s", dark, 1) + series + ".hollow { fill: var(--paper) }"
