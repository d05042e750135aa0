"""The page: rows of numbers beside the paper's, figures, sections, and the HTML of all."""

import math
import re
from dataclasses import dataclass, field
from xml.sax.saxutils import escape, quoteattr

from mpp_taichi.accuracy import svg
from mpp_taichi.accuracy.report import framed
from mpp_taichi.accuracy.svg import Plot

SAME, HOLDS, CURED, WRONG, APART, EMPTY = "same digits", "holds", "limit lifted", "paper is wrong", "differs", ""
PICTURES, BROAD = '<div class="pictures">', ' class="broad"'
STYLE = """
.paper { width: 100%; table-layout: fixed } .paper th, .paper td { white-space: normal; vertical-align: top; text-align: left }
.paper th { box-sizing: border-box } .paper th:nth-child(1), .paper th:nth-child(6) { width: 9% }
.paper th:nth-child(2), .paper th:nth-child(3) { width: 15% } .paper th:nth-child(4) { width: 20% }
.paper th:nth-child(5) { width: 8% }
.paper td.number, .paper th:nth-child(5) { text-align: right }
.paper .wrong td { background: color-mix(in srgb, #d23c3c 14%, transparent) }
.paper .differs td { background: color-mix(in srgb, #b97a00 22%, transparent) }
.figures { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 480px), 1fr)); gap: 1.2rem;
  margin: 1.2rem 0 }
.figures .broad { grid-column: 1 / -1 } .pictures { display: flex; flex-wrap: wrap; gap: .6rem }
.pictures div { flex: 1 1 280px; max-width: 640px; min-width: 0 }
.paper { min-width: 900px } .pictures span { font-size: .8rem }
.pictures img { width: 100%; height: auto; display: block; border-radius: 4px } .plot { max-width: 720px }
section { margin: 2.4rem 0 } .theirs { font-style: italic } .seconds { font-size: .8rem }
pre { background: var(--field); padding: .6rem; overflow: auto; font-size: .78rem; max-height: 400px; margin: 0 }
nav a { margin-right: .9rem } a { color: inherit } figcaption { max-width: 60rem; margin-top: .3rem }
.legend { margin: .1rem 0; font-size: .85rem }
"""


@dataclass(frozen=True)
class Row:
    """One statement of the paper beside what came out here.

    paper    as printed, a number with all its digits, or words
    ours     a number that was computed or measured, or words made from such
    within   for a number that the paper gives as approximate: the difference allowed; else that of `half_digit`
    holds    for words: whether the run bears them out; None where there is nothing to judge
    correct  what must stand there where the paper is wrong
    cured    `paper` is a limit of the paper's program, and `holds` says that it is none here
    """

    place: str
    what: str
    paper: str
    ours: float | str
    note: str = ""
    within: float | None = None
    holds: bool | None = None
    correct: str = ""
    cured: bool = False

    @property
    def difference(self) -> float | None:
        """Ours − the paper's; None between words."""
        try:
            return float(self.ours) - float(self.paper)
        except ValueError:
            return None

    @property
    def mark(self) -> str:
        """The verdict."""
        if self.difference is None:
            agrees = self.holds
        else:
            allowed = half_digit(self.paper) if self.within is None else self.within
            agrees = abs(self.difference) <= allowed * (1.0 + 1e-6) + 4e-16 * abs(float(self.paper))
        if self.correct and not agrees:
            return WRONG if self._agrees_with_correct() else APART
        if agrees is None:
            return EMPTY
        if self.cured and agrees:
            return CURED
        return (HOLDS if self.difference is None or self.within is not None else SAME) if agrees else APART

    def _agrees_with_correct(self) -> bool:
        """Whether ours is what must stand there, where that is a number."""
        try:
            return abs(float(self.ours) - float(self.correct)) <= half_digit(self.correct)
        except ValueError:
            return True


@dataclass(frozen=True)
class Figure:
    """A drawing, or pictures side by side, with our caption and what the paper says that its figure shows."""

    title: str
    content: str
    caption: str
    paper: str = ""

    @property
    def is_broad(self) -> bool:
        """Whether it takes the width of the page: pictures side by side do."""
        return self.content.startswith(PICTURES) and self.content.count("<div>") > 1


@dataclass
class Section:
    """A part of the paper: what it is about, its numbers and its figures."""

    title: str
    words: str
    rows: list[Row] = field(default_factory=list)
    figures: list[Figure] = field(default_factory=list)
    seconds: float = 0.0


def half_digit(printed: str) -> float:
    """Half a unit of the last digit of a number as it is printed; of whole ones, such as 3072 and 5e3, none but rounding."""
    mantissa, _, exponent = printed.lower().partition("e")
    if "." not in mantissa:
        return 1e-9 * abs(float(printed)) or 1e-12
    return 0.5 * 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


