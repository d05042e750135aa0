"""Compiles and loads the references in C that benchmarks are measured beside."""

import ctypes
import shutil
import subprocess
from pathlib import Path

# Options for the compiler alone, never for the linker: with -ffast-math gcc links a start-up file which, as soon as the library
# is loaded, makes the whole process flush subnormal numbers to zero, in our kernels and in NumPy as well.
FAST_MATHS = {"-ffast-math", "-Ofast"}


def compile_c(source, flags, folder, *, without=()):
    """The library of a source beside this file and the compiler's version, or None and the reason why there is none.

    A flag in `without` is left out where the compiler does not know it.
    """
    compiler = next((path for name in ("gcc", "cc") if (path := shutil.which(name))), None)
    if compiler is None:
        return None, "no gcc or cc here"
    path = Path(__file__).with_name(source)
    compiled, library = Path(folder) / f"{path.stem}.o", Path(folder) / f"{path.stem}.so"
    for chosen in (flags, [flag for flag in flags if flag not in without]):
        linked = [flag for flag in chosen if flag not in FAST_MATHS]
        result = subprocess.run([compiler, *chosen, "-c", str(path), "-o", str(compiled)], capture_output=True, text=True)
        if result.returncode == 0:
            command = [compiler, *linked, "-shared", str(compiled), "-o", str(library), "-lm"]
            result = subprocess.run(command, capture_output=True, text=True)
        if result.returncode == 0:
            version = subprocess.run([compiler, "--version"], capture_output=True, text=True).stdout.splitlines()[0]
            return ctypes.CDLL(str(library)), version
    return None, f"{compiler} fails: {result.stderr.strip().splitlines()[0]}"
