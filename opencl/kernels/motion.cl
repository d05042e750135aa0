/* The stages of all integrators, one work-item a particle, with the forces on it summed where they are wanted.
 *
 *   A_i = g + pair sums + elastic_i / m_i,   f_i(v) = (friction_i - c v_i) / m_i
 *
 *   kick   solves v' = A + f(v) over h at fixed x by the midpoint rule: v += h (A + f(v + h/2 (A + f(v)))), or v += h A
 *   drift  x += time v
 *   stage  a slope of a Runge-Kutta method, in Nystroem's form, and the place of the next
 *
 * Positions that others look at are written to another buffer. Where there are pairs, each place is also noted in `columns`,
 * component by component, as their sum reads it.
 *
 * Where fields have formulas, FIELD_STEPS(T, HAS) is the text that returns the sum of their accelerations (fields.py), of x, y, z and
 * of m, q and R, which are the numbers of a particle in `quantities`; HAS(n) is bit n of `felt`.
 *
 * Built with -DSPRINGS, -DSPRING_DAMPING=0, 1 or 2, -DPAIRS, -DHELD where they are, and -DGRAVITY_X, _Y, _Z, -DDRAG as numbers.
 */
#ifdef FIELD_STEPS
#define FIELDS __global const REAL4 *restrict quantities, __global const int *restrict felt,
#define PASS_FIELDS quantities, felt,
#define FEELS(n) ((on & (1 << n)) != 0)
static inline REAL4 field(const REAL4 here, const REAL4 numbers, const int on) {
    const REAL x = here.x, y = here.y, z = here.z, m = numbers.x, q = numbers.y, R = numbers.z;
    FIELD_STEPS(REAL, FEELS)
}
#else
#define FIELDS
#define PASS_FIELDS
#endif
#define FORCES                                                                                                   \
    const int count, const int stride, __global const REAL *restrict inverse_mass, __global const REAL4 *restrict free_axes, \
        __global const REAL *restrict pair_sum, __global REAL *restrict columns, FIELDS ROWS
#define PASS_FORCES count, stride, inverse_mass, free_axes, pair_sum, columns, PASS_FIELDS PASS_ROWS

static inline void note(const int i, const int stride, const REAL4 place, __global REAL *restrict columns) {
#ifdef PAIRS
    columns[i] = place.x;
    columns[i + stride] = place.y;
    columns[i + 2 * stride] = place.z;
#endif
}

static inline REAL4 where_free(const int i, const REAL4 a, __global const REAL4 *restrict free_axes) {
#ifdef HELD
    return select((REAL4)(0), a, free_axes[i] > 0); /* a product would make NaN of the F/0 of a held particle */
#else
    return a;
#endif
}

/* By all forces that do not depend on velocity, springs left out. */
static REAL4 outside(const int i, const REAL4 here, FORCES) {
    REAL4 a = (REAL4)(GRAVITY_X, GRAVITY_Y, GRAVITY_Z, 0);
#ifdef PAIRS
    a += (REAL4)(pair_sum[i], pair_sum[i + stride], pair_sum[i + 2 * stride], 0);
#endif
#ifdef FIELD_STEPS
    a += field(here, quantities[i], felt[i]);
#endif
    return a;
}

/* By all that do not. */
static REAL4 still(const int i, const REAL4 here, __global const REAL4 *restrict x, FORCES) {
    REAL4 a = outside(i, here, PASS_FORCES);
#ifdef SPRINGS
    a += inverse_mass[i] * elastic_row(i, here, x, PASS_ROWS);
#endif
    return where_free(i, a, free_axes);
}

/* By those that do. */
static REAL4 braking(const int i, const REAL4 here, const REAL4 moving, __global const REAL4 *restrict x,
                     __global const REAL4 *restrict v, FORCES) {
    REAL4 force = -DRAG * moving;
#if SPRING_DAMPING > 0
    force += friction_row(i, here, moving, x, v, PASS_ROWS);
#endif
    return where_free(i, inverse_mass[i] * force, free_axes);
}

/* By all forces, and in `without` by those that do not depend on velocity. */
static REAL4 all_together(const int i, const REAL4 here, const REAL4 moving, __global const REAL4 *restrict x,
                          __global const REAL4 *restrict v, REAL4 *without, FORCES) {
#if SPRING_DAMPING > 0
    REAL4 elastic, friction;
    elastic_and_friction_row(i, here, moving, x, v, &elastic, &friction, PASS_ROWS);
    *without = where_free(i, outside(i, here, PASS_FORCES) + inverse_mass[i] * elastic, free_axes);
    return *without + where_free(i, inverse_mass[i] * (friction - DRAG * moving), free_axes);
#else
    *without = still(i, here, x, PASS_FORCES);
    return *without + braking(i, here, moving, x, v, PASS_FORCES);
#endif
}

