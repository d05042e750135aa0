"""Writes docs/performance.md from the results of the benchmarks: tables of ratios, all bars, and the machine.

What was tried for each goal, and what limits it, is written by hand in performance_limits.md beside this file and taken over as
it is. Its links are relative to docs/.
"""

from pathlib import Path

INTRODUCTION = """\
# Performance

One command measured the numbers of all tables of results, and wrote the page:

    python tools/measure_performance.py

Only the section [What was tried, and what limits it](#what-was-tried-and-what-limits-it) is written by hand.

A column "speed ÷ X" is the speed of this program divided by the speed of the program X on the same machine. The two programs
are measured in alternation in one run, and the number is a ratio of medians. Above 1, this program is faster. A program that is
missing on the machine (for lack of a compiler, a package or a device) has no column. The tables contain all results, whether
this program is faster or slower. The last table compares the results with their limits.
"""
GPU = """\
## On a GPU

{sentence}

    python tools/gpu_round.py

This command measures on a machine with a GPU, in at most eight minutes, and goes on where it was cut off: certificates that the
backends agree, the rates of pairs, tree, springs, spheres and replicas from a thousand to the largest number that fits, each
beside the limits of the card that are measured in the same process, a film, questions with known answers, and the tests
that run on Vulkan. It writes `round.html`, a table in Markdown and `round.json` into the folder `out/gpu_round`. The tests run
it on the backends of a CPU (`--backends cpu --short`). These commands compare backends at length:

    python -m mpp_taichi compare scenes/ring.yaml --backends cuda,vulkan,opencl --scaling
    python -m mpp_taichi compare scenes/cloth.yaml --backends cuda,vulkan,opencl --scaling
    python -m mpp_taichi accuracy scenes/cluster.yaml --backends cuda --precisions f64,ds,f32c,f32
"""

LIMITS = Path(__file__).with_name("performance_limits.md").read_text(encoding="utf-8")
BARS = "## Bars"


def page(found, commands):
    """The text of the page. `found` maps the name of a benchmark to its results, and `commands` maps it to its command line."""
    parts = [INTRODUCTION + "\n" + _machine(found)]
    for name, (title, tables) in SECTIONS.items():
        if name in found:
            parts.append("\n\n".join([f"## {title}\n\n    {commands[name]}", *tables(found[name]["results"])]))
    comparisons = [found[name] for name in sorted(found) if name.startswith("compare")]
    parts += [_comparison(each, commands[f"compare {each['scene']}"]) for each in comparisons]
    on_gpu = any(row["status"] == "ok" and not row["on_processor"] for each in comparisons for row in each["rows"])
    parts.append(GPU.format(sentence="The rows of the GPU are in the tables above." if on_gpu else "**Not run on a GPU.**"))
    parts += [LIMITS, _bars(found)]
    return "\n\n".join(part.strip() for part in parts) + "\n"


def with_new_limits(text):
    """A page whose measured tables stay, with the section that is written by hand as it is in its file now."""
    measured, bars = text.split(f"\n{BARS}\n")
    measured = measured.partition(f"\n{LIMITS.splitlines()[0]}\n")[0]
    return f"{measured.rstrip()}\n\n{LIMITS.strip()}\n\n{BARS}\n{bars}"


def with_new_results(text, name, found, command):
    """A page with new results of one benchmark, its section and its bars; the section names the machine that measured it."""
    title, tables = SECTIONS[name]
    before, rest = text.split(f"\n## {title}\n")
    others = rest[rest.index("\n## ") :]
    section = [f"## {title}\n\n    {command}", f"Measured by itself: {_machine({name: found})}", *tables(found["results"])]
    measured, bars = others.split(f"\n{BARS}\n")
    rows = [row for row in bars.splitlines() if row.startswith("| ")][1:]
    own = [row.startswith(f"| {name} |") for row in rows]
    place = own.index(True) if any(own) else len(rows)
    new = table([], _bar_rows(name, found)).splitlines()[2:]
    kept = [row for row, is_own in zip(rows, own, strict=True) if not is_own]
    rows = [*kept[:place], *new, *kept[place:]]
    return f"{before}\n" + "\n\n".join(section) + f"\n{measured}\n{_bars_of(rows)}\n"


def table(head, rows):
    """A table in Markdown, with the numbers aligned to the right."""
    lines = [f"| {' | '.join(head)} |", f"|{'|'.join('---' if k == 0 else '---:' for k in range(len(head)))}|"]
    return "\n".join([*lines, *(f"| {' | '.join(str(cell) for cell in row)} |" for row in rows)])


