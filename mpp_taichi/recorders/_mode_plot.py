"""Mode plot: amplitudes against time, the shares of the energy, and the spectra against theory."""

import importlib.util
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from mpp_taichi.errors import BackendError
from mpp_taichi.modes.mode_set import ModeSet
from mpp_taichi.recorders._plot_letters import families

# Okabe and Ito's colours, which the colour-blind can tell apart; the styles tell apart more modes than colours, and in grey.
COLORS = ("#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9", "#000000")
STYLES = ("-", "--", "-.", ":")
SMALLEST = 1e-17  # of the energy or of a spectrum's peak; smaller values are rounding
SIZE = (9.0, 9.5)  # inches


class RecordedModes(Protocol):
    """Modes along a run: `ModeRecorder`."""

    title: str
    units: dict[str, str]
    modes: ModeSet

    def columns(self) -> dict[str, np.ndarray]:
        """time (sample_count,); amplitude and energy_share (sample_count, mode_count)."""


def require_matplotlib() -> None:
    """Refuse a plot where there is no matplotlib to draw it.

    Raises:
        BackendError: matplotlib is not installed.
    """
    if importlib.util.find_spec("matplotlib") is None:
        raise BackendError("a plot needs matplotlib: pip install 'mpp-taichi[report]'; .csv and .npz need nothing")


def draw(recorder: RecordedModes, path: Path) -> None:
    """Draw the modes into a picture of the format that the suffix says."""
    figure_of(recorder).savefig(path, dpi=120)


def figure_of(recorder: RecordedModes) -> Any:
    """The drawing, a matplotlib Figure."""
    from matplotlib.figure import Figure

    found = recorder.columns()
    figure = Figure(figsize=SIZE, layout="constrained")
    amplitude, energy, spectrum = figure.subplots(3, 1)
    time_unit, length_unit = recorder.units.get("time", ""), recorder.units.get("length", "")
    _draw_amplitudes(amplitude, recorder, found, _label("amplitude a", length_unit))
    _draw_energy(energy, recorder, found)
    for axes in (amplitude, energy):
        axes.set_xlabel(_label("time t", time_unit))
        axes.margins(x=0.0)
    _draw_spectra(spectrum, recorder, found)
    spectrum.set_xlabel(_label("angular frequency ω", f"rad/{time_unit}" if time_unit else ""))
    for axes in (amplitude, energy, spectrum):
        axes.grid(alpha=0.3)
        axes.spines[["top", "right"]].set_visible(False)
    handles, labels = energy.get_legend_handles_labels()
    title, font = _title(recorder), {"family": families(_title(recorder))}
    words: dict[str, Any] = {"ncols": 5, "fontsize": "small", "title": title, "title_fontproperties": font, "frameon": False}
    figure.legend(handles, labels, loc="outside upper center", **words)
    return figure


def _title(recorder: RecordedModes) -> str:
    return f"{recorder.title or 'Spring network'}: modes, by {recorder.modes.source}"


def _label(quantity: str, unit: str) -> str:
    return f"{quantity} [{unit}]" if unit else quantity


def _look(number: int) -> dict[str, Any]:
    return {"color": COLORS[number % len(COLORS)], "linestyle": STYLES[number // len(COLORS) % len(STYLES)], "linewidth": 1.4}


def _draw_amplitudes(axes: Any, recorder: RecordedModes, found: dict[str, np.ndarray], label: str) -> None:
    for number, mode in enumerate(recorder.modes.modes):
        axes.plot(found["time"], found["amplitude"][:, number], label=f"mode {mode.label}", **_look(number))
    axes.set_ylabel(label)


def _draw_energy(axes: Any, recorder: RecordedModes, found: dict[str, np.ndarray]) -> None:
    """Shares on a logarithmic axis, so that a share of a millionth is seen as well."""
    share = found["energy_share"]
    for number, mode in enumerate(recorder.modes.modes):
        axes.plot(found["time"], np.maximum(share[:, number], SMALLEST), label=f"mode {mode.label}", **_look(number))
    outside = np.maximum(1.0 - share.sum(axis=1), SMALLEST)
    axes.plot(found["time"], outside, color="0.5", linewidth=1.0, label="in no mode shown")
    axes.set_yscale("log")
    axes.set_ylabel("share of the energy")


def _draw_spectra(axes: Any, recorder: RecordedModes, found: dict[str, np.ndarray]) -> None:
    """|FFT| of each amplitude under a Hann window, zero-padded fourfold, over the largest of all; theory as vertical lines."""
    time = found["time"]
    theory = [mode.angular_frequency for mode in recorder.modes.modes]
    axes.set_ylabel("spectrum of a, relative")
    axes.set_yscale("log")
    if len(time) < 8:
        return
    even = np.linspace(time[0], time[-1], len(time))
    window = np.hanning(len(even))
    frequency = 2.0 * np.pi * np.fft.rfftfreq(4 * len(even), even[1] - even[0])
    heights = []
    for number in range(len(theory)):
        values = np.interp(even, time, found["amplitude"][:, number])
        heights.append(np.abs(np.fft.rfft((values - values.mean()) * window, 4 * len(even))))
    largest = max((float(each.max()) for each in heights), default=0.0) or 1.0
    for number, height in enumerate(heights):
        axes.plot(frequency, np.maximum(height / largest, SMALLEST), **_look(number))
        axes.axvline(theory[number], color=COLORS[number % len(COLORS)], linewidth=0.8, alpha=0.6)
    fastest = max([*theory, *(float(frequency[np.argmax(height)]) for height in heights)])
    axes.set_xlim(0.0, 1.5 * fastest if fastest > 0.0 else frequency[-1])
    axes.set_ylim(1e-8, 2.0)
    axes.text(0.99, 0.95, "vertical lines: theory", transform=axes.transAxes, ha="right", va="top", fontsize="small")
