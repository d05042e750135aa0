"""Taichi peaks: the two probes of `peaks` in Taichi."""

import taichi as ti

from mpp_taichi.compare.peaks import ADDEND, CHAINS, COPY_BYTES, COPY_THREADS, FACTOR, ROUNDS, SUM_THREADS, fastest
from mpp_taichi.device.availability import availability
from mpp_taichi.device.backends import Device
from mpp_taichi.device.fast_taichi.explicit_vectors import explicit_vectors
from mpp_taichi.device.fast_taichi.lane_arithmetic import VECTOR_BYTES, multiply_add


def taichi_peaks(device: Device) -> dict[str, float]:
    """Flops and bytes per second of Taichi's own kernels on the started device, in its precision."""
    on_gpu = not device.on_cpu and not availability(device.backend)["software"]
    return {"flops": _taichi_flops(device, on_gpu), "bytes": _taichi_bytes(device, on_gpu)}


def _taichi_flops(device: Device, on_gpu: bool) -> float:
    width = 4 if device.precision != "f64" else 8
    lanes = VECTOR_BYTES // width if device.on_cpu else 1
    threads = SUM_THREADS[on_gpu]
    out = ti.field(float, threads)

    @ti.kernel
    def scalars(factor: float, addend: float):
        for i in out:
            sums = [ti.cast(k, float) for k in ti.static(range(CHAINS))]
            for _ in range(ROUNDS):
                for k in ti.static(range(CHAINS)):
                    sums[k] = sums[k] * factor + addend
            total = sums[0]
            for k in ti.static(range(1, CHAINS)):
                total = total + sums[k]
            out[i] = total

    @ti.kernel
    def vectors(factor: float, addend: float):
        for i in out:
            factors = ti.Vector([factor for lane in ti.static(range(lanes))])
            addends = ti.Vector([addend for lane in ti.static(range(lanes))])
            sums = [ti.Vector([factor for lane in ti.static(range(lanes))]) for k in ti.static(range(CHAINS))]
            for _ in range(ROUNDS):
                for k in ti.static(range(CHAINS)):
                    sums[k] = multiply_add(sums[k], factors, addends)
            total = sums[0]
            for k in ti.static(range(1, CHAINS)):
                total = total + sums[k]
            result = total[0]
            for lane in ti.static(range(1, lanes)):
                result = result + total[lane]
            out[i] = result

    def call() -> None:
        if device.on_cpu:
            with explicit_vectors():
                vectors(FACTOR, ADDEND)
        else:
            scalars(FACTOR, ADDEND)
        ti.sync()

    return 2.0 * lanes * CHAINS * ROUNDS * threads / fastest(call)


def _taichi_bytes(device: Device, on_gpu: bool) -> float:
    builder = ti.FieldsBuilder()
    threads = COPY_BYTES[False] // 4 if device.on_cpu else COPY_THREADS[on_gpu]
    rounds = COPY_BYTES[True] // 4 // threads if on_gpu else 1
    count = threads * rounds
    source, target = ti.field(ti.f32), ti.field(ti.f32)
    builder.dense(ti.i, count).place(source)
    builder.dense(ti.i, count).place(target)
    tree = builder.finalize()

    @ti.kernel
    def copy():
        for i in range(threads):
            for k in range(rounds):
                target[i + k * threads] = source[i + k * threads]

    def call() -> None:
        copy()
        ti.sync()

    try:
        return 8.0 * count / fastest(call)
    finally:
        tree.destroy()
