/* Hard spheres, the pairwise step: spheres move, then each pair that overlaps bounces and is pushed apart, by number.
 *
 *   J = (1 + e) (-u.n) / sum_k n_k^2 (w_ik + w_jk) if u.n < 0,   v_i -= J w_i n,   v_j += J w_j n,   u = v_j - v_i
 *   x_i -= delta w_i n / sum ...,   x_j += delta w_j n / sum ...,   delta the overlap, n from i to j, w inverse masses
 *
 * and so off walls. Overlapping pairs are found on a grid of cells, at least as wide as two of the largest spheres: spheres are
 * counted into cells, sorted by cell, and each looks at those behind it in its own cell and the half of the cells around. Pairs
 * are listed in any order, sorted by number, and worked off by one work-item, or in rounds of pairs that share no sphere and come
 * before all that do, so that the outcome is the same every time.
 *
 * Spheres outside the grid count as in its outermost cells; no pair is missed, since cells of neighbours stay neighbours. In a
 * box that repeats, places go on growing; separations are the nearest images, and along axes that repeat there are at least
 * three cells, which fill the period, so that no pair is seen twice.
 *
 * Built with -DDIMENSIONS, -DROOM (pairs), -DMATERIALS, -DSURFACES, -DHAS_CONTACT_TIME where contacts shortly after another
 * are elastic, -DPERIODIC where the box repeats, with -DPERIOD_X, _Y, _Z as numbers, 0 along an axis that does not.
 */
#ifdef PERIODIC
static inline REAL nearest(const REAL d, const REAL period) {
    return period > 0 && fabs(d) > period / 2 ? d - period * floor(d / period + (REAL)0.5) : d;
}
#define REPEATS(period) ((period) > 0)
#else
#define PERIOD_X 0
#define PERIOD_Y 0
#define PERIOD_Z 0
#define REPEATS(period) 0
#endif

/* From one place to the nearest image of another. */
static inline REAL4 separation_of(const REAL4 one, const REAL4 two) {
    const REAL4 d = two - one;
#ifdef PERIODIC
    return (REAL4)(nearest(d.x, PERIOD_X), nearest(d.y, PERIOD_Y), nearest(d.z, PERIOD_Z), 0);
#else
    return d;
#endif
}

typedef struct {
    int x, y, z;
} Cell;

static inline Cell cell_of(const REAL4 place, const REAL4 corner, const REAL4 inverse_width, const int4 cells) {
    REAL4 way = place - corner;
#ifdef PERIODIC
    if (REPEATS(PERIOD_X)) way.x -= PERIOD_X * floor(way.x / PERIOD_X);
    if (REPEATS(PERIOD_Y)) way.y -= PERIOD_Y * floor(way.y / PERIOD_Y);
    if (REPEATS(PERIOD_Z)) way.z -= PERIOD_Z * floor(way.z / PERIOD_Z);
#endif
    /* What is no number comes to lie in the first cell. */
    const REAL4 at = fmin(fmax(way * inverse_width, (REAL4)(0)), JOINED(convert_, REAL4)(cells - 1));
    Cell cell = {(int)at.x, (int)at.y, (int)at.z};
    return cell;
}

static inline int number_of(const Cell cell, const int4 cells) { return cell.x + cells.x * (cell.y + cells.y * cell.z); }

__kernel void clear(__global int *restrict numbers, const int count) {
    const int k = get_global_id(0);
    if (k < count) numbers[k] = 0;
}

__kernel void move_and_count(const int count, __global REAL4 *restrict x, __global const REAL4 *restrict v, const REAL time,
                             const REAL4 corner, const REAL4 inverse_width, const int4 cells, __global int *restrict cell,
                             __global int *restrict crowd) {
    const int i = get_global_id(0);
    if (i >= count) return;
    const REAL4 place = x[i] + time * v[i];
    x[i] = place;
    const int c = number_of(cell_of(place, corner, inverse_width, cells), cells);
    cell[i] = c;
    atomic_inc(&crowd[c]); /* whole numbers: their sum has no order */
}