def number(value: float | str, printed: str = "") -> str:
    """A value with two digits more than the paper prints, or six."""
    if isinstance(value, str):
        return value
    if value == int(value) and abs(value) < 1e7:
        return f"{int(value):,}"
    digits = 6
    try:
        if "." in printed and value:
            last = round(math.log10(2.0 * half_digit(printed)))
            digits = min(12, max(4, math.floor(math.log10(abs(value))) - last + 3))
    except ValueError:
        pass
    return f"{value:.{digits}g}"


def page(sections: dict[str, Section], machine: str, circumstances: list[str]) -> str:
    """The whole page; well-formed XML, without scripts, and with nothing from a network."""
    rows = [row for section in sections.values() for row in section.rows]
    counts = {mark: sum(row.mark == mark for row in rows) for mark in (SAME, HOLDS, CURED, WRONG, APART, EMPTY)}
    sentence = (
        f"{len(rows)} numbers and statements of T. Müller, arXiv:1403.1695, beside what this program finds: "
        f"{counts[SAME]} the same in "
        f"every digit printed, {counts[HOLDS]} that hold, {counts[CURED]} limits of the paper’s program that "
        f"are none here, {counts[WRONG]} where the paper is wrong, {counts[APART]} that differ, {counts[EMPTY]} not judged"
    )
    links = [f'<a href="#{name}">{escape(section.title)}</a>' for name, section in sections.items()]
    wrong = [row for row in rows if row.mark in (WRONG, APART)]
    body = [
        f"<style>{STYLE}</style><nav>{' '.join(links)}</nav>",
        *(["<h2>Where the paper is wrong or differs</h2>", table(wrong)] if wrong else []),
        *(_section(name, section) for name, section in sections.items()),
    ]
    return framed("The paper, recomputed", sentence, circumstances, body, machine)


def _section(name: str, section: Section) -> str:
    parts = [f'<section id="{name}"><h2>{escape(section.title)}</h2>', f"<p>{escape(section.words)}</p>"]
    if section.rows:
        parts.append(table(section.rows))
    figures = []
    for figure in section.figures:
        paper = f' <span class="theirs">In the paper: {escape(figure.paper)}</span>' if figure.paper else ""
        caption = f"<figcaption><b>{escape(figure.title)}.</b> {escape(typeset(figure.caption))}{paper}</figcaption>"
        figures.append(f"<figure{BROAD if figure.is_broad else ''}>{figure.content}{caption}</figure>")
    parts.append(f'<div class="figures">{"".join(figures)}</div>')
    return "\n".join([*parts, f'<p class="quiet seconds">{section.seconds:.1f} s</p></section>'])


def typeset(text: str) -> str:
    """Minus signs before and within numbers, and 0 for 0e+00."""
    return re.sub(r"\b0e\+00\b", "0", re.sub(r"(?<![\w.])-(?=\d)|(?<=\de)-(?=\d)", "−", text))


def table(rows: list[Row]) -> str:
    """Place, what, the paper's value, ours, the difference, the mark, and what there is to say."""
    head = "".join(f"<th>{name}</th>" for name in ("where", "what", "paper", "ours", "ours − paper", "", "note"))
    lines = []
    for row in rows:
        apart = row.difference
        told = "" if apart is None else "0" if apart == 0.0 else f"{apart:+.1e}"
        style = {WRONG: "wrong", APART: "differs"}.get(row.mark, "")
        note = " ".join(text for text in (f"Correct: {row.correct}." if row.correct else "", row.note) if text)
        cells = (row.place, row.what, row.paper, number(row.ours, row.paper), told, row.mark, note)
        kind = ["", "", *(['class="number"'] * 3 if apart is not None else [""] * 3), "", ""]
        tags = "".join(f"<td {each}>{escape(typeset(text))}</td>" for text, each in zip(cells, kind, strict=True))
        lines.append(f'<tr class="{style}">{tags}</tr>')
    return f'<div class="wide"><table class="paper"><thead><tr>{head}</tr></thead><tbody>{"".join(lines)}</tbody></table></div>'


def pictures(shown: list[tuple[str, str]]) -> str:
    """Pictures side by side: data URIs and what is written below each."""
    parts = [
        f'<div><img src="{uri}" alt={quoteattr(text)}/><span class="quiet">{escape(text)}</span></div>' for uri, text in shown
    ]
    return f"{PICTURES}{''.join(parts)}</div>"


def drawing(plot: Plot) -> str:
    """A plot, and what its lines are where there are several."""
    several = plot.series if len(plot.series) > 1 else ()
    entries = []
    for series in several:
        style = f"l{series.number % 8}" if series.number >= 0 else "l-front"
        dashes = ' stroke-dasharray="5 4"' if series.dashed else ""
        line = f'<polyline class="{style}"{dashes} points="0,7 26,7"/>' if series.joined else ""
        mark = svg.marker(series.number, 13, 7) if series.marked else ""
        entries.append(f'<li><svg viewBox="0 0 26 14">{line}{mark}</svg>{escape(series.name)}</li>')
    legend = f'<ul class="legend">{"".join(entries)}</ul>' if entries else ""
    return f'<div class="plot">{svg.draw(plot)}{legend}</div>'
