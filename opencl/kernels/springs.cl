/* Damped springs, gathered: the sum over the row of half-springs of one particle, i.
 *
 *   elastic_i = sum_h D_h (|d| - L_h) d/|d|,   friction_i = sum_h c_h (u.d) d/|d|^2, or sum_h c_h u where damping is full,
 *   d = x_j - x_i,  u = v_j - v_i;  none along a spring whose ends coincide
 *
 * Rows are compressed (start, neighbor). Four half-springs are summed side by side, so that roots and quotients are vectors of
 * four; the order depends on the row alone, and there are no atomics, so the bits repeat.
 *
 * Built with -DSPRING_DAMPING=0 for none, 1 along the axis, 2 full. Where springs have formulas of their length l beside
 * D (l - L), BOND_STEPS(T, HAS) is the text that returns the sum of their V'(l)/l for numbers or vectors of the type T (bonds.py);
 * HAS(n) says whether a half-spring has formula n, which is bit n of `bonds`.
 */
#define PLAIN_ROWS                                                                                               \
    __global const int *restrict start, __global const int *restrict neighbor, __global const REAL *restrict stiffness, \
        __global const REAL *restrict rest_length, __global const REAL *restrict damping
#define PASS_PLAIN_ROWS start, neighbor, stiffness, rest_length, damping

#ifdef BOND_STEPS
#define ROWS PLAIN_ROWS, __global const int *restrict bonds
#define PASS_ROWS PASS_PLAIN_ROWS, bonds
#ifdef NEEDS_FP64
#define AS_CHOICE convert_long4
#else
#define AS_CHOICE
#endif
#define HAS_FOUR(n) AS_CHOICE((bonds & (1 << n)) != 0)
#define HAS_ONE(n) ((bonds & (1 << n)) != 0)
static inline REAL4 bond_weight(const REAL4 l, const REAL4 rest, const int4 bonds) { BOND_STEPS(REAL4, HAS_FOUR) }
static inline REAL bond_weight_of_one(const REAL l, const REAL rest, const int bonds) { BOND_STEPS(REAL, HAS_ONE) }
#define AND_BONDS(h) +bond_weight(distance, rest, vload4(0, bonds + h))
#define AND_BONDS_OF_ONE(h) +bond_weight_of_one(distance, rest_length[h], bonds[h])
#else
#define ROWS PLAIN_ROWS
#define PASS_ROWS PASS_PLAIN_ROWS
#define AND_BONDS(h)
#define AND_BONDS_OF_ONE(h)
#endif

/* Of the half-springs h ... h + 3. */
static inline REAL4 elastic_weight(const REAL4 squared, const int h, ROWS) {
    const REAL4 distance = sqrt(squared), rest = vload4(0, rest_length + h);
    return select((REAL4)(0), vload4(0, stiffness + h) * (distance - rest) / distance AND_BONDS(h), squared > 0);
}

static inline REAL elastic_weight_of_one(const REAL squared, const int h, ROWS) {
    const REAL distance = sqrt(squared);
    return squared > 0 ? stiffness[h] * (distance - rest_length[h]) / distance AND_BONDS_OF_ONE(h) : 0;
}

static REAL4 elastic_row(const int i, const REAL4 here, __global const REAL4 *restrict x, ROWS) {
    REAL4 force = (REAL4)(0);
    const int end = start[i + 1];
    int h = start[i];
    for (; h + 4 <= end; h += 4) {
        const REAL4 a = x[neighbor[h]] - here, b = x[neighbor[h + 1]] - here;
        const REAL4 c = x[neighbor[h + 2]] - here, d = x[neighbor[h + 3]] - here;
        const REAL4 squared = (REAL4)(dot3(a, a), dot3(b, b), dot3(c, c), dot3(d, d));
        const REAL4 weight = elastic_weight(squared, h, PASS_ROWS);
        force += weight.x * a + weight.y * b + (weight.z * c + weight.w * d);
    }
    for (; h < end; h++) {
        const REAL4 d = x[neighbor[h]] - here;
        force += elastic_weight_of_one(dot3(d, d), h, PASS_ROWS) * d;
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
        const REAL4 along = elastic_weight(squared, h, PASS_ROWS);
        const REAL4 against = friction_weight(squared, CLOSING(a, b, c, d), vload4(0, damping + h));
        pull += along.x * a + along.y * b + (along.z * c + along.w * d);
        brake += against.x * a + against.y * b + (against.z * c + against.w * d);
    }
#endif
    for (; h < end; h++) {
        const int j = neighbor[h];
        const REAL4 d = x[j] - here, u = v[j] - moving;
        const REAL squared = dot3(d, d);
        pull += elastic_weight_of_one(squared, h, PASS_ROWS) * d;
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