/* Part p of the cells: how many spheres are in it. */
__kernel void sum_parts(const int cell_count, __global const int *restrict crowd, __global int *restrict parts) {
    const int part = get_global_id(0), length = (cell_count + get_global_size(0) - 1) / get_global_size(0);
    const int begin = min(part * length, cell_count), end = min(begin + length, cell_count);
    int total = 0;
    for (int c = begin; c < end; c++) total += crowd[c];
    parts[part] = total;
}

/* Where the spheres of each cell begin; crowd is then how many of them are still to be put there. */
__kernel void begin_cells(const int cell_count, __global const int *restrict crowd, __global const int *restrict parts,
                          __global int *restrict start) {
    const int part = get_global_id(0), length = (cell_count + get_global_size(0) - 1) / get_global_size(0);
    const int begin = min(part * length, cell_count), end = min(begin + length, cell_count);
    int slot = 0;
    for (int p = 0; p < part; p++) slot += parts[p];
    for (int c = begin; c < end; c++) {
        start[c] = slot;
        slot += crowd[c];
    }
    if (end == cell_count) start[cell_count] = slot;
}

/* In any order within a cell. */
__kernel void sort(const int count, __global const REAL4 *restrict x, __global const REAL *restrict radius,
                   __global const int *restrict cell, __global const int *restrict start, __global int *restrict crowd,
                   __global int *restrict order, __global REAL4 *restrict sorted) {
    const int i = get_global_id(0);
    if (i >= count) return;
    const int c = cell[i], slot = start[c] + atomic_dec(&crowd[c]) - 1;
    const REAL4 place = x[i];
    order[slot] = i;
    sorted[slot] = (REAL4)(place.x, place.y, place.z, radius[i]);
}

static inline int overlap_of(const REAL4 one, const REAL4 two) {
    const REAL4 d = separation_of(one, two);
    const REAL reach = one.w + two.w;
    return dot3(d, d) < reach * reach;
}

/* Rows of pairs: row[i + 2] counts those whose lower number is i, row[count + 2] all of them, with those there is no room for. */
static void list(const int one, const int two, const int count, __global int *restrict row, __global int2 *restrict found) {
    const int i = min(one, two), k = atomic_inc(&row[count + 2]);
    if (k < ROOM) {
        found[k] = (int2)(i, max(one, two));
        atomic_inc(&row[i + 2]);
    }
}

/* The number of a cell that may lie behind the last one; -1 where there is none. */
static inline int beyond(const int cell, const int cells, const int repeats) {
    return cell >= 0 && cell < cells ? cell : repeats ? (cell + cells) % cells : -1;
}

#define LOOK(begin, end)                                     \
    for (int other = begin, last = end; other < last; other++) \
        if (overlap_of(own, sorted[other])) list(order[slot], order[other], count, row, found);

__kernel void find(const int count, const REAL4 corner, const REAL4 inverse_width, const int4 cells,
                   __global const int *restrict start, __global const int *restrict order, __global const REAL4 *restrict sorted,
                   __global int *restrict row, __global int2 *restrict found) {
    const int slot = get_global_id(0);
    if (slot >= count) return;
    const REAL4 own = sorted[slot];
    const Cell cell = cell_of(own, corner, inverse_width, cells);
    for (int up = 0; up < (DIMENSIONS == 3 ? 5 : 2); up++) {
        /* Its own row of cells, from itself on; the next row; and the three rows above. */
        const int y = beyond(cell.y + (up < 2 ? up : up - 3), cells.y, REPEATS(PERIOD_Y));
        const int z = beyond(cell.z + (up >= 2), cells.z, REPEATS(PERIOD_Z));
        if (y < 0 || z < 0) continue;
        const int row_of_cells = cells.x * (y + cells.y * z);
        if (REPEATS(PERIOD_X)) {
            for (int across = up == 0 ? 0 : -1; across <= 1; across++) {
                const int c = row_of_cells + beyond(cell.x + across, cells.x, 1);
                LOOK(up == 0 && across == 0 ? slot + 1 : start[c], start[c + 1])
            }
        } else {
            const int before = max(cell.x - 1, 0), after = min(cell.x + 1, cells.x - 1);
            LOOK(up == 0 ? slot + 1 : start[row_of_cells + before], start[row_of_cells + after + 1])
        }
    }
}

