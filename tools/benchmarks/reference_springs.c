/* Leapfrog on a network of springs, gathered, written by hand in C: the speed to compare with.
 *
 *   drift x += dt/2 v, kick v' = A(x) + f(x, v) over dt at fixed x, drift x += dt/2 v
 *   A_i = sum_h D_h (|d| - L_h) d/|d| / m_i,  f_i = sum_h c_h (u.d) d/|d|^2 / m_i,  d = x_j - x_i,  u = v_j - v_i
 *
 * Without damping a step is one loop: the kick and the two drifts around it are fused, and the positions have two buffers.
 * With damping along the axis the kick is the midpoint rule: a first loop sums A and f(v), a second one f(v_middle).
 * Half-springs lie in compressed sparse rows; each particle sums its own row, so no atomics. Vectors are padded to four
 * numbers. One parallel region holds all steps.
 *
 * Build: cc -O3 -march=native -ffast-math -fopenmp -fPIC -c, and linked without -ffast-math (c_reference.py)
 */
#include <math.h>
#include <stdint.h>
#ifdef _OPENMP
#include <omp.h>
int largest_thread_count(void) { return omp_get_max_threads(); }
#else
int largest_thread_count(void) { return 1; }
#endif

#define DEFINE_SPRINGS(P, real, root)                                                                                         \
    static void opening_##P(int count, real *restrict x, const real *restrict v, real drift) {                                \
        _Pragma("omp for schedule(static)")                                                                                   \
        for (int i = 0; i < 4 * count; i++) x[i] += drift * v[i];                                                             \
    }                                                                                                                         \
    static void kick_##P(int count, const int32_t *restrict start, const int32_t *restrict neighbor,                          \
                         const real *restrict stiffness, const real *restrict rest_length, const real *restrict mass,         \
                         const real *restrict x, real *restrict x_next, real *restrict v, real dt, real drift) {              \
        _Pragma("omp for schedule(static)")                                                                                   \
        for (int i = 0; i < count; i++) {                                                                                     \
            const real xi = x[4 * i], yi = x[4 * i + 1], zi = x[4 * i + 2];                                                   \
            real ax = 0, ay = 0, az = 0;                                                                                      \
            for (int h = start[i]; h < start[i + 1]; h++) {                                                                   \
                const real *other = x + 4 * (int64_t)neighbor[h];                                                             \
                const real dx = other[0] - xi, dy = other[1] - yi, dz = other[2] - zi;                                        \
                const real length = root(dx * dx + dy * dy + dz * dz);                                                        \
                const real weight = length > 0 ? stiffness[h] * (length - rest_length[h]) / length : 0;                       \
                ax += weight * dx;                                                                                            \
                ay += weight * dy;                                                                                            \
                az += weight * dz;                                                                                            \
            }                                                                                                                 \
            const real factor = dt / mass[i];                                                                                 \
            const real vx = v[4 * i] += factor * ax, vy = v[4 * i + 1] += factor * ay, vz = v[4 * i + 2] += factor * az;      \
            x_next[4 * i] = xi + drift * vx;                                                                                  \
            x_next[4 * i + 1] = yi + drift * vy;                                                                              \
            x_next[4 * i + 2] = zi + drift * vz;                                                                              \
        }                                                                                                                     \
    }                                                                                                                         \
    static void first_half_##P(int count, const int32_t *restrict start, const int32_t *restrict neighbor,                    \
                               const real *restrict stiffness, const real *restrict rest_length,                              \
                               const real *restrict damping, const real *restrict mass, const real *restrict x,               \
                               const real *restrict v, real *restrict middle, real *restrict a, real dt) {                    \
        _Pragma("omp for schedule(static)")                                                                                   \
        for (int i = 0; i < count; i++) {                                                                                     \
            const real xi = x[4 * i], yi = x[4 * i + 1], zi = x[4 * i + 2];                                                   \
            const real ui = v[4 * i], vi = v[4 * i + 1], wi = v[4 * i + 2];                                                   \
            real ax = 0, ay = 0, az = 0, bx = 0, by = 0, bz = 0;                                                              \
            for (int h = start[i]; h < start[i + 1]; h++) {                                                                   \
                const real *other = x + 4 * (int64_t)neighbor[h], *moving = v + 4 * (int64_t)neighbor[h];                     \
                const real dx = other[0] - xi, dy = other[1] - yi, dz = other[2] - zi;                                        \
                const real closing = (moving[0] - ui) * dx + (moving[1] - vi) * dy + (moving[2] - wi) * dz;                   \
                const real length = root(dx * dx + dy * dy + dz * dz);                                                        \
                const real inverse = length > 0 ? 1 / length : 0;                                                             \
                const real weight = stiffness[h] * (length - rest_length[h]) * inverse;                                       \
                const real brake = damping[h] * closing * (inverse * inverse);                                                \
                ax += weight * dx;                                                                                            \
                ay += weight * dy;                                                                                            \
                az += weight * dz;                                                                                            \
                bx += brake * dx;                                                                                             \
                by += brake * dy;                                                                                             \
                bz += brake * dz;                                                                                             \
            }                                                                                                                 \
            const real inverse_mass = 1 / mass[i];                                                                            \
            a[4 * i] = inverse_mass * ax;                                                                                     \
            a[4 * i + 1] = inverse_mass * ay;                                                                                 \
            a[4 * i + 2] = inverse_mass * az;                                                                                 \
            middle[4 * i] = ui + dt / 2 * inverse_mass * (ax + bx);                                                           \
            middle[4 * i + 1] = vi + dt / 2 * inverse_mass * (ay + by);                                                       \
            middle[4 * i + 2] = wi + dt / 2 * inverse_mass * (az + bz);                                                       \
        }                                                                                                                     \
    }                                                                                                                         \
    static void second_half_##P(int count, const int32_t *restrict start, const int32_t *restrict neighbor,                   \
                                const real *restrict damping, const real *restrict mass, const real *restrict x,              \
                                real *restrict x_next, real *restrict v, const real *restrict middle,                         \
                                const real *restrict a, real dt, real drift) {                                                \
        _Pragma("omp for schedule(static)")                                                                                   \
        for (int i = 0; i < count; i++) {                                                                                     \
            const real xi = x[4 * i], yi = x[4 * i + 1], zi = x[4 * i + 2];                                                   \
            const real ui = middle[4 * i], vi = middle[4 * i + 1], wi = middle[4 * i + 2];                                    \
            real bx = 0, by = 0, bz = 0;                                                                                      \
            for (int h = start[i]; h < start[i + 1]; h++) {                                                                   \
                const real *other = x + 4 * (int64_t)neighbor[h], *moving = middle + 4 * (int64_t)neighbor[h];                \
                const real dx = other[0] - xi, dy = other[1] - yi, dz = other[2] - zi;                                        \
                const real closing = (moving[0] - ui) * dx + (moving[1] - vi) * dy + (moving[2] - wi) * dz;                   \
                const real squared = dx * dx + dy * dy + dz * dz;                                                             \
                const real brake = squared > 0 ? damping[h] * closing / squared : 0;                                          \
                bx += brake * dx;                                                                                             \
                by += brake * dy;                                                                                             \
                bz += brake * dz;                                                                                             \
            }                                                                                                                 \
            const real inverse_mass = 1 / mass[i];                                                                            \
            const real vx = v[4 * i] += dt * (a[4 * i] + inverse_mass * bx);                                                  \
            const real vy = v[4 * i + 1] += dt * (a[4 * i + 1] + inverse_mass * by);                                          \
            const real vz = v[4 * i + 2] += dt * (a[4 * i + 2] + inverse_mass * bz);                                          \
            x_next[4 * i] = xi + drift * vx;                                                                                  \
            x_next[4 * i + 1] = yi + drift * vy;                                                                              \
            x_next[4 * i + 2] = zi + drift * vz;                                                                              \
        }                                                                                                                     \
    }                                                                                                                         \
    /* damping may be null; the result is in x, whatever the number of steps. */                                              \
    void springs_##P(int count, const int32_t *start, const int32_t *neighbor, const real *stiffness,                         \
                     const real *rest_length, const real *damping, const real *mass, real *x, real *v, real *x_other,         \
                     real *middle, real *a, real dt, int steps, int threads) {                                                \
        _Pragma("omp parallel num_threads(threads)")                                                                          \
        {                                                                                                                     \
            real *from = x, *to = x_other;                                                                                    \
            opening_##P(count, from, v, dt / 2);                                                                              \
            for (int s = 0; s < steps; s++) {                                                                                 \
                const real drift = s == steps - 1 ? dt / 2 : dt;                                                              \
                if (damping) {                                                                                                \
                    first_half_##P(count, start, neighbor, stiffness, rest_length, damping, mass, from, v, middle, a, dt);    \
                    second_half_##P(count, start, neighbor, damping, mass, from, to, v, middle, a, dt, drift);                \
                } else                                                                                                        \
                    kick_##P(count, start, neighbor, stiffness, rest_length, mass, from, to, v, dt, drift);                   \
                real *kept = from;                                                                                            \
                from = to;                                                                                                    \
                to = kept;                                                                                                    \
            }                                                                                                                 \
            if (from != x) {                                                                                                  \
                _Pragma("omp for schedule(static)")                                                                           \
                for (int i = 0; i < 4 * count; i++) x[i] = from[i];                                                           \
            }                                                                                                                 \
        }                                                                                                                     \
    }

DEFINE_SPRINGS(f32, float, sqrtf)
DEFINE_SPRINGS(f64, double, sqrt)
