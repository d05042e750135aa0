"""The page: rows of numbers beside the paper's, figures, sections, and the HTML of all."""

import math
from dataclasses import dataclass, field
from xml.sax.saxutils import escape, quoteattr

from mpp_taichi.accuracy.report import framed

SAME, HOLDS, CURED, WRONG, APART, EMPTY = "same digits", "holds", "limit lifted", "paper is wrong", "differs", ""
STYLE = """
.paper td { white-space: normal; vertical-align: top; max-width: 30rem } .paper td:nth-child(n+3) { text-align: right }
.paper td:nth-child(7) { text-align: left } .paper .wrong td { background: color-mix(in srgb, #d23c3c 14%, transparent) }
.paper .differs td { background: color-mix(in srgb, #b97a00 22%, transparent) } .mark { white-space: nowrap }
.pictures { display: flex; flex-wrap: wrap; gap: .6rem } .pictures div { flex: 1 1 240px; max-width: 640px }
.pictures img { width: 100%; height: auto; display: block; border-radius: 4px } .pictures span { font-size: .8rem }
section { margin: 2.2rem 0 } figure { margin: 1rem 0 } .plot { max-width: 720px } .theirs { font-style: italic }
pre { background: var(--field); padding: .6rem; overflow-x: auto; font-size: .78rem; max-height: 420px; margin: 0 }
nav a { margin-right: .9rem } a { color: inherit } figcaption { max-width: 60rem }
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
            return WRONG
        if agrees is None:
            return EMPTY
        if self.cured and agrees:
            return CURED
        return (HOLDS if self.difference is None or self.within is not None else SAME) if agrees else APART


@dataclass(frozen=True)
class Figure:
    """A drawing, or pictures side by side, with our caption and what the paper says that its figure shows."""

    title: str
    content: str
    caption: str
    paper: str = ""


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
        return f"{int(value):,}".replace("-", "−")
    digits = 6
    try:
        if "." in printed and value:
            last = round(math.log10(2.0 * half_digit(printed)))
            digits = min(12, max(4, math.floor(math.log10(abs(value))) - last + 3))
    except ValueError:
        pass
    return f"{value:.{digits}g}".replace("-", "−")


def page(sections: dict[str, Section], machine: str, circumstances: list[str]) -> str:
    """The whole page; well-formed XML, without scripts, and with nothing from a network."""
    rows = [row for section in sections.values() for row in section.rows]
    counts = {mark: sum(row.mark == mark for row in rows) for mark in (SAME, HOLDS, CURED, WRONG, APART)}
    sentence = (
        f"{len(rows)} numbers and statements of T. Müller, arXiv:1403.1695, beside what this program finds: {counts[SAME]} the same in "
        f"every digit printed, {counts[HOLDS]} that hold, {counts[CURED]} limits of the paper’s program that "
        f"are none here, {counts[WRONG]} where the paper is wrong, {counts[APART]} that differ"
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
    for figure in section.figures:
        paper = f' <span class="theirs">In the paper: {escape(figure.paper)}</span>' if figure.paper else ""
        caption = f"<figcaption><b>{escape(figure.title)}.</b> {escape(figure.caption)}{paper}</figcaption>"
        parts.append(f"<figure>{figure.content}{caption}</figure>")
    return "\n".join([*parts, f'<p class="quiet">{section.seconds:.1f} s</p></section>'])


def table(rows: list[Row]) -> str:
    """Place, what, the paper's value, ours, the difference, the mark, and what there is to say."""
    head = "".join(f"<th>{name}</th>" for name in ("where", "what", "paper", "ours", "ours − paper", "", "note"))
    lines = []
    for row in rows:
        apart = row.difference
        told = "" if apart is None else "0" if apart == 0.0 else f"{apart:+.1e}".replace("-", "−")
        style = {WRONG: "wrong", APART: "differs"}.get(row.mark, "")
        note = " ".join(text for text in (f"Correct: {row.correct}." if row.correct else "", row.note) if text)
        cells = (row.place, row.what, row.paper.replace("-", "−"), number(row.ours, row.paper), told, row.mark, note)
        tags = "".join(f"<td>{escape(text)}</td>" for text in cells)
        lines.append(f'<tr class="{style}">{tags}</tr>')
    return f'<div class="wide"><table class="paper"><thead><tr>{head}</tr></thead><tbody>{"".join(lines)}</tbody></table></div>'


def pictures(shown: list[tuple[str, str]]) -> str:
    """Pictures side by side: data URIs and what is written below each."""
    parts = [f'<div><img src="{uri}" alt={quoteattr(text)}/><span class="quiet">{escape(text)}</span></div>' for uri, text in shown]
    return f'<div class="pictures">{"".join(parts)}</div>'


def drawing(markup: str, legend: str = "") -> str:
    """A plot of its own width, and what its lines are."""
    return f'<div class="plot">{markup}{f"<p class=quiet>{escape(legend)}</p>" if legend else ""}</div>'.replace(
        "class=quiet", 'class="quiet"'
    )
