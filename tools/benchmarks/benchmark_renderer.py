"""How long a picture takes: the program's own renderer for growing numbers of spheres, and GGUI where it draws.

    python tools/benchmarks/benchmark_renderer.py [--sizes 3000 100000] [--size 1280x720] [--repeats 9] [--threads 2]
        [--json FILE]

Spheres of a normal distribution, all in view, some pixels in radius. `plain` is a picture without any of what `view:` may
add; `colour` colours by speed, with its legend; `lit` has light from afar, shadows of the largest spheres, textures and stars;
`ggui` is GGUI without a window (Mesa's lavapipe, where there is no graphics card). Kinds take turns, and each picture moves a
little, so that nothing can be kept. Wall time is the median and the fastest of the repeats. Other programs may take the
machine's time; processor time, of all threads together, does not count that, and is what a picture takes at most on a machine
of its own. The bar is held where either is below it.
"""

import argparse
import os
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from verdicts import finish

sys.path.insert(0, str(Path(__file__).parents[2]))

TARGET = (100_000, (1280, 720), 0.5)  # spheres, size, seconds


def frames(count, repeats):
    """Frames of the same spheres, each a little turned."""
    from mpp_taichi.views._base import Frame

    random = np.random.default_rng(0)
    position, color = random.normal(size=(count, 3)), random.uniform(0.1, 1.0, (count, 3))
    radius, velocity = np.full(count, 0.25 / count ** (1 / 3)), random.normal(size=(count, 3))
    radius[:20] *= 4.0
    for number in range(repeats):
        angle = 0.05 * number
        turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
        yield Frame(position=position @ turn, radius=radius, color=color, velocity=velocity, time=float(number))


def views():
    """The kinds of pictures: what a view asks for, and the renderer."""
    from mpp_taichi.scene.view_spec import (
        BodyViewSpec,
        CameraSpec,
        ColorBySpec,
        ColorScaleSpec,
        LightSpec,
        SkySpec,
        TextureSpec,
        ViewSpec,
    )

    camera = CameraSpec(position=(0.0, -9.0, 2.0), look_at=(0.0, 0.0, 0.0), up=(0.0, 0.0, 1.0))
    plain = ViewSpec(camera=camera, caption=False)
    textured = {(0, 20): BodyViewSpec(texture=TextureSpec(pattern="cratered"))}
    lit = replace(plain, light=(LightSpec(direction=(-1.0, -0.5, 1.0)),), sky=SkySpec(stars=3000), bodies=textured)
    return {
        "plain": (plain, "own"),
        "colour": (replace(plain, color_by=ColorBySpec(speed=ColorScaleSpec())), "own"),
        "lit": (lit, "own"),
        "ggui": (plain, "ggui"),
    }


def measure(count, size, repeats, without_ggui):
    """Seconds of each kind of picture: median, fastest, and of the processor."""
    from mpp_taichi.errors import BackendError
    from mpp_taichi.views.offscreen import open_offscreen

    ready = {}
    for name, (spec, renderer) in views().items():
        if renderer == "ggui" and without_ggui:
            continue
        try:
            ready[name] = open_offscreen(spec, size, renderer=renderer)
        except BackendError as error:
            print(f"no {name}: {error}", file=sys.stderr)
    wall, used = {name: [] for name in ready}, {name: [] for name in ready}
    for number, frame in enumerate(frames(count, repeats + 1)):
        for name, view in ready.items():
            began, began_use = time.perf_counter(), time.process_time()
            view.draw(frame)
            if number > 0:  # the first compiles
                wall[name].append(time.perf_counter() - began)
                used[name].append(time.process_time() - began_use)
    for view in ready.values():
        view.close()
    return {
        name: {
            "spheres": count,
            "kind": name,
            "seconds": float(np.median(wall[name])),
            "fastest": min(wall[name]),
            "processor_seconds": float(np.median(used[name])),
        }
        for name in ready
    }


def main():
    """Measure, print the table and the verdict, write the JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", type=int, nargs="+", default=[1000, 3000, 10_000, 30_000, 100_000])
    parser.add_argument("--size", default="1280x720", help="of the picture")
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--threads", type=int)
    parser.add_argument(
        "--precision", choices=("f32", "f64"), default="f64", help="of the simulation, which pictures do not notice"
    )
    parser.add_argument("--no-ggui", action="store_true")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()

    from mpp_taichi.device import backends
    from mpp_taichi.device.availability import cpu_name

    width, height = map(int, arguments.size.split("x"))
    threads = arguments.threads or os.cpu_count()
    backends.start("cpu", arguments.precision, threads=arguments.threads)
    rows = []
    print(f"{cpu_name()}, {threads} threads, {width} × {height} pixels; milliseconds a picture")
    print(f"{'spheres':>8}  {'kind':8}{'median':>9}{'fastest':>9}{'processor':>11}")
    for count in arguments.sizes:
        for row in measure(count, (width, height), arguments.repeats, arguments.no_ggui).values():
            rows.append(row)
            print(
                f"{row['spheres']:8d}  {row['kind']:8}{1e3 * row['seconds']:9.1f}{1e3 * row['fastest']:9.1f}"
                f"{1e3 * row['processor_seconds']:11.1f}"
            )
    spheres, size, limit = TARGET
    asked = [row for row in rows if row["spheres"] == spheres and row["kind"] == "plain" and (width, height) == size]
    verdicts = []
    for row in asked:
        seconds = min(row["fastest"], row["processor_seconds"])
        verdicts.append((f"{spheres:,} spheres at {width} × {height}: seconds, at most", seconds, limit, seconds <= limit))
    return finish(verdicts, rows, arguments.json, processor=cpu_name(), threads=threads, size=[width, height])


if __name__ == "__main__":
    sys.exit(main())
