"""The contenders of tools/benchmarks/benchmark_springs.py: one network, one step, in Taichi, C, OpenCL and NumPy."""

import ctypes
import functools
import time
from dataclasses import replace

import numpy as np
from c_reference import compile_c

DT = 0.01
CHECKED_STEPS = 10
SMALLEST_SAMPLE = 0.02  # seconds of repeated steps that one sample of the clock covers
C_FLAGS = "-O3 -march=native -ffast-math -fopenmp -fPIC".split()


def sheet(spring_count, order):
    """A square sheet of about so many springs, crumpled: nearest neighbours and diagonals, nothing equal."""
    from mpp_taichi.snapshot import Snapshot, Springs

    side = round((spring_count / 4) ** 0.5) + 1
    count = side * side
    index = np.arange(count).reshape(side, side)
    pairs = [(index[:, :-1], index[:, 1:]), (index[:-1], index[1:])]
    pairs += [(index[:-1, :-1], index[1:, 1:]), (index[:-1, 1:], index[1:, :-1])]
    between = np.concatenate([np.stack([near.ravel(), far.ravel()], axis=1) for near, far in pairs])
    random = np.random.default_rng(count)
    rows, columns = np.divmod(np.arange(count), side)
    flat = np.stack([columns, rows, 0 * rows], axis=1).astype(float)
    if order == "random":
        number = random.permutation(count)
        between = number[between]
        flat[number] = flat.copy()
    # Rounded to f32, so that both precisions start from the same place.
    position, velocity, mass = (
        values.astype(np.float32).astype(np.float64)
        for values in (
            flat + random.uniform(-0.1, 0.1, (count, 3)),
            random.uniform(-0.1, 0.1, (count, 3)),
            random.uniform(0.5, 1.5, count),
        )
    )
    springs = Springs(
        between=between.astype(np.int32),
        stiffness=random.uniform(5.0, 15.0, len(between)).astype(np.float32).astype(np.float64),
        damping=random.uniform(0.1, 0.5, len(between)).astype(np.float32).astype(np.float64),
        rest_length=np.linalg.norm(flat[between[:, 1]] - flat[between[:, 0]], axis=1).astype(np.float32).astype(np.float64),
        color=np.zeros((len(between), 3)),
    )
    zeros = np.zeros((count, 3))
    return Snapshot(
        position, velocity, mass, zeros[:, 0], zeros[:, 0], zeros, np.ones((count, 3), bool), ("",) * count, springs
    )


def numpy_positions(snapshot, damped):
    """Where NumPy in float64 sees the particles after the checked steps."""
    near, far = snapshot.springs.between.T
    springs = snapshot.springs

    def sums(forces):
        result = np.empty_like(snapshot.position)
        for axis in range(3):
            result[:, axis] = np.bincount(near, forces[:, axis], snapshot.particle_count)
            result[:, axis] -= np.bincount(far, forces[:, axis], snapshot.particle_count)
        return result / snapshot.mass[:, None]

    x, v = snapshot.position.copy(), snapshot.velocity.copy()
    for _ in range(CHECKED_STEPS):
        x += DT / 2 * v
        separation = x[far] - x[near]
        length = np.sqrt(np.einsum("ij,ij->i", separation, separation))
        axis = separation / length[:, None]
        elastic = sums((springs.stiffness * (length - springs.rest_length))[:, None] * axis)
        if damped:

            def braking(velocity, axis=axis):
                closing = np.einsum("ij,ij->i", velocity[far] - velocity[near], axis)
                return sums((springs.damping * closing)[:, None] * axis)

            v = v + DT * (elastic + braking(v + DT / 2 * (elastic + braking(v))))
        else:
            v = v + DT * elastic
        x += DT / 2 * v
    return x


class Ours:
    """The program's own step, from its own parts."""

    def __init__(self, snapshot, damped):
        import taichi as ti

        from mpp_taichi.device.fast_taichi.spring_lanes import can_sum
        from mpp_taichi.forces._spring_slices import slices_of
        from mpp_taichi.forces._total_force import TotalForce
        from mpp_taichi.forces.spring import Spring
        from mpp_taichi.integrators.leapfrog import Leapfrog
        from mpp_taichi.state.state import State
        from mpp_taichi.state.vector_layout import VectorLayout
        from mpp_taichi.step import plans
        from mpp_taichi.step.choose import launcher_for

        total = TotalForce((Spring(damping="axial" if damped else "none"),), snapshot.particle_count, 3)
        integrator = Leapfrog(dt=DT)
        scratch = integrator.scratch_count(total.depends_on_velocity)
        self.snapshot = snapshot
        amount = plans.WORK_PER_HALF_SPRING * 2 * len(snapshot.springs) + plans.WORK_PER_PARTICLE * snapshot.particle_count
        self.plan = plans.choose(amount, on_cpu=True, replica_count=1)
        precision = "f32" if ti.lang.impl.current_cfg().default_fp == ti.f32 else "f64"
        total.slices = slices_of(snapshot, total.bonds, precision) if can_sum(precision) else None
        work = integrator.work_fields(total, snapshot, plan=self.plan, on_cpu=True) | total.work_fields()
        self.state = State(
            snapshot, dimensions=3, needs=total.needs, scratch_count=scratch, layout=VectorLayout.BY_PARTICLE, work=work
        )
        total.fill(self.state)
        total.place_slices(self.state, snapshot.springs)
        self.launcher = launcher_for(self.state, total, integrator, plan=self.plan, on_cpu=True)

    def advance(self, steps):
        """Run steps."""
        self.launcher.advance(0.0, DT, 0, steps)

    def restart(self):
        """Go back to the start."""
        self.state.write(self.snapshot.position, self.snapshot.velocity)

    def positions(self):
        """Where the particles are."""
        return self.state.read()[0]


