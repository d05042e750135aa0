/* The direct sum over all pairs: a_i = r_i sum_j s_j d/rho^3, rho^2 = |d|^2 + softening^2, d = x_j - x_i.
 *
 * Gravity has r = G and s = m, charges r = -k q/m and s = q. A formula of the scene has g(1/rho) in the place of 1/rho^3; its
 * steps are FORMULA_STEPS(T), for numbers and vectors of the type T. Four kernels, slowest first:
 *
 *   naive       a work-item a body, everything read from global memory
 *   tiled       the bodies j by tiles in local memory, several bodies i a work-item; for GPUs
 *   vectors     LANES bodies i side by side in a work-item, in explicit vectors; for CPUs
 *   third_law   each pair once, LANES bodies j side by side; a work-item has a row of accelerations of its own, and `add_rows`
 *               sums the rows in their order. No atomics, so the bits repeat
 *
 * Bodies lie component by component: `columns` holds x, y, z of `stride` bodies each. Behind the last of `count` bodies there are
 * others without a source, far away, up to a whole number of tiles and vectors. A body does not act on itself; without softening
 * two bodies at one place give NaN.
 *
 * Built with -DSOFTENED where there is softening, -DLANES for vectors, -DTILE and -DBODIES for tiles, and in f64 with -DSEEDED for
 * 1/rho from a root in f32 and one step of third order: y (1 + h (1/2 + 3/8 h)), h = 1 - rho^2 y^2, whose error is 5/16 h^3. The
 * seed wants rho within the range of f32, 1e-19 to 1e19.
 */
#define BODIES_OF_SUM                                                                                                   \
    const int count, const int stride, __global const REAL *restrict columns, __global const REAL *restrict source,     \
        __global const REAL *restrict response, __global REAL *restrict sum, const REAL softening_squared, const int adds
#define BLOCK 256 /* bodies whose pulls are added before they are added to the rest, so that fewer roundings gather */

static inline REAL inverse_root(const REAL squared) {
#ifdef SEEDED
    const REAL y = rsqrt((float)squared);
    const REAL h = 1 - squared * y * y;
    return y + y * h * ((REAL)0.5 + (REAL)0.375 * h);
#elif defined(NEEDS_FP64)
    return 1 / sqrt(squared);
#else
    return rsqrt(squared);
#endif
}

#ifdef FORMULA_STEPS
static inline REAL shape(const REAL u) { FORMULA_STEPS(REAL) }
#define WEIGHT(source, u) ((source) * shape(u))
#else
#define WEIGHT(source, u) ((source) * (u) * ((u) * (u)))
#endif

static inline void store(const int i, const int stride, const REAL x, const REAL y, const REAL z,
                         __global const REAL *restrict response, __global REAL *restrict sum, const int adds) {
    const REAL r = response[i];
    sum[i] = r * x + (adds ? sum[i] : 0);
    sum[i + stride] = r * y + (adds ? sum[i + stride] : 0);
    sum[i + 2 * stride] = r * z + (adds ? sum[i + 2 * stride] : 0);
}

__kernel void naive(BODIES_OF_SUM) {
    const int i = get_global_id(0);
    if (i >= count) return;
    const REAL px = columns[i], py = columns[i + stride], pz = columns[i + 2 * stride];
    REAL ax = 0, ay = 0, az = 0;
    for (int begin = 0; begin < count; begin += BLOCK) {
        REAL bx = 0, by = 0, bz = 0;
        const int end = min(begin + BLOCK, count);
        for (int j = begin; j < end; j++) {
            const REAL dx = columns[j] - px, dy = columns[j + stride] - py, dz = columns[j + 2 * stride] - pz;
            REAL squared = dx * dx + dy * dy + dz * dz + softening_squared;
#ifndef SOFTENED
            squared = i == j ? 1 : squared;
#endif
            const REAL inverse = inverse_root(squared);
            const REAL weight = WEIGHT(source[j], inverse);
            bx += weight * dx;
            by += weight * dy;
            bz += weight * dz;
        }
        ax += bx;
        ay += by;
        az += bz;
    }
    store(i, stride, ax, ay, az, response, sum, adds);
}

