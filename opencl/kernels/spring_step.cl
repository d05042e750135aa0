/* Leapfrog on a network of springs, gathered: one work-item sums the row of half-springs of one particle.
 *
 *   drift x += dt/2 v, kick v' = A(x) + f(x, v) over dt at fixed x, drift x += dt/2 v
 *   A_i = sum_h D_h (|d| - L_h) d/|d| / m_i,  f_i = sum_h c_h (u.d) d/|d|^2 / m_i,  d = x_j - x_i,  u = v_j - v_i
 *
 * Without damping a step is `kick_and_drift` alone: the kick and the two drifts around it are fused, and the positions have
 * two buffers. With damping along the axis the kick is the midpoint rule, `first_half` and `second_half`. Rows are compressed
 * (start, neighbor); vectors are padded to four numbers, and the fourth is zero. No atomics, so the bits repeat.
 *
 * Built with -DREAL=float or double, and -DREAL4=float4 or double4.
 */
#ifdef NEEDS_FP64
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#endif

__kernel void drift(const int count, __global REAL4 *restrict x, __global const REAL4 *restrict v, const REAL time) {
    const int i = get_global_id(0);
    if (i < count) x[i] += time * v[i];
}

__kernel void kick_and_drift(const int count, __global const int *restrict start, __global const int *restrict neighbor,
                             __global const REAL *restrict stiffness, __global const REAL *restrict rest_length,
                             __global const REAL *restrict mass, __global const REAL4 *restrict x,
                             __global REAL4 *restrict x_next, __global REAL4 *restrict v, const REAL dt, const REAL time) {
    const int i = get_global_id(0);
    if (i >= count) return;
    const REAL4 here = x[i];
    REAL4 force = (REAL4)(0);
    const int end = start[i + 1];
    for (int h = start[i]; h < end; h++) {
        const REAL4 d = x[neighbor[h]] - here;
        const REAL distance = sqrt(d.x * d.x + d.y * d.y + d.z * d.z);
        const REAL weight = distance > 0 ? stiffness[h] * (distance - rest_length[h]) / distance : 0;
        force += weight * d;
    }
    const REAL4 faster = v[i] + dt / mass[i] * force;
    v[i] = faster;
    x_next[i] = here + time * faster;
}

__kernel void first_half(const int count, __global const int *restrict start, __global const int *restrict neighbor,
                         __global const REAL *restrict stiffness, __global const REAL *restrict rest_length,
                         __global const REAL *restrict damping, __global const REAL *restrict mass,
                         __global const REAL4 *restrict x, __global const REAL4 *restrict v, __global REAL4 *restrict middle,
                         __global REAL4 *restrict acceleration, const REAL dt) {
    const int i = get_global_id(0);
    if (i >= count) return;
    const REAL4 here = x[i], moving = v[i];
    REAL4 elastic = (REAL4)(0), braking = (REAL4)(0);
    const int end = start[i + 1];
    for (int h = start[i]; h < end; h++) {
        const int j = neighbor[h];
        const REAL4 d = x[j] - here, u = v[j] - moving;
        const REAL distance = sqrt(d.x * d.x + d.y * d.y + d.z * d.z);
        const REAL inverse = distance > 0 ? 1 / distance : 0;
        elastic += stiffness[h] * (distance - rest_length[h]) * inverse * d;
        braking += damping[h] * (u.x * d.x + u.y * d.y + u.z * d.z) * (inverse * inverse) * d;
    }
    const REAL inverse_mass = 1 / mass[i];
    acceleration[i] = inverse_mass * elastic;
    middle[i] = moving + dt / 2 * inverse_mass * (elastic + braking);
}

__kernel void second_half(const int count, __global const int *restrict start, __global const int *restrict neighbor,
                          __global const REAL *restrict damping, __global const REAL *restrict mass,
                          __global const REAL4 *restrict x, __global REAL4 *restrict x_next, __global REAL4 *restrict v,
                          __global const REAL4 *restrict middle, __global const REAL4 *restrict acceleration, const REAL dt,
                          const REAL time) {
    const int i = get_global_id(0);
    if (i >= count) return;
    const REAL4 here = x[i], moving = middle[i];
    REAL4 braking = (REAL4)(0);
    const int end = start[i + 1];
    for (int h = start[i]; h < end; h++) {
        const int j = neighbor[h];
        const REAL4 d = x[j] - here, u = middle[j] - moving;
        const REAL squared = d.x * d.x + d.y * d.y + d.z * d.z;
        braking += (squared > 0 ? damping[h] * (u.x * d.x + u.y * d.y + u.z * d.z) / squared : 0) * d;
    }
    const REAL4 faster = v[i] + dt * (acceleration[i] + braking / mass[i]);
    v[i] = faster;
    x_next[i] = here + time * faster;
}
