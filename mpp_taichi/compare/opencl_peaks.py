"""Opencl peaks: the two probes of `peaks` in OpenCL."""

from typing import Any

import numpy as np

from mpp_taichi.compare.peaks import ADDEND, CHAINS, COPY_BYTES, FACTOR, ROUNDS, SUM_THREADS, fastest

LANES = 8
SOURCE = """
#ifdef cl_khr_fp64
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#endif
kernel void sums(global REAL *out, REAL factor, REAL addend) {
    VECTOR sum[CHAINS];
    for (int k = 0; k < CHAINS; ++k) sum[k] = (VECTOR)(k);
    for (int n = 0; n < ROUNDS; ++n)
        for (int k = 0; k < CHAINS; ++k) sum[k] = fma(sum[k], (VECTOR)(factor), (VECTOR)(addend));
    VECTOR total = sum[0];
    for (int k = 1; k < CHAINS; ++k) total += sum[k];
    out[get_global_id(0)] = total.s0 + total.s1 + total.s2 + total.s3 + total.s4 + total.s5 + total.s6 + total.s7;
}
kernel void copy(global const float *source, global float *target) {
    target[get_global_id(0)] = source[get_global_id(0)];
}
"""


def opencl_peaks(handle: Any, precision: str, *, on_gpu: bool) -> dict[str, float]:
    """Flops and bytes per second of a pyopencl device, in a precision."""
    import pyopencl as cl

    context = cl.Context([handle])
    queue = cl.CommandQueue(context)
    real, kind = ("double", np.float64) if precision == "f64" else ("float", np.float32)
    options = [f"-DREAL={real}", f"-DVECTOR={real}{LANES}", f"-DCHAINS={CHAINS}", f"-DROUNDS={ROUNDS}"]
    program = cl.Program(context, SOURCE).build(options=options)
    sums, copy = cl.Kernel(program, "sums"), cl.Kernel(program, "copy")
    threads, count = SUM_THREADS[on_gpu], COPY_BYTES[on_gpu] // 4
    out = cl.Buffer(context, cl.mem_flags.WRITE_ONLY, threads * np.dtype(kind).itemsize)
    source, target = (cl.Buffer(context, cl.mem_flags.READ_WRITE, 4 * count) for _ in range(2))
    cl.enqueue_fill_buffer(queue, source, np.ones(1, np.float32), 0, 4 * count)

    def add() -> None:
        sums(queue, (threads,), None, out, kind(FACTOR), kind(ADDEND))
        queue.finish()

    def move() -> None:
        copy(queue, (count,), None, source, target)
        queue.finish()

    return {"flops": 2.0 * LANES * CHAINS * ROUNDS * threads / fastest(add), "bytes": 8.0 * count / fastest(move)}
