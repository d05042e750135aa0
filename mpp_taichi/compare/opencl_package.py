"""The place of the OpenCL kernels of this project: the folder `opencl/`, which the program does not use and is compared with.

The folder is loaded by its path and under a name of its own, so that it cannot be confused with another package `opencl`. In a
checkout it lies beside `mpp_taichi/`, in an installed package inside.
"""

import importlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

NAME = "mpp_taichi_opencl"
PLACES = (Path(__file__).parents[1] / "opencl", Path(__file__).parents[2] / "opencl")


def load_opencl(module: str = "runner") -> ModuleType:
    """A module of the folder; its `runner` runs scenes. Imports neither Taichi nor, before devices are asked for, pyopencl.

    Raises:
        ModuleNotFoundError: the folder does not exist, or it has no such module.
    """
    if NAME not in sys.modules:
        folder = next((place for place in PLACES if (place / "runner.py").is_file()), None)
        if folder is None:
            raise ModuleNotFoundError(f"no OpenCL kernels here, looked in {' and '.join(map(str, PLACES))}", name=NAME)
        spec = importlib.util.spec_from_file_location(NAME, folder / "__init__.py", submodule_search_locations=[str(folder)])
        assert spec is not None and spec.loader is not None
        package = importlib.util.module_from_spec(spec)
        sys.modules[NAME] = package
        spec.loader.exec_module(package)
    return importlib.import_module(f"{NAME}.{module}")
