"""The report on the springs of a scene: their modes, and the effect of the integrator on them."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from mpp_taichi.modes.linear_network import LinearNetwork, linearise
from mpp_taichi.modes.mode_set import placed_at_rest
from mpp_taichi.modes.predicted_damping import predicted_damping
from mpp_taichi.modes.spectrum import MOST_FREEDOMS, Spectrum, spectrum
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot

QUICK_FREEDOMS = 200
"""The largest number of freedoms for which the start of a run computes the whole spectrum: some 10 ms."""
SLOWEST = 1e-7  # of the other frequencies: below, a motion of mechanisms and the rounding of their stiffness
QUICK_SPRINGS = 20_000
"""The largest number of springs that the start of a run linearises: 20 ms."""
SHOWN_FREQUENCIES = 4
Amplification = Callable[[float], np.ndarray]


def network_facts(
    spec: SceneSpec,
    start: Snapshot,
    amplification: Amplification,
    dt: float,
    *,
    most_freedoms: int = MOST_FREEDOMS,
    highest: float | None = None,
) -> dict[str, Any]:
    """Counts of modes, their lowest and highest frequencies and the numerical damping there, as far as that is cheap to know.

    `most_freedoms` is the largest network whose spectrum is solved. For a larger network without tension, Maxwell's rule gives
    the least number of zero-frequency modes, and its highest frequency is the given one, if one is given. Unknown facts are
    left out; beside rods, which hold freedoms, all are unknown.
    """
    if not len(start.springs) or len(start.rods) or len(start.springs) > max(QUICK_SPRINGS, 3 * most_freedoms):
        return {}
    placed = placed_at_rest(spec, start)
    network = linearise(placed, dimensions=spec.dimensions)
    found: dict[str, Any] = {}
    frequencies: dict[str, float] = {}
    if 0 < network.freedom_count <= most_freedoms:
        modes = spectrum(network)
        found = _counts(modes)
        if len(modes.angular_frequency):
            frequencies = {"lowest": float(modes.angular_frequency[0]), "highest": float(modes.angular_frequency[-1])}
    else:
        if (least := _maxwell(network)) > 0:
            found = {"zero_frequency_modes_least": least}
        if highest:
            found["highest_angular_frequency"] = frequencies["highest"] = highest
    excited = _excited(network, start)
    if excited > SLOWEST * max(frequencies.values(), default=0.0):
        frequencies["excited"] = excited
    order = [name for name in ("lowest", "excited", "highest") if name in frequencies]
    return found | {"predicted_damping": [_damping(name, frequencies[name], amplification, dt) for name in order]}


def _counts(modes: Spectrum) -> dict[str, Any]:
    return {
        "zero_frequency_modes": modes.zero_frequency_modes,
        "rigid_motions": modes.rigid_motions,
        "mechanism_modes": modes.mechanism_modes,
        "second_order_modes": modes.second_order_modes,
        "unstable_modes": modes.unstable_modes,
        "vibrating_modes": len(modes.angular_frequency),
        "lowest_angular_frequencies": modes.angular_frequency[:SHOWN_FREQUENCIES].tolist(),
        "highest_angular_frequency": float(modes.angular_frequency[-1]) if len(modes.angular_frequency) else None,
    }


def _maxwell(network: LinearNetwork) -> int:
    """Freedoms less springs that can hold them: each spring without tension resists one motion, its own lengthening."""
    if network.lateral.any():
        return 0
    holding = (network.axial > 0.0) & network.free[network.between].any(axis=(1, 2))
    return max(0, network.freedom_count - int(np.count_nonzero(holding)))


def _excited(network: LinearNetwork, start: Snapshot) -> float:
    """Root of Rayleigh's quotient of the displacement that the scene starts with, else of its velocities [radians time⁻¹].

    Of a single mode it is the frequency; of a mixture the root mean square, weighted with inertia.
    """
    dimensions = network.free.shape[1]
    displacement = start.position[:, :dimensions] - network.position
    for motion in (displacement, start.velocity[:, :dimensions]):
        square = network.mean_square_frequency(motion)
        if square > 0.0:
            return float(np.sqrt(square))
    return 0.0


def _damping(name: str, frequency: float, amplification: Amplification, dt: float) -> dict[str, Any]:
    predicted = predicted_damping(amplification, frequency, dt)
    return {
        "at": name,
        "angular_frequency": frequency,
        "energy_loss_per_oscillation": predicted.energy_loss,
        "relative_frequency_error": predicted.frequency_error,
    }


def note(found: Mapping[str, Any]) -> str:
    """A warning for a network that does not resist some motions; empty for a network that resists all.

    Slack springs that a displacement pulls taut resist it weakly, and give no warning.
    """
    unstable, mechanisms = found.get("unstable_modes", 0), found.get("mechanism_modes", 0)
    soft = found.get("second_order_modes", 0)
    parts = []
    if unstable:
        parts.append(f"the springs are compressed and buckle along {_count(unstable, 'mode')}")
    if mechanisms > soft:
        free = _count(mechanisms - soft, "zero-frequency mode")
        parts.append(f"the network is a mechanism: {free} beside {_count(found['rigid_motions'], 'rigid motion')}")
    return "; ".join(parts)


def network_lines(found: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Heads and texts of the lines of a summary; they hold for the scene before its timeline changes it."""
    before = "as the run began: " if found.get("phases") else ""
    damping = found.get("predicted_damping", ())
    rows = [("" if number else "damping", _damping_text(row)) for number, row in enumerate(damping)]
    if "zero_frequency_modes" in found:
        vibrating = found["vibrating_modes"]
        span = f", ω {_some(found['lowest_angular_frequencies'], found['highest_angular_frequency'])}" if vibrating else ""
        rows.append(("springs", f"{_count(vibrating, 'mode')} of vibration{span}; {_zeros(found)}"))
    if least := found.get("zero_frequency_modes_least"):
        rows.append(("springs", f"at least {_count(least, 'mode')} of zero frequency: so many more freedoms than springs"))
    return [(head, before + text) for head, text in rows]