__kernel void note_places(FORCES, __global const REAL4 *restrict x) {
    const int i = get_global_id(0);
    if (i < count) note(i, stride, x[i], columns);
}

__kernel void drift(FORCES, __global REAL4 *restrict x, __global const REAL4 *restrict v, const REAL time) {
    const int i = get_global_id(0);
    if (i >= count) return;
    const REAL4 place = x[i] + time * v[i];
    x[i] = place;
    note(i, stride, place, columns);
}

/* A kick and the drift after it, where no neighbour's velocity matters. */
__kernel void kick_and_drift(FORCES, __global const REAL4 *restrict x, __global REAL4 *restrict x_next,
                             __global REAL4 *restrict v, const REAL kick, const REAL time) {
    const int i = get_global_id(0);
    if (i >= count) return;
    const REAL4 here = x[i], moving = v[i];
    const REAL4 a = still(i, here, x, PASS_FORCES);
#ifdef DRAGGED
    const REAL4 middle = moving + kick / 2 * (a + braking(i, here, moving, x, v, PASS_FORCES));
    const REAL4 faster = moving + kick * (a + braking(i, here, middle, x, v, PASS_FORCES));
#else
    const REAL4 faster = moving + kick * a;
#endif
    v[i] = faster;
    const REAL4 place = here + time * faster;
    x_next[i] = place;
    note(i, stride, place, columns);
}

/* The same where it does: first to the middle of the kick for all, then on. */
__kernel void first_half(FORCES, __global const REAL4 *restrict x, __global const REAL4 *restrict v,
                         __global REAL4 *restrict middle, __global REAL4 *restrict acceleration, const REAL kick) {
    const int i = get_global_id(0);
    if (i >= count) return;
    const REAL4 here = x[i], moving = v[i];
    REAL4 a;
    middle[i] = moving + kick / 2 * all_together(i, here, moving, x, v, &a, PASS_FORCES);
    acceleration[i] = a;
}

__kernel void second_half(FORCES, __global const REAL4 *restrict x, __global REAL4 *restrict x_next, __global REAL4 *restrict v,
                          __global const REAL4 *restrict middle, __global const REAL4 *restrict acceleration, const REAL kick,
                          const REAL time) {
    const int i = get_global_id(0);
    if (i >= count) return;
    const REAL4 here = x[i];
    const REAL4 faster = v[i] + kick * (acceleration[i] + braking(i, here, middle[i], x, middle, PASS_FORCES));
    v[i] = faster;
    const REAL4 place = here + time * faster;
    x_next[i] = place;
    note(i, stride, place, columns);
}

/* Slope k at (x, v), one of four; then x_next = x_0 + node dt v_0 + dt^2 sum bars_k f_k, v_next = v_0 + dt sum weights_k f_k. */
__kernel void stage(FORCES, __global const REAL4 *restrict x, __global const REAL4 *restrict v, __global const REAL4 *restrict x_0,
                    __global const REAL4 *restrict v_0, __global REAL4 *restrict x_next, __global REAL4 *restrict v_next,
                    __global REAL4 *restrict slopes, const int k, const REAL dt, const REAL node, const REAL w_0, const REAL w_1,
                    const REAL w_2, const REAL w_3, const REAL b_0, const REAL b_1, const REAL b_2) {
    const int i = get_global_id(0);
    if (i >= count) return;
    const REAL4 here = x[i], moving = v[i], start_velocity = v_0[i];
    REAL4 without;
    const REAL4 slope = all_together(i, here, moving, x, v, &without, PASS_FORCES);
    slopes[i + k * count] = slope;
    const REAL weights[4] = {w_0, w_1, w_2, w_3}, bars[4] = {b_0, b_1, b_2, 0};
    REAL4 faster = weights[k] * slope, farther = bars[k] * slope;
    for (int s = 0; s < k; s++) {
        const REAL4 earlier = slopes[i + s * count];
        faster += weights[s] * earlier;
        farther += bars[s] * earlier;
    }
    const REAL4 place = x_0[i] + dt * (node * start_velocity + dt * farther);
    x_next[i] = place;
    v_next[i] = start_velocity + dt * faster;
    note(i, stride, place, columns);
}

__kernel void accelerate(FORCES, __global const REAL4 *restrict x, __global const REAL4 *restrict v,
                         __global REAL4 *restrict acceleration) {
    const int i = get_global_id(0);
    if (i >= count) return;
    REAL4 without;
    acceleration[i] = all_together(i, x[i], v[i], x, v, &without, PASS_FORCES);
}