/* All pairs of a few spheres, without a grid: by one work-item, which then has them in their order. */
__kernel void find_among_few(const int count, __global REAL4 *restrict x, __global const REAL4 *restrict v, const REAL time,
                             __global const REAL *restrict radius, __global int *restrict row,
                             __global int2 *restrict found) {
    for (int i = 0; i < count; i++) x[i] += time * v[i];
    int k = 0;
    row[0] = row[1] = 0;
    for (int i = 0; i < count; i++) {
        row[i + 2] = 0;
        for (int j = i + 1; j < count; j++) {
            const REAL4 d = separation_of(x[i], x[j]);
            const REAL reach = radius[i] + radius[j];
            if (dot3(d, d) < reach * reach) {
                if (k < ROOM) {
                    found[k] = (int2)(i, j);
                    row[i + 2]++;
                }
                k++;
            }
        }
    }
    row[count + 2] = k;
}

/* e of a contact, 1 shortly after another (TC model). */
static REAL restitution_now(const REAL nominal, const int i, const int j, const REAL time, const REAL contact_time,
                            __global REAL *restrict last_contact) {
#ifdef HAS_CONTACT_TIME
    const REAL since = time - fmax(last_contact[i], last_contact[j]);
    last_contact[i] = last_contact[j] = time;
    return since < contact_time ? 1 : nominal;
#else
    return nominal;
#endif
}

static void bounce(const int i, const int j, __global REAL4 *restrict x, __global REAL4 *restrict v,
                   __global const REAL *restrict radius, __global const REAL4 *restrict inverse_mass,
                   __global const int *restrict material, __global const REAL *restrict restitution, const REAL time,
                   const REAL contact_time, __global REAL *restrict last_contact) {
    const REAL4 separation = separation_of(x[i], x[j]);
    const REAL distance = sqrt(dot3(separation, separation)), overlap = radius[i] + radius[j] - distance;
    if (overlap <= 0) return; /* an earlier pair has pushed them apart */
    const REAL4 n = distance > 0 ? separation / distance : (REAL4)(1, 0, 0, 0); /* no direction: take x */
    const REAL4 w_i = inverse_mass[i], w_j = inverse_mass[j];
    const REAL yielding = dot3(n * n, w_i + w_j), closing = dot3(n, v[j] - v[i]);
    if (closing < 0) {
        const REAL nominal = restitution[material[i] * MATERIALS + material[j]];
        const REAL e = restitution_now(nominal, i, j, time, contact_time, last_contact);
        const REAL impulse = yielding > 0 ? -(1 + e) * closing / yielding : 0;
        v[i] -= impulse * (w_i * n);
        v[j] += impulse * (w_j * n);
    }
    if (yielding > 0) {
        x[i] -= overlap / yielding * (w_i * n);
        x[j] += overlap / yielding * (w_j * n);
    }
}

/* By one work-item: pairs into rows, i < j, each row sorted by j; then one after the other. */
__kernel void work_off(const int count, __global REAL4 *restrict x, __global REAL4 *restrict v,
                       __global const REAL *restrict radius, __global const REAL4 *restrict inverse_mass,
                       __global const int *restrict material, __global const REAL *restrict restitution, const REAL time,
                       const REAL contact_time, __global REAL *restrict last_contact, __global int *restrict row,
                       __global const int2 *restrict found, __global int *restrict partner, __global int *restrict given_up) {
    const int kept = min(row[count + 2], ROOM);
    *given_up += row[count + 2] - kept;
    if (kept == 0) return;
    for (int i = 0; i < count; i++) row[i + 2] += row[i + 1];
    for (int k = 0; k < kept; k++) partner[row[found[k].x + 1]++] = found[k].y;
    for (int i = 0; i < count; i++) {
        const int begin = row[i], end = row[i + 1];
        for (int k = begin + 1; k < end; k++) {
            const int j = partner[k];
            int hole = k;
            for (; hole > begin && partner[hole - 1] > j; hole--) partner[hole] = partner[hole - 1];
            partner[hole] = j;
        }
        for (int k = begin; k < end; k++)
            bounce(i, partner[k], x, v, radius, inverse_mass, material, restitution, time, contact_time, last_contact);
    }
}