def _zeros(found: Mapping[str, Any]) -> str:
    zeros, soft = found["zero_frequency_modes"], found["second_order_modes"]
    buckling = f"; {found['unstable_modes']:,} that buckle" if found["unstable_modes"] else ""
    if not zeros:
        return f"none of zero frequency{buckling}"
    kinds = f"{_count(found['rigid_motions'], 'rigid motion')}, {_count(found['mechanism_modes'], 'mechanism')}"
    softly = f" ({soft:,} of them pulled back by the cube of the displacement)" if soft else ""
    return f"{zeros:,} of zero frequency: {kinds}{softly}{buckling}"


def _some(lowest: list[float], highest: float) -> str:
    told = ", ".join(f"{frequency:.6g}" for frequency in lowest)
    return told if highest == lowest[-1] else f"{told}{', …' if len(lowest) == SHOWN_FREQUENCIES else ''} {highest:.6g}"


def _count(number: int, noun: str) -> str:
    return f"{number:,} {noun}{'' if number == 1 else 's'}"


def _damping_text(row: Mapping[str, Any]) -> str:
    """`predicted at the lowest ω 2.57: no energy lost per oscillation, frequency +2.8e-05`."""
    name = f"predicted at the {row['at']} ω {row['angular_frequency']:.4g}"
    loss, error = row["energy_loss_per_oscillation"], row["relative_frequency_error"]
    if loss is None:
        return f"{name}: the step is too large to oscillate"
    lost = "no energy lost" if loss == 0.0 else f"{abs(loss):.2g} of the energy {'lost' if loss > 0.0 else 'gained'}"
    return f"{name}: {lost} per oscillation, frequency {error:+.2g}"


def mode_lines(found: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Heads and texts of the modes that a run followed: `(1, 1)  ω 2.56945 by theory, 2.56961 measured (+6.2e-05), …`."""
    if "modes" not in found:
        return []
    leakage = found["mode_leakage_max"]
    outside = "" if leakage is None else f"; up to {leakage:.2g} of the energy in none of these"
    rows = [("modes", f"by {found['modes_source']}{outside}")]
    width = max(len(_label(row)) for row in found["modes"])
    for row in found["modes"]:
        theory, measured = row["angular_frequency_theory"], row["angular_frequency_measured"]
        text = f"{_label(row):{width}s}  ω {theory:.7g} by theory, "
        if measured is None:
            text += "not measured"
        else:
            scatter, error = row["angular_frequency_uncertainty"], row["relative_frequency_error"]
            text += f"{measured:.7g}{f' ± {scatter:.1g}' if scatter else ''} measured{f' ({error:+.2g})' if error else ''}"
        share = "" if row["energy_share"] is None else f", {row['energy_share']:.3g} of the energy"
        rows.append(("", f"{text}; amplitude up to {row['amplitude_max']:.3g}{share}"))
    return rows


def _label(row: Mapping[str, Any]) -> str:
    return f"({', '.join(map(str, row['mode']))})"