def ratio(value):
    """A ratio with two digits, such as `0.86` or `12`; a dash for a missing ratio."""
    return "–" if value is None else f"{value:.2g}" if value < 10 else f"{value:.0f}"


def size(value):
    """A large number with a prefix, such as `3.2 G` or `870 k`."""
    scale, unit = next((each for each in ((1e9, "G"), (1e6, "M"), (1e3, "k")) if value >= each[0]), (1.0, ""))
    return f"{value / scale:.3g} {unit}".strip()


def duration(seconds):
    """A time with its unit, such as `1.2 ms`; a dash for a missing time."""
    if seconds is None:
        return "–"
    scale, unit = next((each for each in ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs")) if seconds >= each[0]), (1e-9, "ns"))
    return f"{seconds / scale:.3g} {unit}"


# --- one function for each benchmark -------------------------------------------------------------------------------------

OPPONENTS = {"c": "C, AVX-512", "numba": "Numba", "rebound": "REBOUND", "numpy": "NumPy"}


def _pairs(results):
    for precision, sizes in results.items():
        others = [name for name in OPPONENTS if any(name in row for row in sizes.values())]
        rows = [
            [f"{int(count):,}", size(best["per_second"])]
            + [ratio(best["per_second"] / row[name]["per_second"]) if name in row else "–" for name in others]
            + [f"{best['error']:.1e}"]
            for count, row in sizes.items()
            for best in [max((row["composed"], row["gather"]), key=lambda each: each["per_second"])]
        ]
        yield table(
            [
                f"{precision}: N",
                "pairs/s",
                *(f"speed ÷ {OPPONENTS[name]}" for name in others),
                "largest error ÷ mean acceleration",
            ],
            rows,
        )


def _opencl(results):
    rows = [
        [case["model"], f"{case['count']:,}", case["precision"], duration(ours["seconds"]), duration(theirs["seconds"])]
        + [ratio(theirs["seconds"] / ours["seconds"]), theirs["variant"].split(";")[0].removeprefix("pairs: ")]
        for case in results
        for ours, theirs in [(case["rows"]["ours"], case["rows"]["opencl"])]
    ]
    yield table(["scene", "N", "precision", "time of a step", "time in OpenCL", "speed ÷ OpenCL", "OpenCL kernel"], rows)


def _steps(results):
    rows = [
        [row["bodies"], duration(us["composed"] / 1e6), duration(us["rebound"] / 1e6), ratio(row["ratio_to_rebound"])]
        + [ratio(row["ratio_to_hand_written"])]
        for row in results["steps"]
        for us in [row["microseconds_per_step"]]
    ]
    yield table(
        ["bodies", "time of a step", "time in REBOUND", "time ÷ time in REBOUND", "time ÷ time of hand-written kernel"], rows
    )
    kinds = ("process", "import_libraries", "import_mpp_taichi", "scene_to_first_step")
    starts = [[label, *(duration(times[kind]) for kind in kinds)] for label, times in results["start"].items()]
    yield table(
        ["start of sun_earth", "whole process", "import of libraries", "import of mpp_taichi", "from scene to first step"],
        starts,
    )


def _tree(results):
    for precision, sizes in results.items():
        rows = [
            [f"{int(count):,}", duration(tree["seconds"]), ratio(tree["direct_over_this"]), f"{tree['error_50']:.0e}"]
            + [f"{tree['error_99']:.1e}"]
            for count, row in sizes.items()
            for tree in [row["tree 0.001"]]
        ]
        yield table(
            [f"{precision}: N", "time of all forces", "speed ÷ direct sum", "error, median", "error, 99th percentile"], rows
        )


def _springs(results):
    others = [name for name in ("opencl", "c", "c 1", "atomic") if any(name in case["rows"] for case in results)]
    named = {"opencl": "OpenCL", "c": "C", "c 1": "C, 1 thread", "atomic": "atomics"}
    rows = [
        [f"{case['springs']:,} {case['order']}", f"{case['precision']}{', damped' if case['damped'] else ''}"]
        + [duration(ours["seconds"]), size(ours["half_springs_per_second"])]
        + [ratio(case["rows"][name]["seconds"] / ours["seconds"]) if name in case["rows"] else "–" for name in others]
        for case in results
        for ours in [case["rows"]["ours"]]
    ]
    yield table(
        ["springs, order", "precision", "time of a step", "half-springs/s", *(f"speed ÷ {named[name]}" for name in others)],
        rows,
    )


def _contacts(results):
    rows = [
        [f"{case['spheres']:,}", case["precision"], duration(swept["seconds"]), size(swept["particle_steps_per_second"]), other]
        + [ratio(row["seconds"] / swept["seconds"]), f"{swept['largest_overlap']:.0e}"]
        + [f"{row['largest_overlap']:.0e}" if "largest_overlap" in row else "–"]
        for case in results
        for swept in [case["rows"].get("swept")]
        if swept
        for other, row in case["rows"].items()
        if row is not swept
    ]
    head = [
        "spheres",
        "precision",
        "time of a step of swept",
        "particle-steps/s",
        "other solver",
        "speed ÷ other solver",
        "largest overlap (radii)",
        "largest overlap of other solver",
    ]
    yield table(head, rows)


def _events(results):
    theirs = {(row["dimensions"], row["count"]): row for row in results if row["contender"] == "rebound"}
    rows = [
        [f"{row['dimensions']}D, {row['count']:,}", size(row["per_processor_second"]), f"{row['growth']:.2f}"]
        + [ratio(row["per_processor_second"] / other["per_processor_second"]) if other else "–"]
        + [f"{row['largest_overlap']:.0e}", f"{other['largest_overlap']:.0e}" if other else "–"]
        for row in results
        if row["contender"] == "ours"
        for other in [theirs.get((row["dimensions"], row["count"]))]
    ]
    yield table(
        [
            "dimensions, spheres",
            "collisions/s",
            "cost per collision ÷ first row",
            "speed ÷ REBOUND",
            "largest overlap",
            "largest overlap in REBOUND",
        ],
        rows,
    )


SECTIONS = {
    "pairs": ("Gravity, all pairs", _pairs),
    "opencl": ("The same scenes in OpenCL, on the same processor", _opencl),
    "steps": ("Few bodies", _steps),
    "tree": ("Gravity by a tree, accuracy 1e-3", _tree),
    "springs": ("Springs", _springs),
    "contacts": ("Contacts, time-stepped", _contacts),
    "event_driven": ("Contacts, event-driven, one core", _events),
}


def _comparison(found, command):
    rows = [
        [row["label"], row["precision"] or "", row["verdict"] if row["status"] == "ok" else row["status"]]
        + (
            [duration(row[key]) for key in ("cold_compile_seconds", "warm_compile_seconds", "step_seconds")]
            if timed
            else [""] * 3
        )
        + [_rate(row["rates"]) if timed else row["reason"], _share(row["rates"]) if timed else ""]
        for row in found["rows"]
        for timed in [row["status"] == "ok" and row["step_seconds"] is not None]
    ]
    head = [
        "backend",
        "precision",
        "certificate",
        "compilation",
        "compilation from cache",
        "time of a step",
        "rate",
        "share of peak",
    ]
    title = f"## Backends: {found['title']}, {found['particle_count']:,} particles"
    remarks = "".join(f"\n\n{text[0].upper()}{text[1:]}." for text in found["warnings"])
    return f"{title}\n\n    {command}\n\n{table(head, rows)}{remarks}"


def _rate(rates):
    units = {
        "interactions_per_second": "pairs/s",
        "springs_per_second": "springs/s",
        "particle_steps_per_second": "particles/s",
    }
    return next((f"{size(rates[name])} {unit}" for name, unit in units.items() if name in rates), "")


def _share(rates):
    shares = [rates[name] for name in ("share_of_peak_flops", "share_of_peak_bytes") if name in rates]
    return f"{100 * shares[0]:.0f} %" if shares else ""


def _machine(found):
    known = {key: value for name in SECTIONS if name in found for key, value in found[name]["machine"].items()}
    threads = [f"{known['threads']} threads"] if "threads" in known else []
    first = [", ".join(str(each) for each in (known.get("processor"), *threads, known.get("system")))]
    versions = [f"{name} {known[name]}" for name in ("taichi", "numpy", "rebound", "python") if name in known]
    return "; ".join([*first, ", ".join(versions), *(known[key] for key in ("compiler", "opencl") if known.get(key))]) + "."


def _bars(found):
    rows = [row for name in SECTIONS if name in found for row in _bar_rows(name, found[name])]
    return _bars_of(table([], rows).splitlines()[2:])


def _bar_rows(name, found):
    """The bars of one benchmark, with what was measured."""
    return [
        [name, bar["bar"], f"{bar['limit']:g}", f"{bar['value']:.3g}", "held" if bar["held"] else "**missed**"]
        for bar in found["bars"]
    ]


def _bars_of(rows):
    """The section of bars, from its rows as they are printed."""
    held = sum(row.endswith("| held |") for row in rows)
    head = table(["benchmark", "bar", "limit", "measured", "result"], [])
    return "\n".join([f"{BARS}\n\n{held} of {len(rows)} results keep their limit.\n", head, *rows])