#ifdef TILE
__kernel __attribute__((reqd_work_group_size(TILE, 1, 1))) void tiled(BODIES_OF_SUM) {
    __local REAL4 tile[TILE];
    const int local_id = get_local_id(0), first = get_group_id(0) * (TILE * BODIES) + local_id;
    REAL4 here[BODIES], total[BODIES];
#pragma unroll
    for (int b = 0; b < BODIES; b++) {
        const int i = min(first + b * TILE, stride - 1);
        here[b] = (REAL4)(columns[i], columns[i + stride], columns[i + 2 * stride], 0);
        total[b] = (REAL4)(0);
    }
    for (int begin = 0; begin < count; begin += TILE) {
        const int mine = begin + local_id; /* the bodies end with a whole tile */
        tile[local_id] = (REAL4)(columns[mine], columns[mine + stride], columns[mine + 2 * stride], source[mine]);
        barrier(CLK_LOCAL_MEM_FENCE);
        REAL4 block[BODIES];
#pragma unroll
        for (int b = 0; b < BODIES; b++) block[b] = (REAL4)(0);
#pragma unroll 8
        for (int j = 0; j < TILE; j++) {
            const REAL4 other = tile[j];
#pragma unroll
            for (int b = 0; b < BODIES; b++) {
                const REAL dx = other.x - here[b].x, dy = other.y - here[b].y, dz = other.z - here[b].z;
                REAL squared = dx * dx + dy * dy + dz * dz + softening_squared;
#ifndef SOFTENED
                squared = begin + j == first + b * TILE ? 1 : squared;
#endif
                const REAL inverse = inverse_root(squared);
                const REAL weight = WEIGHT(other.w, inverse);
                block[b].x += weight * dx;
                block[b].y += weight * dy;
                block[b].z += weight * dz;
            }
        }
#pragma unroll
        for (int b = 0; b < BODIES; b++) total[b] += block[b];
        barrier(CLK_LOCAL_MEM_FENCE);
    }
#pragma unroll
    for (int b = 0; b < BODIES; b++) {
        const int i = first + b * TILE;
        if (i < count) store(i, stride, total[b].x, total[b].y, total[b].z, response, sum, adds);
    }
}
#endif

#ifdef LANES
#define LANE JOINED(REAL, LANES)
#define LOAD JOINED(vload, LANES)
#define STORE JOINED(vstore, LANES)
#ifdef NEEDS_FP64
#define WHOLE JOINED(long, LANES)
#define AS_WHOLE JOINED(convert_long, LANES)
#else
#define WHOLE JOINED(int, LANES)
#define AS_WHOLE JOINED(convert_int, LANES)
#endif
__constant int LANE_NUMBERS[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};

static inline LANE inverse_roots(const LANE squared) {
#ifdef SEEDED
    const LANE y = JOINED(convert_double, LANES)(rsqrt(JOINED(convert_float, LANES)(squared)));
    const LANE h = 1 - squared * y * y;
    return y + y * h * ((REAL)0.5 + (REAL)0.375 * h);
#elif defined(NEEDS_FP64)
    return 1 / sqrt(squared);
#else
    return rsqrt(squared);
#endif
}

#ifdef FORMULA_STEPS
static inline LANE shapes(const LANE u) { FORMULA_STEPS(LANE) }
#define WEIGHTS(source, u) ((source) * shapes(u))
#else
#define WEIGHTS(source, u) WEIGHT(source, u)
#endif

/* Adds the pulls of the bodies begin ... end - 1 on LANES bodies, of which that in lane j - own is body j itself. */
#define ADD_PULLS(begin, end, OWN)                                                                         \
    for (int j = begin; j < end; j++) {                                                                    \
        const LANE dx = columns[j] - px, dy = columns[j + stride] - py, dz = columns[j + 2 * stride] - pz; \
        LANE squared = dx * dx + dy * dy + dz * dz + softening_squared;                                    \
        OWN;                                                                                               \
        const LANE inverse = inverse_roots(squared);                                                       \
        const LANE weight = WEIGHTS(source[j], inverse);                                                   \
        bx += weight * dx;                                                                                 \
        by += weight * dy;                                                                                 \
        bz += weight * dz;                                                                                 \
    }
/* A body's distance from itself is taken for one; its separation is nothing, and so is its pull. */
#define SKIP_OWN squared = select(squared, (LANE)(1), numbers == (WHOLE)(j - i))

__kernel void vectors(BODIES_OF_SUM) {
    const int i = get_global_id(0) * LANES;
    if (i >= count) return;
    const WHOLE numbers = AS_WHOLE(JOINED(vload, LANES)(0, LANE_NUMBERS));
    const LANE px = LOAD(0, columns + i), py = LOAD(0, columns + i + stride), pz = LOAD(0, columns + i + 2 * stride);
    LANE ax = (LANE)(0), ay = (LANE)(0), az = (LANE)(0);
    for (int begin = 0; begin < count; begin += BLOCK) {
        LANE bx = (LANE)(0), by = (LANE)(0), bz = (LANE)(0);
        const int end = min(begin + BLOCK, count);
#ifdef SOFTENED
        ADD_PULLS(begin, end, )
#else
        const int own = clamp(i, begin, end), beyond = clamp(i + LANES, begin, end);
        ADD_PULLS(begin, own, )
        ADD_PULLS(own, beyond, SKIP_OWN)
        ADD_PULLS(beyond, end, )
#endif
        ax += bx;
        ay += by;
        az += bz;
    }
    const LANE r = LOAD(0, response + i);
    ax *= r;
    ay *= r;
    az *= r;
    if (adds) {
        ax += LOAD(0, sum + i);
        ay += LOAD(0, sum + i + stride);
        az += LOAD(0, sum + i + 2 * stride);
    }
    STORE(ax, 0, sum + i);
    STORE(ay, 0, sum + i + stride);
    STORE(az, 0, sum + i + 2 * stride);
}