/* By one group of work-items, in rounds: a pair has its turn when none is left before it that shares a sphere with it, so that
 * the outcome is that of one after the other. A sphere's next pair is the one of the lowest lower number, and of these of the
 * lowest upper one. Each round ends at least the first pair that is left, so there are no more rounds than pairs. */
__kernel void work_off_together(const int count, __global REAL4 *x, __global REAL4 *v, __global const REAL *restrict radius,
                                __global const REAL4 *restrict inverse_mass, __global const int *restrict material,
                                __global const REAL *restrict restitution, const REAL time, const REAL contact_time,
                                __global REAL *last_contact, __global const int *restrict row, __global int2 *found,
                                __global int *lower, __global int *upper, __global int *restrict given_up) {
    __local int left;
    const int own = get_local_id(0), group = get_local_size(0), kept = min(row[count + 2], ROOM);
    if (own == 0) *given_up += row[count + 2] - kept;
    int more = kept > 0;
    while (more) {
        if (own == 0) left = 0;
        for (int k = own; k < kept; k += group)
            if (found[k].x >= 0) lower[found[k].x] = lower[found[k].y] = upper[found[k].x] = upper[found[k].y] = INT_MAX;
        barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
        for (int k = own; k < kept; k += group) {
            const int i = found[k].x, j = found[k].y;
            if (i >= 0) {
                left = 1;
                atomic_min(&lower[i], i);
                atomic_min(&lower[j], i);
            }
        }
        barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
        for (int k = own; k < kept; k += group) {
            const int i = found[k].x, j = found[k].y;
            if (i >= 0 && lower[i] == i) atomic_min(&upper[i], j);
            if (i >= 0 && lower[j] == i) atomic_min(&upper[j], j);
        }
        barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
        for (int k = own; k < kept; k += group) {
            const int i = found[k].x, j = found[k].y;
            if (i >= 0 && lower[i] == i && lower[j] == i && upper[i] == j && upper[j] == j) {
                bounce(i, j, x, v, radius, inverse_mass, material, restitution, time, contact_time, last_contact);
                found[k].x = -1;
            }
        }
        more = left;
        barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
    }
}

#if SURFACES > 0
/* A surface is 14 numbers: kind (0 plane, 1 cylinder, 2 sphere), side (1 inside, -1 outside), radius, restitution, point where
 * the time is 0, direction, velocity; and the last says nothing. */
#define SURFACE_NUMBERS 14

__kernel void bounce_off_walls(const int count, __global REAL4 *restrict x, __global REAL4 *restrict v,
                               __global const REAL *restrict radius, __global const REAL4 *restrict inverse_mass,
                               const REAL time, const REAL contact_time, __global REAL *restrict last_contact,
                               __constant REAL *restrict surfaces) {
    const int i = get_global_id(0);
    if (i >= count) return;
    const REAL4 w = inverse_mass[i];
    REAL4 place = x[i], moving = v[i];
    for (int s = 0; s < SURFACES; s++) {
        __constant REAL *surface = surfaces + s * SURFACE_NUMBERS;
        const REAL kind = surface[0], side = surface[1], extent = surface[2];
        const REAL4 point = (REAL4)(surface[4], surface[5], surface[6], 0), along = (REAL4)(surface[7], surface[8], surface[9], 0);
        const REAL4 drifting = (REAL4)(surface[10], surface[11], surface[12], 0);
        REAL4 q = place - (point + time * drifting), n = along;
        REAL gap = dot3(q, along) - radius[i];
        if (kind > 0) {
            if (kind < 2) q -= dot3(q, along) * along;
#if DIMENSIONS == 2
            q.z = 0;
#endif
            const REAL length = sqrt(dot3(q, q));
            gap = side * (extent - length) - radius[i];
            n = length > 0 ? -side / length * q : (REAL4)(0);
        }
        if (gap >= 0) continue;
        const REAL yielding = dot3(n * n, w), closing = dot3(n, moving - drifting);
        if (closing < 0 && yielding > 0) {
            const REAL e = restitution_now(surface[3], i, i, time, contact_time, last_contact);
            moving += -(1 + e) * closing / yielding * (w * n);
        }
        if (yielding > 0) place -= gap / yielding * (w * n);
    }
    x[i] = place;
    v[i] = moving;
}
#endif
