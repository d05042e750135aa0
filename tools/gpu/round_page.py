"""Pages of a GPU round: tables in Markdown, and the same tables as a page of HTML."""

import html as escaping

from families import FAMILIES

NOTES = """Pairs count 20 flops each, 30 in f64, as in NVIDIA's N-body sample, whatever a kernel needs; springs count the bytes
of a step without caches: both parts of the limit can be larger than 1. Limits were measured in the same process."""


def markdown(known):
    """All that is known of a round."""
    lines = [f"# GPU round, {known['began']}", "", *(f"- {line}" for line in [*absent(known), *devices(known)]), "", NOTES]
    for heading, table in tables(known):
        lines += ["", f"## {heading}", "", *rows_in_markdown(table)]
    if failures(known):
        lines += ["", "## What failed", "", *(f"- {line}" for line in failures(known))]
    return "\n".join([*lines, ""])


def html(known):
    """The same as a page."""
    parts = [f"<h1>GPU round, {escaping.escape(known['began'])}</h1>"]
    parts += [f"<p>{escaping.escape(line)}</p>" for line in [*absent(known), *devices(known), NOTES]]
    for heading, (head, *rows) in tables(known):
        cells = "".join(f"<th>{escaping.escape(each)}</th>" for each in head)
        body = "".join("<tr>" + "".join(f"<td>{escaping.escape(each)}</td>" for each in row) + "</tr>" for row in rows)
        parts.append(f"<h2>{escaping.escape(heading)}</h2><table><tr>{cells}</tr>{body}</table>")
    parts += ["<h2>What failed</h2>"] if failures(known) else []
    parts += [f"<p>{escaping.escape(line)}</p>" for line in failures(known)]
    style = "body{font:16px sans-serif;margin:2em}table{border-collapse:collapse}td,th{border:1px solid #999;padding:.2em .6em}"
    return f"<!doctype html><meta charset='utf-8'><title>GPU round</title><style>{style}</style>{''.join(parts)}\n"


def absent(known):
    """The backends that do not start here."""
    return [f"{name} does not start here: {why}" for name, why in known.get("missing", {}).items()]


def failures(known):
    """A line for each stage that failed."""
    failed = [(name, stage) for name, stage in known["stages"].items() if not stage["good"]]
    return [f"{name}, exit code {stage['code']}: {last_line(stage)}" for name, stage in failed]


def last_line(stage):
    """The last line that a stage printed."""
    lines = stage["told"].strip().splitlines()
    return lines[-1] if lines else "it was cut off" if stage["cut_off"] else "no word"


def devices(known):
    """Each device with its limits, from the first rates that were measured on it."""
    found = {}
    for stage in of_kind(known, "rates"):
        data = stage["data"]
        if "device" in data:
            limits = f"{data['flops'] / 1e9:,.0f} Gflop/s, {data['bytes'] / 1e9:,.0f} GB/s"
            limits += f", {1e6 * data['launch_seconds']:.1f} µs a launch"
            where = f"{data['backend']} in {data['precision']}"
            found.setdefault(where, f"{where}: {data['device']}; {limits}")
    return list(found.values())


def of_kind(known, kind):
    """The stages of one kind that left data."""
    return [stage for stage in known["stages"].values() if stage["kind"] == kind and stage["data"] is not None]


def tables(known):
    """Headings and tables, each a list of rows whose first is the head."""
    found = [(f"{name}: {family.unit}", table_of_rates(known, name)) for name, family in FAMILIES.items()]
    found.append(("Certificates", table_of_certificates(known)))
    found.append(("Questions with known answers", table_of_questions(known)))
    found.append(("Time of the stages", table_of_stages(known)))
    return [(heading, table) for heading, table in found if len(table) > 1]


def table_of_rates(known, name):
    """A line for each size, backend and precision."""
    family = FAMILIES[name]
    rows = [
        [
            "copies" if family.copies else "particles",
            "backend",
            "precision",
            "time of a step [ms]",
            family.unit,
            "part of the limit",
        ]
    ]
    for stage in of_kind(known, "rates"):
        data = stage["data"]
        if data["family"] == name:
            for row in data["rows"]:
                share = "" if row["share_of_limit"] is None else f"{row['share_of_limit']:.2f}"
                step = f"{1e3 * row['step_seconds']:.3g}"
                rows.append([f"{row['count']:,}", data["backend"], data["precision"], step, f"{row['rate']:.3g}", share])
    return rows


def table_of_certificates(known):
    """A line for each scene and backend."""
    rows = [["scene", "backend", "precision", "status", "verdict", "time of a step [ms]"]]
    for name, stage in known["stages"].items():
        for row in stage["data"] or () if stage["kind"] == "certificate" else ():
            step = f"{1e3 * row['step_seconds']:.3g}" if row["step_seconds"] else ""
            scene = name.removeprefix("certificate of ")
            rows.append(
                [scene, row["label"], row["precision"] or "", row["status"], row["verdict"] or row["reason"] or "", step]
            )
    return rows


def table_of_questions(known):
    """A line for each backend."""
    rows = [["backend", "questions that ended so"]]
    for name, stage in known["stages"].items():
        if stage["kind"] == "verify" and stage["data"] is not None:
            counts = ", ".join(f"{count} {status}" for status, count in stage["data"]["counts"].items())
            rows.append([name.removeprefix("verify on "), counts])
    return rows


def table_of_stages(known):
    """A line for each stage."""
    ends = {True: "good", False: "failed"}
    rows = [["stage", "time [s]", "end"]]
    for name, stage in known["stages"].items():
        rows.append([name, f"{stage['seconds']:.1f}", ends[stage["good"]] + (", cut off" if stage["cut_off"] else "")])
    return rows


def rows_in_markdown(table):
    """The lines of a table."""
    head, *rows = table
    return ["| " + " | ".join(head) + " |", "|" + "---|" * len(head), *("| " + " | ".join(row) + " |" for row in rows)]
