"""The spring step in OpenCL: leapfrog on a network, for comparison with the program's own. Needs pyopencl and a driver."""

from pathlib import Path

import numpy as np

KERNELS = Path(__file__).parent / "kernels" / "spring_step.cl"
# Square roots and divisions keep the accuracy that OpenCL promises; products and sums may be fused.
BUILD_OPTIONS = ("-cl-mad-enable", "-cl-no-signed-zeros")


def devices():
    """All OpenCL devices here, or an empty list and the reason: (devices, reason)."""
    try:
        import pyopencl
    except ImportError as error:
        return [], f"pyopencl cannot be imported: {error}"
    try:
        found = [device for platform in pyopencl.get_platforms() for device in platform.get_devices()]
    except pyopencl.Error as error:
        return [], f"no OpenCL platform: {error}"
    return found, "" if found else "no OpenCL device"


class SpringStep:
    """Leapfrog on one device.

    `rows` are half-springs in compressed sparse rows, as `mpp_taichi.state.half_springs` makes them: spring_start,
    spring_neighbor, spring_stiffness, spring_rest_length, spring_damping. Damping acts along the axis of a spring.
    Positions and velocities have the shape (particle_count, 3).
    """

    def __init__(self, device, rows, position, velocity, mass, *, precision, damped, work_group=64):
        """Compile, and copy to the device."""
        import pyopencl as cl

        self._cl = cl
        self.real = np.float32 if precision == "f32" else np.float64
        name = "float" if precision == "f32" else "double"
        options = [*BUILD_OPTIONS, f"-DREAL={name}", f"-DREAL4={name}4", *(["-DNEEDS_FP64"] if precision == "f64" else [])]
        context = cl.Context([device])
        self.queue = cl.CommandQueue(context)
        program = cl.Program(context, KERNELS.read_text(encoding="utf-8")).build(options)
        names = ("drift", "first_half", "second_half") if damped else ("drift", "kick_and_drift")
        self.kernels = {key: cl.Kernel(program, key) for key in names}
        self.count = len(mass)
        self.damped = damped
        self.local = (work_group,)
        self.work = (-(-self.count // work_group) * work_group,)
        self.rows = {}
        for key in ("start", "neighbor", "stiffness", "rest_length", "damping", "mass"):
            values = mass if key == "mass" else rows[f"spring_{key}"]
            self.rows[key] = self._buffer(values.astype(np.int32 if key in ("start", "neighbor") else self.real))
        self.position, self.other, self.velocity, self.middle, self.acceleration = (
            self._buffer(self._padded(values)) for values in (position, position, velocity, velocity, velocity)
        )

    def _buffer(self, values):
        flags = self._cl.mem_flags
        return self._cl.Buffer(self.queue.context, flags.READ_WRITE | flags.COPY_HOST_PTR, hostbuf=np.ascontiguousarray(values))

    def _padded(self, vectors):
        result = np.zeros((self.count, 4), self.real)
        result[:, :3] = vectors
        return result

    def write(self, position, velocity):
        """Set positions and velocities."""
        for target, values in ((self.position, position), (self.velocity, velocity)):
            self._cl.enqueue_copy(self.queue, target, self._padded(values))

    def read(self):
        """Positions and velocities as float64."""
        results = []
        for source in (self.position, self.velocity):
            values = np.empty((self.count, 4), self.real)
            self._cl.enqueue_copy(self.queue, values, source)
            results.append(values[:, :3].astype(np.float64))
        return tuple(results)

    def advance(self, dt, steps):
        """Advance by `steps` steps, and wait for the end. Drifts that follow each other are one."""
        rows, count = self.rows, np.int32(self.count)
        springs = (rows["start"], rows["neighbor"])
        elastic = (rows["stiffness"], rows["rest_length"])
        self._run("drift", count, self.position, self.velocity, self.real(dt / 2))
        for s in range(steps):
            times = self.real(dt), self.real(dt / 2 if s == steps - 1 else dt)
            if self.damped:
                moving = (self.position, self.velocity, self.middle, self.acceleration)
                self._run("first_half", count, *springs, *elastic, rows["damping"], rows["mass"], *moving, times[0])
                moving = (self.position, self.other, self.velocity, self.middle, self.acceleration)
                self._run("second_half", count, *springs, rows["damping"], rows["mass"], *moving, *times)
            else:
                moving = (self.position, self.other, self.velocity)
                self._run("kick_and_drift", count, *springs, *elastic, rows["mass"], *moving, *times)
            self.position, self.other = self.other, self.position
        self.queue.finish()

    def _run(self, name, *arguments):
        self.kernels[name](self.queue, self.work, self.local, *arguments)
