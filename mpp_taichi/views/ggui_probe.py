"""Whether GGUI works here: a broken driver may abort the whole process, so the driver is tried in a process of its own."""

import os
import subprocess
import sys
import tempfile
from functools import lru_cache

from mpp_taichi.device.taichi_environment import without_user_variables
from mpp_taichi.errors import BackendError

PROBE_SECONDS = 60.0
PROBE = """
import os
os.environ["TI_SKIP_VERSION_CHECK"] = "ON"
import taichi as ti
ti.init(arch=ti.cpu, log_level=ti.ERROR)
window = ti.ui.Window("probe", (64, 64), show_window={shown})
window.get_canvas().set_background_color((1.0, 1.0, 1.0))
if {shown}:
    window.show()
else:
    assert window.get_image_buffer_as_numpy().max() > 0.5
"""


@lru_cache(maxsize=2)
def probe(*, shown: bool) -> str:
    """Why GGUI does not work here, for a window or for a picture without one; empty when it does. Takes about a second."""
    if shown and sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return "there is no display (neither DISPLAY nor WAYLAND_DISPLAY is set)"
    command = [sys.executable, "-c", PROBE.format(shown=shown)]
    try:
        with tempfile.TemporaryDirectory() as folder:  # GGUI leaves a file where it runs, and would follow a link of its name
            done = subprocess.run(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                env=without_user_variables(os.environ),
                cwd=folder,
                timeout=PROBE_SECONDS,
                check=False,
            )
    except subprocess.TimeoutExpired:
        return f"GGUI did not draw within {PROBE_SECONDS:.0f} s"
    except OSError as error:
        return f"GGUI cannot be tried: {error.strerror or error}"
    if done.returncode == 0:
        return ""
    lines = [line for line in done.stdout.decode("utf-8", "replace").splitlines() if line and not line.startswith("[Taichi]")]
    return f"GGUI does not start (code {done.returncode}): " + (lines[-1] if lines else "it said nothing")


def require_ggui() -> None:
    """Refuse pictures by GGUI without a window where GGUI does not work.

    Raises:
        BackendError: it does not work here.
    """
    problem = probe(shown=False)
    if problem:
        raise BackendError(f"cannot draw with GGUI: {problem}")