static inline REAL sum_of(const LANE lanes) {
    REAL parts[LANES], total = 0;
    STORE(lanes, 0, parts);
    for (int lane = 0; lane < LANES; lane++) total += parts[lane];
    return total;
}

#define SIDE_BY_SIDE 4 /* bodies i of which each vector of bodies j is read once */

/* Work-item c of C takes the vectors of bodies c, 2C - 1 - c, 2C + c, ... as bodies i, with all bodies j behind them. */
__kernel void third_law(const int count, const int stride, __global const REAL *restrict columns,
                        __global const REAL *restrict source, __global REAL *restrict rows, const REAL softening_squared) {
    const int row = get_global_id(0), row_count = get_global_size(0);
    const WHOLE numbers = AS_WHOLE(JOINED(vload, LANES)(0, LANE_NUMBERS));
    const int end = (count + LANES - 1) / LANES * LANES;
    __global REAL *restrict row_x = rows + (size_t)row * 3 * stride;
    __global REAL *restrict row_y = row_x + stride;
    __global REAL *restrict row_z = row_y + stride;
    for (int j = 0; j < end; j += LANES) {
        STORE((LANE)(0), 0, row_x + j);
        STORE((LANE)(0), 0, row_y + j);
        STORE((LANE)(0), 0, row_z + j);
    }
    for (int turn = 0; turn * row_count * LANES < end; turn++) {
        const int b = (turn * row_count + (turn & 1 ? row_count - 1 - row : row)) * LANES;
        if (b < end) {
            { /* pairs within the vector, both ways */
                const int i = b;
                const LANE px = LOAD(0, columns + b), py = LOAD(0, columns + b + stride), pz = LOAD(0, columns + b + 2 * stride);
                LANE bx = (LANE)(0), by = (LANE)(0), bz = (LANE)(0);
                ADD_PULLS(b, min(b + LANES, count), SKIP_OWN)
                STORE(LOAD(0, row_x + b) + bx, 0, row_x + b);
                STORE(LOAD(0, row_y + b) + by, 0, row_y + b);
                STORE(LOAD(0, row_z + b) + bz, 0, row_z + b);
            }
            for (int i = b; i < b + LANES; i += SIDE_BY_SIDE) {
                LANE ax[SIDE_BY_SIDE], ay[SIDE_BY_SIDE], az[SIDE_BY_SIDE];
                REAL px[SIDE_BY_SIDE], py[SIDE_BY_SIDE], pz[SIDE_BY_SIDE], own[SIDE_BY_SIDE];
#pragma unroll
                for (int k = 0; k < SIDE_BY_SIDE; k++) {
                    ax[k] = ay[k] = az[k] = (LANE)(0);
                    px[k] = columns[i + k];
                    py[k] = columns[i + k + stride];
                    pz[k] = columns[i + k + 2 * stride];
                    own[k] = source[i + k];
                }
                for (int j = b + LANES; j < end; j += LANES) {
                    const LANE jx = LOAD(0, columns + j), jy = LOAD(0, columns + j + stride), jz = LOAD(0, columns + j + 2 * stride);
                    const LANE other = LOAD(0, source + j);
                    LANE back_x = (LANE)(0), back_y = (LANE)(0), back_z = (LANE)(0);
#pragma unroll
                    for (int k = 0; k < SIDE_BY_SIDE; k++) {
                        const LANE dx = jx - px[k], dy = jy - py[k], dz = jz - pz[k];
                        const LANE inverse = inverse_roots(dx * dx + dy * dy + dz * dz + softening_squared);
                        const LANE cube = inverse * (inverse * inverse);
                        const LANE pull = other * cube, back = own[k] * cube;
                        ax[k] += pull * dx;
                        ay[k] += pull * dy;
                        az[k] += pull * dz;
                        back_x += back * dx;
                        back_y += back * dy;
                        back_z += back * dz;
                    }
                    STORE(LOAD(0, row_x + j) - back_x, 0, row_x + j);
                    STORE(LOAD(0, row_y + j) - back_y, 0, row_y + j);
                    STORE(LOAD(0, row_z + j) - back_z, 0, row_z + j);
                }
#pragma unroll
                for (int k = 0; k < SIDE_BY_SIDE; k++) {
                    row_x[i + k] += sum_of(ax[k]);
                    row_y[i + k] += sum_of(ay[k]);
                    row_z[i + k] += sum_of(az[k]);
                }
            }
        }
    }
}

__kernel void add_rows(const int count, const int stride, const int row_count, __global const REAL *restrict rows,
                       __global const REAL *restrict response, __global REAL *restrict sum, const int adds) {
    const int i = get_global_id(0) * LANES;
    if (i >= count) return;
    const LANE r = LOAD(0, response + i);
    for (int axis = 0; axis < 3; axis++) {
        LANE total = (LANE)(0);
        for (int row = 0; row < row_count; row++) total += LOAD(0, rows + ((size_t)row * 3 + axis) * stride + i);
        total *= r;
        if (adds) total += LOAD(0, sum + i + axis * stride);
        STORE(total, 0, sum + i + axis * stride);
    }
}
#endif
