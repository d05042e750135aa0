"""Times for a reader: the axis of a panel and the summary have the unit of the caption, files keep the scene's own unit."""

import csv

import numpy as np
import pytest

import mpp_taichi as mpp
from mpp_taichi.recorders.inspection import InspectionRecorder
from mpp_taichi.recorders.inspector import Inspector

END = 1.668e6
SCENE = {
    "units": {"length": "km", "time": "s", "mass": "kg"},
    "particles": [{"body": {"name": "stone", "mass": 1.0, "position": [0, 0, 0], "velocity": [1, 0, 0]}}],
    "integrator": {"leapfrog": {"dt": END / 20}},
    "run": {"duration": END},
    "inspect": [{"y": {"position": {"of": "stone", "axis": "x"}}}],
}


@pytest.mark.parametrize(("units", "unit", "size"), [(SCENE["units"], "d", 86400.0), (None, "", 1.0)])
def test_a_panel_over_time_has_the_unit_of_the_caption_and_its_table_that_of_the_scene(tmp_path, units, unit, size) -> None:
    with mpp.Simulation({**SCENE, "units": units}, backend="cpu", precision="f64") as simulation:
        recorder = InspectionRecorder(Inspector(simulation, end=END), 1)
        simulation.run(recorders=[recorder])
        (plot,) = recorder.inspector.plots
        assert plot.x_unit == unit and plot.span == pytest.approx((0.0, END / size))
        np.testing.assert_allclose(plot.x, np.linspace(0.0, END / size, 21), rtol=1e-12)
        np.testing.assert_allclose(plot.y(0), np.linspace(0.0, END, 21), rtol=1e-9)
        recorder.save(tmp_path / "table.csv")
    with open(tmp_path / "table.csv", encoding="utf-8") as stream:
        rows = list(csv.reader(stream))
    assert rows[0][0] == "time" and float(rows[-1][0]) == pytest.approx(END)


def test_the_summary_says_the_time_in_the_scene_s_unit_and_in_one_that_is_easy_to_read() -> None:
    with mpp.run(SCENE, backend="cpu", precision="f64") as result:
        assert "reached t = 1668000 s (19.3 d) in 20 steps" in str(result)
    with mpp.run({**SCENE, "units": None}, backend="cpu", precision="f64") as result:
        assert "reached t = 1668000 in 20 steps" in str(result)
