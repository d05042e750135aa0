"""Parts that replace functions of Taichi 1.7.4, or add missing functions, to make it faster.

`install` puts all of them in place, once for a process; device/backends.py calls it. The environment variable MPP_TAICHI_FAST
turns them off: `off` turns off all, and names separated by commas turn off these parts. Any other version of Taichi than 1.7.4 runs
with all of them off. Taichi then does the work in its own way: the results are right, but the gains of the table are lost. The
summary of a run, its `--json` object and `mpp-taichi info` say which parts are off. Bits may differ in sums of pairs
(lane_arithmetic), of springs (spring_lanes) and of gravity by a tree (series_walk) only.

"All" systems means all on which Taichi runs; "x64" means Linux on x86-64. To drop a part, do what the last column says, and
remove the part's name from `switch.NAMES`, its row here and its tests.

| name | replaces in Taichi | why | measured gain | systems | how to drop it |
|---|---|---|---|---|---|
| source_cache | `getsourcelines`, `textwrap`, `get_pos_info`, `get_traceback`, `getframeinfo` (while Taichi is imported, for all) | source texts are read and wrapped again for every expression, and looked for in all modules | a quarter of a cold start, a twentieth of a warm start | all | delete the file |
| launch_cache | `Kernel.__call__`, `ti.data_oriented` | the way through Python is the same for every launch | 3.5 µs for a launch instead of 18 µs | all | delete the file; results of kernels become `ti.Matrix` |
| serial_loops | `ASTTransformer.build_For` | waking a thread takes longer than a loop over few particles | 25 to 100 µs for each loop up to 4,096 particles | all CPUs | let `SerialLoops` do nothing |
| worker_threads | the runtime's thread pool, `impl.reset`; `do_nothing` in one kernel | Taichi's threads sleep between two loops | 2 µs for a short loop instead of 25 to 60 µs | x64 | delete worker_threads.py and .c, and the call of `start_threads` |
| quick_compilation | the option `opt_level` of the compiler | Taichi's own passes over long kernels are slow | a fourth to an eighth of the compile time of implicit steps and contacts | all | replace the context by nothing |
| short_compilation | the option `cfg_optimization` of the compiler | a pilot run is too short to earn Taichi's analysis of the control flow | half to two thirds of the compile time of long steps, in `accuracy` | all | replace the context by nothing |
| explicit_vectors | the option `real_matrix_scalarize` of the compiler | LLVM finds only a fourth of a register's lanes again | a third to a fourth of the time of the pair sum | all CPUs | replace the context by nothing |
| lane_arithmetic | nothing; bitcode for a product with a sum, and for the inverse root | Taichi has neither | two thirds of the time of the pair sum | x64 | keep the written-out branch of each function |
| prefetch | nothing; bitcode for a fetch ahead | Taichi has none | part of 710 instead of 1,730 ns for a collision of 100,000 disks | x64 | remove the calls |
| spring_lanes | nothing; bitcode that sums springs with a particle in each lane | LLVM finds vectors of four half-springs only | 0.4 of the time of a step of 4,000 springs, 0.25 to 0.6 of a million | x64 with AVX-512 | delete spring_lanes.py and .c, forces/_spring_slices.py, and the calls of `sum_slices` |
| series_walk | nothing; bitcode that sums gravity by series over the nodes of a tree | Taichi compiles such sums for 44 s and more | 0.4 of the time of all forces on a million bodies | x64 with AVX-512 | delete series_walk.py, the files series_*, neighbors/tree_series.py, and its lines in neighbors/tree.py |
| large_pages | nothing; asks Linux for pages of 2 MiB | addresses of small pages are not at hand | from 16,384 particles on, for what jumps about in memory | Linux from 6.1 | remove the call |

`bitcode` links the files `*.bc` into kernels, and `vector_fields` reads vectors of fields in the way explicit vectors need; both
serve the parts above and replace nothing.
"""  # noqa: E501

import contextlib
import importlib
from typing import Any

from mpp_taichi.device.fast_taichi import switch

REPLACING = ("source_cache", "launch_cache", "serial_loops", "worker_threads", "quick_compilation", "explicit_vectors")
"""The parts that have an `install` of their own; the others ask `switch.is_on` while a kernel is compiled."""


def install(taichi: Any) -> None:
    """Put every part in place that is on; a second call changes nothing.

    Raises:
        ArgumentError: MPP_TAICHI_FAST has a name that no part has.
    """
    if switch.is_decided():
        return
    in_use = switch.decide(switch.variable(), taichi.__version__)
    for name in REPLACING:
        if name in in_use:
            importlib.import_module(f"{__name__}.{name}").install()


def being_imported() -> contextlib.AbstractContextManager[None]:
    """A context in which Taichi is imported faster.

    Raises:
        ArgumentError: MPP_TAICHI_FAST has a name that no part has.
    """
    from mpp_taichi.device.fast_taichi import source_cache

    return source_cache.lines_read_directly() if switch.is_wanted("source_cache") else contextlib.nullcontext()


def start_threads() -> None:
    """Give the runtime that Taichi has just started on the CPU its worker threads."""
    from mpp_taichi.device.fast_taichi import worker_threads

    worker_threads.start()
