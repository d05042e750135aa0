/* Damped springs, gathered: the sum over the row of half-springs of one particle, i.
 *
 *   elastic_i = sum_h D_h (|d| - L_h) d/|d|,   friction_i = sum_h c_h (u.d) d/|d|^2, or sum_h c_h u where damping is full,
 *   d = x_j - x_i,  u = v_j - v_i;  none along a spring whose ends coincide
 *
 * Rows are compressed (start, neighbor). Four half-springs are summed side by side, so that roots and quotients are vectors of
 * four; the order depends on the row alone, and there are no atomics, so the bits repeat.
 *
 * Built with -DSPRING_DAMPING=0 for none, 1 along the axis, 2 full.
 */
#define ROWS                                                                                                     \
    __global const int *restrict start, __global const int *restrict neighbor, __global const REAL *restrict stiffness, \
        __global const REAL *restrict rest_length, __global const REAL *restrict damping
#define PASS_ROWS start, neighbor, stiffness, rest_length, damping

static inline REAL4 elastic_weight(const REAL4 squared, const REAL4 stiffness, const REAL4 rest_length) {
    const REAL4 distance = sqrt(squared);
    return select((REAL4)(0), stiffness * (distance - rest_length) / distance, squared > 0);
}

static inline REAL elastic_weight_of_one(const REAL squared, const REAL stiffness, const REAL rest_length) {
    const REAL distance = sqrt(squared);
    return squared > 0 ? stiffness * (distance - rest_length) / distance : 0;
}

static REAL4 elastic_row(const int i, const REAL4 here, __global const REAL4 *restrict x, ROWS) {
    REAL4 force = (REAL4)(0);
    const int end = start[i + 1];
    int h = start[i];
    for (; h + 4 <= end; h += 4) {
        const REAL4 a = x[neighbor[h]] - here, b = x[neighbor[h + 1]] - here;
        const REAL4 c = x[neighbor[h + 2]] - here, d = x[neighbor[h + 3]] - here;
        const REAL4 squared = (REAL4)(dot3(a, a), dot3(b, b), dot3(c, c), dot3(d, d));
        const REAL4 weight = elastic_weight(squared, vload4(0, stiffness + h), vload4(0, rest_length + h));
        force += weight.x * a + weight.y * b + (weight.z * c + weight.w * d);
    }
    for (; h < end; h++) {
        const REAL4 d = x[neighbor[h]] - here;
        force += elastic_weight_of_one(dot3(d, d), stiffness[h], rest_length[h]) * d;
    }
    return force;
}

#if SPRING_DAMPING > 0
#define SQUARES(a, b, c, d) (REAL4)(dot3(a, a), dot3(b, b), dot3(c, c), dot3(d, d))
#define CLOSING(a, b, c, d) \
    (REAL4)(dot3(v[j.x] - moving, a), dot3(v[j.y] - moving, b), dot3(v[j.z] - moving, c), dot3(v[j.w] - moving, d))

static inline REAL4 friction_weight(const REAL4 squared, const REAL4 closing, const REAL4 damping) {
    return select((REAL4)(0), damping * closing / squared, squared > 0);
}

static inline REAL friction_weight_of_one(const REAL squared, const REAL closing, const REAL damping) {
    return squared > 0 ? damping * closing / squared : 0;
}

/* By `moving`, the velocity of i, and by v, those of all; positions are those of x. */
static REAL4 friction_row(const int i, const REAL4 here, const REAL4 moving, __global const REAL4 *restrict x,
                          __global const REAL4 *restrict v, ROWS) {
    REAL4 force = (REAL4)(0);
    const int end = start[i + 1];
    int h = start[i];
#if SPRING_DAMPING == 2
    for (; h < end; h++) force += damping[h] * (v[neighbor[h]] - moving);
#else
    for (; h + 4 <= end; h += 4) {
        const int4 j = vload4(0, neighbor + h);
        const REAL4 a = x[j.x] - here, b = x[j.y] - here, c = x[j.z] - here, d = x[j.w] - here;
        const REAL4 weight = friction_weight(SQUARES(a, b, c, d), CLOSING(a, b, c, d), vload4(0, damping + h));
        force += weight.x * a + weight.y * b + (weight.z * c + weight.w * d);
    }
    for (; h < end; h++) {
        const int j = neighbor[h];
        const REAL4 d = x[j] - here;
        force += friction_weight_of_one(dot3(d, d), dot3(v[j] - moving, d), damping[h]) * d;
    }
#endif
    return force;
}

/* Both at once: each half-spring and its neighbour are read once. */
static void elastic_and_friction_row(const int i, const REAL4 here, const REAL4 moving, __global const REAL4 *restrict x,
                                     __global const REAL4 *restrict v, REAL4 *elastic, REAL4 *friction, ROWS) {
    REAL4 pull = (REAL4)(0), brake = (REAL4)(0);
    const int end = start[i + 1];
    int h = start[i];
#if SPRING_DAMPING == 1
    for (; h + 4 <= end; h += 4) {
        const int4 j = vload4(0, neighbor + h);
        const REAL4 a = x[j.x] - here, b = x[j.y] - here, c = x[j.z] - here, d = x[j.w] - here;
        const REAL4 squared = SQUARES(a, b, c, d);
        const REAL4 along = elastic_weight(squared, vload4(0, stiffness + h), vload4(0, rest_length + h));
        const REAL4 against = friction_weight(squared, CLOSING(a, b, c, d), vload4(0, damping + h));
        pull += along.x * a + along.y * b + (along.z * c + along.w * d);
        brake += against.x * a + against.y * b + (against.z * c + against.w * d);
    }
#endif
    for (; h < end; h++) {
        const int j = neighbor[h];
        const REAL4 d = x[j] - here, u = v[j] - moving;
        const REAL squared = dot3(d, d);
        pull += elastic_weight_of_one(squared, stiffness[h], rest_length[h]) * d;
#if SPRING_DAMPING == 2
        brake += damping[h] * u;
#else
        brake += friction_weight_of_one(squared, dot3(u, d), damping[h]) * d;
#endif
    }
    *elastic = pull;
    *friction = brake;
}
#endif
