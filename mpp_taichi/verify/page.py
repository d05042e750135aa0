"""Page: the report of an examination in HTML, readable without a network."""

from typing import Any
from xml.sax.saxutils import escape, quoteattr

from mpp_taichi.accuracy.report import framed
from mpp_taichi.verify.case import GROUPS
from mpp_taichi.verify.case_result import SOLVED
from mpp_taichi.verify.findings import cell

KEY = (
    "A number is the number that was reached, in parts of its bound; exact: no difference at all; refused: the program says in "
    "words why it does not solve the case there; FAILED: a number beyond its bound, a crash, or a refusal where the case has "
    "to be solved; –: not asked. The pointer over a number shows what was reached, the bound and its origin."
)


def page(found: dict[str, Any]) -> str:
    """The page; `found` is verify.json."""
    circumstances = [f"{backend} is not examined: {reason}." for backend, reason in found["missing"].items()]
    body = [f'<p class="key">{escape(KEY)}</p>']
    for group, title in GROUPS.items():
        cases = [case for case in found["cases"] if case["group"] == group]
        if cases:
            body += [f"<h2>{escape(title)}</h2>", _table(cases, found)]
    return framed("Verification of this machine", found["sentence"], circumstances, body, _machine(found))


def _table(cases: list[dict[str, Any]], found: dict[str, Any]) -> str:
    rows = {(row["case"], f"{row['backend']} {row['precision']}"): row for row in found["rows"]}
    heads = "".join(f"<th>{escape(place)}</th>" for place in found["places"])
    parts = [f"<tr><th>question</th><th>answer known from</th><th>name</th>{heads}</tr>"]
    for case in cases:
        cells = [_cell(rows.get((case["name"], place))) for place in found["places"]]
        words = "".join(f'<td style="white-space: normal">{escape(case[key])}</td>' for key in ("title", "source", "name"))
        parts.append(f"<tr>{words}{''.join(cells)}</tr>")
    return f'<div class="wide"><table>{"".join(parts)}</table></div>'


def _cell(row: dict[str, Any] | None) -> str:
    if row is None:
        return "<td>–</td>"
    told = row["reason"]
    if row["bound"] is not None:
        told = f"reached {row['reached']:.3g}, bound {row['bound']:.3g}: {row['because']}"
    strong = (
        "" if row["status"] == SOLVED else ' style="font-weight: 700"' if row["status"] == "failed" else ' style="opacity: .6"'
    )
    return f"<td{strong} title={quoteattr(told)}>{escape(cell(row))}</td>"


def _machine(found: dict[str, Any]) -> str:
    known = found["known"]
    devices = "; ".join(f"{backend}: {device}" for backend, device in known["devices"].items())
    versions = ", ".join(f"{name} {known[name]}" for name in ("mpp_taichi", "taichi", "numpy", "python"))
    return f"{devices}; {known['system']}; {versions}; {found['seconds']:.0f} s of processes"
