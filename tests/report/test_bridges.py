"""A result as tables of pandas and as a dataset of xarray."""

import numpy as np
import pandas
import pytest
import xarray

import mpp_taichi as mpp
from mpp_taichi.errors import MissingPackageError
from mpp_taichi.report import bridges, result_page

SCENE = {
    "units": {"length": "AU", "time": "day", "mass": "Msun"},
    "particles": [
        {"body": {"name": "sun", "mass": 1.0, "position": [0, 0, 0]}},
        {"body": {"name": "earth", "mass": 3e-6, "position": [1, 0, 0], "velocity": [0, 0.0172, 0]}},
    ],
    "forces": ["newtonian_gravity"],
    "integrator": {"leapfrog": {"dt": 1.0}},
    "run": {"duration": 100.0},
}


@pytest.fixture(scope="module")
def result():
    with mpp.run(SCENE, backend="cpu", samples=10) as found:
        yield found


def test_the_table_becomes_columns_of_numbers(result):
    table = result.to_pandas()
    assert isinstance(table, pandas.DataFrame) and table.index.name == "time"
    assert np.array_equal(table.index, result.table["time"]) and all(kind.kind in "fi" for kind in table.dtypes)
    for k, axis in enumerate("xyz"):
        assert np.array_equal(table[f"momentum_{axis}"], result.table["momentum"][:, k])
    assert set(result.table) - {"time"} == {name.removesuffix("_x") for name in table if name[-2:] not in ("_y", "_z")}


def test_the_moments_become_a_row_for_each_particle(result):
    table = result.to_pandas(particles=True)
    assert list(table.index.names) == ["time", "particle"] and len(table) == result.position.shape[0] * 2
    earth = table.xs(1, level="particle")
    assert set(earth["name"]) == {"earth"} and np.array_equal(earth["position_y"], result.position[:, 1, 1])
    assert np.array_equal(earth[["velocity_x", "velocity_y", "velocity_z"]], result.velocity[:, 1])


def test_the_dataset_has_named_dimensions_and_units(result):
    data = result.to_xarray()
    assert isinstance(data, xarray.Dataset) and dict(data.sizes) == {"time": 11, "particle": 2, "axis": 3}
    assert np.array_equal(data["position"], result.position) and data["position"].dims == ("time", "particle", "axis")
    assert np.array_equal(data["momentum"].sel(axis="y"), result.table["momentum"][:, 1])
    earth = data.set_index(particle="name").sel(particle="earth")
    assert np.array_equal(earth["velocity"], result.velocity[:, 1]) and float(earth["mass"]) == 3e-6
    assert (data["position"].units, data["velocity"].units, data["time"].units) == ("AU", "AU/day", "day")
    assert data.attrs["integrator"] == "leapfrog"


@pytest.mark.parametrize("name", ["pandas", "xarray"])
def test_a_missing_package_is_one_line_with_the_command(result, name, monkeypatch):
    monkeypatch.setattr(bridges, "is_absent", lambda module: module == name)
    with pytest.raises(MissingPackageError, match=rf"^to_{name} needs the package {name}: .* -m pip install {name}$"):
        getattr(result, f"to_{name}")()


def test_a_page_is_text_and_a_file(result, tmp_path):
    text = result.page(tmp_path / "earth.html")
    assert text.startswith("<!DOCTYPE html>") and (tmp_path / "earth.html").read_text(encoding="utf-8") == text


def test_a_page_in_a_cell_is_bounded_in_size(monkeypatch):
    """Half of the moments are left out where the page is too large, and the picture alone is shown where too few are left."""
    monkeypatch.setattr(result_page, "FEWEST_FRAMES", 5)
    made = []
    page = result_page.page
    monkeypatch.setattr(result_page, "page", lambda *given: made.append(len(given[1])) or page(*given))
    with mpp.run(SCENE, backend="cpu", samples=10) as result:
        sizes = [len(page(result.simulation, result.moments[::every], result._rows, result_page.SIZE)) for every in (1, 2)]
        monkeypatch.setattr(result_page, "MOST_BYTES", sum(sizes) // 2)
        assert sizes[0] > sizes[1] and "<iframe" in result._repr_html_() and made == [11, 6]
        monkeypatch.setattr(result_page, "MOST_BYTES", 10)
        html = result._repr_html_()
        assert "<iframe" not in html and html.startswith("<figure><img")
