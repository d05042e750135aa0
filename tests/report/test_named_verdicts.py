"""Lines of verdicts name particles as the scene does."""

from mpp_taichi import Simulation
from mpp_taichi.report.expectations import Watcher
from mpp_taichi.report.summary_lines import verdict_line
from mpp_taichi.scene.load import load_scene
from scenes import kepler


def test_particles_pairs_and_groups_have_their_names_and_others_their_index():
    scene = kepler(0.0)
    scene["particles"][1]["body"].pop("name")
    scene["particles"].append({"body": {"name": "moon", "mass": 0.0, "position": [5, 0, 0], "velocity": [0, 0.4, 0]}})
    scene["expect"] = {
        "speed": {"of": "moon", "above": 0.1},
        "distance": {"between": ["sun", 1], "below": 2.0},
        "relative_energy_error_max": {"below": 1e-3},
    }
    spec = load_scene(scene)
    watcher = Watcher(spec.expect, 10)
    with Simulation(spec, backend="cpu") as simulation:
        simulation.run(steps=10, recorders=[watcher])
        watcher.finish(simulation)
        verdicts = watcher.verdicts({"relative_energy_error_max": 1e-9}, "f64", simulation)
    named = [verdict_line(each).split(" = ")[0] for each in verdicts]
    assert named == ["pass  speed(of=moon)", "pass  distance(between=(sun, particle 1))", "pass  relative_energy_error_max"]
    assert [each.label for each in verdicts][:2] == ["speed(of=2)", "distance(between=(0, 1))"]
