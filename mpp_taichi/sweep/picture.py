"""Picture: a map of a sweep with two keys, curves of a sweep with one key, a histogram of a sample."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image

from mpp_taichi.atomic_file import whole_file, whole_text
from mpp_taichi.plots import map as maps
from mpp_taichi.plots.content import Curves, Histogram, Plot, Samples
from mpp_taichi.plots.sheet import Sheet, letters_for
from mpp_taichi.plots.svg import draw_svg
from mpp_taichi.sweep.results import SKIPPED, SweepResults

SIZE = (960, 720)
BINS = 40
NAME = "picture"


def draw(results: SweepResults, folder: Path) -> list[Path]:
    """PNG and SVG of each measure that has numbers: `picture.png` of the first, `picture_NAME.png` of the others."""
    files: list[Path] = []
    for number, name in enumerate(results.names):
        stem = NAME if number == 0 else f"{NAME}_{_safe(name)}"
        found = _drawn(results, name)
        if found is None:
            continue
        picture, text = found
        with whole_file(folder / f"{stem}.png", "the picture of the sweep") as temporary:
            picture().save(temporary, "PNG")
        whole_text(folder / f"{stem}.svg", text(), "the picture of the sweep")
        files += [folder / f"{stem}.png", folder / f"{stem}.svg"]
    return files


def _drawn(results: SweepResults, name: str) -> tuple[Callable[[], Image.Image], Callable[[], str]] | None:
    """How the measure is drawn as a picture and as SVG."""
    if results.is_map:
        plot = map_of(results, name)
        return (lambda: maps.draw_picture(plot, SIZE)), (lambda: maps.draw_svg(plot, SIZE))
    panel = curve_of(results, name) if results.store.sweep.sample is None else histogram_of(results, name)
    if panel is None:
        return None
    letters = letters_for(SIZE[1])
    return (lambda: Image.fromarray(Sheet([panel], SIZE, letters).picture())), (lambda: draw_svg([panel], SIZE, letters))


def map_of(results: SweepResults, name: str) -> maps.Map:
    """The map of a measure over the two keys that have several values."""
    wide = results.wide
    shape = [results.shape[k] for k in wide]
    values = results[name].reshape(shape).astype(float)
    known = ~np.isin(results["status"], ("missing", SKIPPED)).reshape(shape)
    filled, unknown = maps.coarse_fill(values, known)
    paths, specs = list(results.axes), results.store.plan.axes
    x, y = (maps.MapAxis(paths[k], results.axes[paths[k]], specs[k].scale == "logarithmic") for k in wide)
    unit = results.units.get(name, "")
    return maps.Map(results.long_names.get(name, name), x, y, filled, unknown, unit)


def curve_of(results: SweepResults, name: str) -> Plot | None:
    """The measure over the first key that has several values; the mean and the band of all values of the other keys."""
    axis = next(iter(results.wide), 0)
    path = list(results.axes)[axis]
    x = results.axes[path] if results.store.plan.is_grid else next(iter(results.axes.values()))
    if x.dtype == object:
        return None
    values = np.moveaxis(results[name].astype(float), axis if results.store.plan.is_grid else 0, 0).reshape(len(x), -1)
    if not np.isfinite(values).any():
        return None
    columns = [values[:, 0]] if values.shape[1] == 1 else _band(values)
    names = (name,) if len(columns) == 1 else ("mean", "least", "largest")
    known = np.isfinite(columns[0])
    samples = Samples()
    samples.open(1 + len(columns))
    for row in np.stack([x.astype(float), *columns], axis=1)[known][np.argsort(x[known], kind="stable")]:
        samples.add(row)
    title = results.long_names.get(name, name)
    return Curves(title, path, "", names, results.units.get(name, ""), samples, 0, tuple(range(1, 1 + len(columns))))


def _band(values: np.ndarray) -> list[np.ndarray]:
    """Mean, least and largest of the finite values of each row; NaN where it has none."""
    finite = np.isfinite(values)
    count, has = finite.sum(axis=1), finite.any(axis=1)
    mean = np.where(has, np.where(finite, values, 0.0).sum(axis=1) / np.maximum(count, 1), np.nan)
    least = np.where(has, np.where(finite, values, np.inf).min(axis=1), np.nan)
    largest = np.where(has, np.where(finite, values, -np.inf).max(axis=1), np.nan)
    return [mean, least, largest]


def histogram_of(results: SweepResults, name: str) -> Plot | None:
    """The distribution of a measure over all members of a sample."""
    values = results.column(name).astype(float)
    values = values[np.isfinite(values)]
    if not len(values):
        return None
    density, edges = np.histogram(values, bins=BINS, density=bool(values.max() > values.min()))
    plot = Histogram(results.long_names.get(name, name), name, results.units.get(name, ""), False, BINS)
    plot.show(edges, density.astype(float), np.zeros(0), np.zeros(0))
    return plot


def _safe(name: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in name).strip("_")