class Atomic(Ours):
    """A parallel step that visits every spring once and adds its force to both ends by atomics. Without damping."""

    def __init__(self, snapshot, damped):
        import taichi as ti

        super().__init__(snapshot, damped)
        state, count = self.state, snapshot.particle_count
        spring_count = len(snapshot.springs)
        ends, stiffness, rest_length = ti.Vector.field(2, ti.i32, spring_count), *(ti.field(float, spring_count) for _ in "DL")
        kind = np.float32 if state.position.dtype == ti.f32 else np.float64
        ends.from_numpy(snapshot.springs.between)
        stiffness.from_numpy(snapshot.springs.stiffness.astype(kind))
        rest_length.from_numpy(snapshot.springs.rest_length.astype(kind))

        @ti.func
        def step(dt):
            for i in range(count):
                state.position[i] = state.position[i] + 0.5 * dt * state.velocity[i]
                state.acceleration[i] = ti.Vector.zero(float, 3)
            for s in range(spring_count):
                i, j = ends[s][0], ends[s][1]
                separation = state.position[j] - state.position[i]
                length = ti.sqrt(separation.dot(separation))
                force = stiffness[s] * (length - rest_length[s]) / length * separation
                state.acceleration[i] += force / state.mass[i]
                state.acceleration[j] -= force / state.mass[j]
            for i in range(count):
                state.velocity[i] = state.velocity[i] + dt * state.acceleration[i]
                state.position[i] = state.position[i] + 0.5 * dt * state.velocity[i]

        @ti.kernel
        def parallel(dt: float):
            step(dt)

        self._parallel = parallel

    def advance(self, steps):
        """Run steps."""
        for _ in range(steps):
            self._parallel(DT)


class C:
    """The reference in C."""

    def __init__(self, library, threads, precision, snapshot, damped):
        from mpp_taichi.state.half_springs import half_springs

        self.kind, self.number = (np.float32, ctypes.c_float) if precision == "f32" else (np.float64, ctypes.c_double)
        self.snapshot, self.threads = snapshot, threads
        rows = half_springs(snapshot)
        reals = ("spring_stiffness", "spring_rest_length", "spring_damping")
        self.rows = [rows["spring_start"], rows["spring_neighbor"], *(rows[name].astype(self.kind) for name in reals)]
        self.mass = snapshot.mass.astype(self.kind)
        self.vectors = [np.zeros((len(self.mass), 4), self.kind) for _ in range(5)]  # x, v, x_other, middle, a
        pointers = [array.ctypes.data_as(ctypes.c_void_p) for array in (*self.rows, self.mass, *self.vectors)]
        if not damped:
            pointers[4] = None
        self.call = functools.partial(getattr(library, f"springs_{precision}"), ctypes.c_int(len(self.mass)), *pointers)

    def advance(self, steps):
        """Run steps."""
        self.call(self.number(DT), ctypes.c_int(steps), ctypes.c_int(self.threads))

    def restart(self):
        """Go back to the start."""
        self.vectors[0][:, :3], self.vectors[1][:, :3] = self.snapshot.position, self.snapshot.velocity

    def positions(self):
        """Where the particles are."""
        return self.vectors[0][:, :3].astype(np.float64)


class OpenCL:
    """The kernels of opencl/, with the work-group size that is fastest here."""

    def __init__(self, device, precision, snapshot, damped):
        from mpp_taichi.compare.opencl_package import load_opencl
        from mpp_taichi.scene.load import load_scene

        ends = [{"body": {"mass": 1.0, "position": [place, 0, 0]}} for place in (0, 1)]
        link = {"link": {"between": [0, 1], "stiffness": 1.0, "rest_length": 1.0}}
        spec = load_scene({"title": "Sheet", "particles": ends, "springs": [link], "integrator": {"leapfrog": {"dt": DT}}})
        if not damped:
            springs = replace(snapshot.springs, damping=np.zeros(len(snapshot.springs)))
            snapshot = replace(snapshot, springs=springs)
        self.snapshot = snapshot
        self.runner = load_opencl().Runner(spec, snapshot, device=device, precision=precision)
        self.variant = self.runner.variant

    def advance(self, steps):
        """Run steps."""
        self.runner.advance(steps)

    def restart(self):
        """Go back to the start."""
        self.runner.restart(self.snapshot)

    def positions(self):
        """Where the particles are."""
        return self.runner.snapshot().position


def samples(contender, repeats):
    """Seconds per step, after a first call that is not counted."""
    found = []
    contender.restart()
    contender.advance(2)
    steps = steps_per_sample(contender)
    for _ in range(repeats):
        began = time.perf_counter()
        contender.advance(steps)
        found.append((time.perf_counter() - began) / steps)
    return found


def steps_per_sample(contender):
    """So many that the clock has something to measure."""
    steps = 2
    while True:
        began = time.perf_counter()
        contender.advance(steps)
        seconds = time.perf_counter() - began
        if seconds >= SMALLEST_SAMPLE / 2:
            return max(2, int(steps * SMALLEST_SAMPLE / seconds))
        steps *= 4


def compile_reference(folder):
    """The C library and a line on it, or None and the reason why there is none."""
    library, version = compile_c("reference_springs.c", C_FLAGS, folder, without=["-fopenmp"])
    if library is None:
        return None, version
    return library, f"{version}, {' '.join(C_FLAGS)}, up to {library.largest_thread_count()} threads"
