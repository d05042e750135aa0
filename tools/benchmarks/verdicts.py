"""How a benchmark ends: each bar with what was measured, on the screen and in a file with the machine it came from."""

import json
import platform

import numpy as np


def finish(verdicts, results, path, **machine):
    """Print (text, value, bar, held) of each verdict, write all to `path` if there is one; the exit code: 0 where all held.

    `machine` comes before what every benchmark tells of it, system and versions.
    """
    print()
    for text, value, bar, held in verdicts:
        print(f"{'ok  ' if held else 'FAIL'} {text} {bar:g}: {value:.3g}")
    if path:
        import taichi

        versions = {"python": platform.python_version(), "numpy": np.__version__}
        known = machine | {"system": platform.platform(), "taichi": ".".join(map(str, taichi.__version__))} | versions
        bars = [{"bar": text, "limit": bar, "value": value, "held": bool(held)} for text, value, bar, held in verdicts]
        path.write_text(json.dumps({"machine": known, "results": results, "bars": bars}, indent=1), encoding="utf-8")
    return 0 if all(held for *_, held in verdicts) else 1
