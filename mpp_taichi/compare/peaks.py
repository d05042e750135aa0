"""Peaks: the highest rates of a device, by two small probes: multiply–adds in registers, and a copy of a large array.

No kernel of a scene can be faster. Where several backends share a device, its peak is the best of their probes.
"""

import time as clock
from collections.abc import Callable

import numpy as np

REPEATS = 3
CHAINS = 10  # independent sums: enough to hide the latency of each
ROUNDS = 400
# On a processor, and on a GPU: loop iterations of the first probe, and bytes of the copy, beyond all caches.
SUM_THREADS = {False: 4096, True: 1 << 18}
COPY_BYTES = {False: 1 << 26, True: 1 << 29}
COPY_THREADS = {False: 1 << 22, True: 1 << 20}  # on Vulkan, which starts at most some eight million threads
MATRIX = 1024
FACTOR, ADDEND = 0.999, 0.001  # their sum stays near 1


def fastest(call: Callable[[], None]) -> float:
    """Seconds of the fastest of some calls, after one uncounted call: a peak is the highest rate reached."""
    call()
    seen = []
    for _ in range(REPEATS):
        began = clock.perf_counter()
        call()
        seen.append(clock.perf_counter() - began)
    return min(seen)


def numpy_peaks() -> dict[str, float]:
    """Flops per second of a product of matrices, in f64, and bytes per second of a copy."""
    left, right = np.random.default_rng(1).standard_normal((2, MATRIX, MATRIX))
    source = np.ones(COPY_BYTES[False] // 8)
    target = np.empty_like(source)
    product = np.empty_like(left)
    return {
        "flops": 2.0 * MATRIX**3 / fastest(lambda: np.matmul(left, right, out=product)),
        "bytes": 2.0 * source.nbytes / fastest(lambda: np.copyto(target, source)),
    }
