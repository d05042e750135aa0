/* Fast multipole walk over the nodes of neighbors/tree_nodes.py: distant nodes act on whole nodes by series (series_math.h).
 *
 * A target node has a list of sources that neither its parents nor itself settled. LANES sources at a time are tested. A source
 * that is far enough adds its series to the target's. Any other source is opened, if it is larger than the target, or left to
 * the two children of the target. A group of GROUP bodies settles its whole list: it opens all nodes and sums the bodies of
 * near leaves one by one. The children go on with the series of their parent, and a group evaluates its series at its bodies.
 * Where a group is so wide that more than `most` leaves are near, each of its bodies settles the list of the group for itself.
 * Sources: L. Greengard and V. Rokhlin, J. Comput. Phys. 73 (1987) 325; J. Stadel, PhD thesis, University of Washington (2001),
 * sec. 2 (lists that the children go on with); neighbors/tree_series.py has the condition for far nodes.
 */
/* What the sources of a list act on: a node, the GROUP bodies from `body` on, or the one body `body`. */
enum { NODE, BODIES, ONE_BODY };
typedef struct {
    int kind;
    long body;
    const REAL *center;
    REAL radius, scale, across, allowed;
    vector x[3 * TILES]; /* places of the bodies */
    vector series[SERIES], variance, total[3 * TILES], well[TILES]; /* sums; in the first places those of one body */
} Target;

/* Add the series of the sources of a list. The first source fills the list up, where it counts nothing. */
ALONE void add_far(const Walk *w, int *list, int count, Target *target) {
    const REAL *rows = w->tree->rows;
    for (int k = 0; k < LANES; k++) list[count + k] = list[0];
    for (int first = 0; first < count; first += LANES) {
        const int left = count - first;
        const __mmask16 chosen = (__mmask16)(left < LANES ? (1 << left) - 1 : -1);
        long offset[LANES];
        vector column[ROW], separation[3], squared = all(w->softening_squared);
        UNROLL for (int k = 0; k < LANES; k++) offset[k] = (long)list[first + k] * ROW;
        UNROLL for (int k = 0; k < ROW; k += 4) load_columns(rows + k, offset, column + k);
        UNROLL for (int a = 0; a < 3; a++) {
            separation[a] = target->center[a] - column[a];
            squared += separation[a] * separation[a];
        }
        add_sources(separation, column[3], column + 4, squared, target->scale, chosen, w->potential, target->series);
    }
}

/* Add the pulls of one body to the tile at `own`. In the group itself, `from_first` is the body's lane in the first tile. */
INLINE void add_body(const Tree *t, long body, const vector *x, REAL softening_squared, int is_own, int from_first,
                     int potential, vector *total, vector *well) {
    UNROLL for (int k = 0; k < TILES; k++) {
        vector way[3], squared = all(softening_squared), mass = all(t->mass[body]);
        UNROLL for (int a = 0; a < 3; a++) {
            way[a] = t->position[a * t->padded + body] - x[a * TILES + k];
            squared += way[a] * way[a];
        }
        if (is_own) { /* the body does not act on itself */
            vector lane;
            UNROLL for (int l = 0; l < LANES; l++) lane[l] = k * LANES + l;
            const mask_vector self = lane == (vector)all(from_first);
            squared = (vector)(((mask_vector)squared & ~self) | ((mask_vector)all(1) & self));
            mass = (vector)((mask_vector)mass & ~self);
        }
        if (potential) well[k] += mass * inverse_root(squared);
        const vector pull = pull_of(mass, squared);
        UNROLL for (int a = 0; a < 3; a++) total[a * TILES + k] += pull * way[a];
    }
}

#define ADD_LEAF(IS_OWN, POTENTIAL)                                                                                          \
    for (int j = 0; j < LEAF; j++)                                                                                           \
        add_body(t, first + j, x, w->softening_squared, IS_OWN, (int)(first + j - begin), POTENTIAL, total, sum);

/* Add the pulls of the bodies of leaves to the sums of a group. */
ALONE void add_near(const Walk *w, const int *list, int count, Target *target) {
    const Tree *t = w->tree;
    const long begin = target->body;
    const vector *x = target->x;
    vector total[3 * TILES], sum[TILES];
    UNROLL for (int k = 0; k < 3 * TILES; k++) total[k] = all(0);
    UNROLL for (int k = 0; k < TILES; k++) sum[k] = all(0);
    for (int l = 0; l < count; l++) {
        const long first = (long)t->first_leaf[list[l]] * LEAF;
        const int is_own = first >= begin && first < begin + GROUP;
        if (w->potential && is_own) { ADD_LEAF(1, 1) }
        else if (w->potential) { ADD_LEAF(0, 1) }
        else if (is_own) { ADD_LEAF(1, 0) }
        else { ADD_LEAF(0, 0) }
    }
    UNROLL for (int k = 0; k < 3 * TILES; k++) target->total[k] += total[k];
    UNROLL for (int k = 0; k < TILES; k++) target->well[k] += sum[k];
}

/* The same for one body; here the bodies of a leaf are in the lanes. */
ALONE void add_near_to_one(const Walk *w, const int *list, int count, Target *target) {
    const Tree *t = w->tree;
    for (int l = 0; l < count; l++) UNROLL for (int part = 0; part < LEAF; part += LANES) {
        const long first = (long)t->first_leaf[list[l]] * LEAF + part, own = target->body - first;
        const __mmask16 others = (__mmask16)(own >= 0 && own < LANES ? ~(1 << own) : -1);
        vector way[3], squared = all(w->softening_squared);
        UNROLL for (int a = 0; a < 3; a++) {
            way[a] = *(const stored_vector *)(t->position + a * t->padded + first) - target->x[a];
            squared += way[a] * way[a];
        }
        squared = add_chosen(squared, (__mmask16)~others, all(1)); /* the body does not act on itself */
        const vector mass = add_chosen(all(0), others, *(const stored_vector *)(t->mass + first));
        if (w->potential) target->well[0] += mass * inverse_root(squared);
        const vector pull = pull_of(mass, squared);
        UNROLL for (int a = 0; a < 3; a++) target->total[a] += pull * way[a];
    }
}

/* The lowest limit of the pending groups in a node; below 0 where no group is pending. */
INLINE REAL lowest_limit(const Tree *t, int first, int last) {
    REAL result = -1;
    for (int group = first; group < last; group++)
        if (t->pending[group] == 1 && (result < 0 || t->limit[group] < result)) result = t->limit[group];
    return result;
}

/* Which of LANES sources are far, which are leaves, and which are larger than the target. */
INLINE void test_sources(const Walk *w, const int *number, __mmask16 live, Target *target, __mmask16 *far, __mmask16 *leaf,
                         __mmask16 *is_larger) {
    long offset[LANES];
    vector c[RECORD], squared = all(0);
    UNROLL for (int k = 0; k < LANES; k++) offset[k] = (long)number[k] * RECORD;
    UNROLL for (int k = 0; k < RECORD; k += 4) load_columns(w->tree->records + k, offset, c + k);
    UNROLL for (int a = 0; a < 3; a++) {
        const vector d = target->center[a] - c[a];
        squared += d * d;
    }
    const vector inverse = rough_inverse_root(squared + w->softening_squared);
    const vector size = c[3] + target->radius, own = target->radius * inverse, both = size * inverse, room = 1 - both;
    vector own_power = all(1), both_power = both;
    UNROLL for (int k = 1; k < P; k++) {
        own_power *= own;
        both_power *= both;
    }
    const vector first = c[4] * (target->across * own_power * own), others = both_power - (P * c[3] * inverse) * own_power;
    const vector error = (first + c[5] * others) * (inverse * inverse), likely = error / room;
    *far = live & LESS(size * size, squared) & LESS(all(0), room) & LESS(error, room * target->allowed);
    *leaf = LESS(all(0), c[6]);
    *is_larger = LESS(all(target->radius), c[3]);
    target->variance = add_chosen(target->variance, *far, likely * likely);
}

INLINE int store_chosen(int *to, __mmask16 chosen, __m512i number) {
    _mm512_storeu_si512(to, _mm512_maskz_compress_epi32(chosen, number));
    return __builtin_popcount(chosen);
}

/* Settle the sources from begin to end of the list w->open; the end of the list of those that are left to the children, or a
 * number below 0 where there is no room for the lists (FULL), or so many near bodies that each body of the group should be
 * served alone (CROWDED). */
enum { FULL = -1, CROWDED = -2 };
ALONE long settle(const Walk *w, long begin, long end, Target *target) {
    const Tree *t = w->tree;
    const int kind = target->kind;
    int far_list[FAR + 2 * LANES], near_list[NEAR + 2 * LANES], far_count = 0, near_count = 0;
    long count = end - begin, out = end, leaves = 0;
    UNROLL for (int k = 0; k < SERIES; k++) target->series[k] = all(0);
    UNROLL for (int k = 0; k < 3 * TILES; k++) target->total[k] = all(0);
    UNROLL for (int k = 0; k < TILES; k++) target->well[k] = all(0);
    target->variance = all(0);
    if (count + ROOM > t->capacity) return FULL;
    for (long k = begin; k < end; k++) w->stack[k - begin] = w->open[k];
    while (count > 0) { /* the sources that came last are first: the children of a source take its place */
        if (count + ROOM > t->capacity || out + ROOM > t->capacity) return FULL;
        const int valid = count < LANES ? (int)count : LANES;
        int *const stack = w->stack + (count -= valid);
        for (int k = valid; k < LANES; k++) stack[k] = 0;
        __mmask16 far, leaf, is_larger;
        test_sources(w, stack, (__mmask16)((1 << valid) - 1), target, &far, &leaf, &is_larger);
        const __mmask16 rest = (__mmask16)((1 << valid) - 1) & ~far, opened = rest & ~leaf & (kind == NODE ? is_larger : -1);
        const __m512i number = load_numbers(stack), left = _mm512_add_epi32(number, _mm512_set1_epi32(1));
        far_count += store_chosen(far_list + far_count, far, number);
        if (kind == NODE) out += store_chosen(w->open + out, rest & ~opened, number);
        else near_count += store_chosen(near_list + near_count, rest & ~opened, number);
        if (opened) {
            count += store_chosen(w->stack + count, opened, left);
            count += store_chosen(w->stack + count, opened, gather_numbers(t->skip, left, opened));
        }
        if (far_count >= FAR) {
            add_far(w, far_list, far_count, target);
            far_count = 0;
        }
        if (near_count >= NEAR || (count == 0 && near_count)) {
            leaves += near_count;
            if (kind == ONE_BODY) add_near_to_one(w, near_list, near_count, target);
            else if (leaves > t->most) return CROWDED;
            else add_near(w, near_list, near_count, target);
            near_count = 0;
        }
    }
    if (far_count) add_far(w, far_list, far_count, target);
    return out;
}

/* Settle the sources of a body, and add the sums to those of the series that it inherits. */
static int serve_one(const Walk *w, int lane, long begin, long end, const Target *group, REAL *variance) {
    const Tree *t = w->tree;
    Target target;
    REAL place[3];
    target.kind = ONE_BODY;
    target.body = group->body + lane;
    for (int a = 0; a < 3; a++) place[a] = t->position[a * t->padded + target.body];
    target.center = place;
    UNROLL for (int a = 0; a < 3; a++) target.x[a] = all(place[a]);
    target.radius = 0;
    target.scale = group->scale;
    target.across = 1;
    target.allowed = group->allowed;
    if (settle(w, begin, end, &target) == FULL) return 0;
    for (int a = 0; a < 3; a++)
        t->total[a * t->padded + target.body] +=
            sum_of(target.total[a]) + sum_of(target.series[AT(a == 0, a == 1, a == 2)]) / target.scale;
    if (w->potential) t->well[target.body] += sum_of(target.well[0]) + sum_of(target.series[0]);
    *variance = larger(*variance, sum_of(target.variance));
    return 1;
}

/* Settle the sources of a node and of all nodes below it; begin to end are its sources in the list w->open. */
static void serve(Walk *w, int node, int level, long begin, long end) {
    const Tree *t = w->tree;
    const REAL *record = t->records + (long)node * RECORD;
    const int first_group = t->first_leaf[node] / 2, is_group = t->leaves[node] <= 2;
    const REAL limit = lowest_limit(t, first_group, first_group + (t->leaves[node] + 1) / 2), spread = record[7];
    if (limit < 0) return;
    Target target;
    target.kind = is_group ? BODIES : NODE;
    target.body = (long)t->first_leaf[node] * LEAF;
    target.center = record;
    target.radius = record[3];
    target.scale = scale_of(record[3]);
    target.across = spread * (REAL)__builtin_sqrt(spread);
    target.allowed = limit * w->factor;
    if (is_group) {
        UNROLL for (int k = 0; k < TILES; k++) UNROLL for (int a = 0; a < 3; a++)
            target.x[a * TILES + k] = *(const stored_vector *)(t->position + a * t->padded + target.body + k * LANES);
    }
    const long out = settle(w, begin, end, &target);
    if (out == FULL) return; /* these groups stay pending */
    REAL *const own = w->series[level];
    REAL variance = out == CROWDED ? 0 : (REAL)0.1 * (target.across * target.across) * sum_of(target.variance);
    UNROLL for (int k = 0; k < SERIES; k++) own[k] = 0;
    w->path[level] = node;
    w->variance[level] = 0;
    if (level > 0) {
        const REAL *above = t->records + (long)w->path[level - 1] * RECORD, parent = scale_of(above[3]);
        REAL shift[3];
        for (int a = 0; a < 3; a++) shift[a] = (record[a] - above[a]) / parent;
        hand_down(w->series[level - 1], shift, target.scale / parent, own);
        w->variance[level] = w->variance[level - 1];
    }
    if (out == CROWDED) { /* the sums of the group count nothing */
        UNROLL for (int k = 0; k < 3 * TILES; k++) target.total[k] = all(0);
        UNROLL for (int k = 0; k < TILES; k++) target.well[k] = all(0);
    } else {
        UNROLL for (int k = 0; k < SERIES; k++) own[k] += sum_of(target.series[k]);
        w->variance[level] += variance;
    }
    if (!is_group) {
        serve(w, node + 1, level + 1, end, out);
        serve(w, t->skip[node + 1], level + 1, end, out);
        return;
    }
    UNROLL for (int k = 0; k < TILES; k++) {
        vector away[3], power[SERIES], gradient[3];
        UNROLL for (int a = 0; a < 3; a++) away[a] = (target.x[a * TILES + k] - record[a]) / target.scale;
        find_powers(away, P, power);
        find_gradient(own, power, gradient);
        UNROLL for (int a = 0; a < 3; a++)
            *(stored_vector *)(t->total + a * t->padded + target.body + k * LANES) =
                target.total[a * TILES + k] + gradient[a] / target.scale;
        if (w->potential) {
            vector sum = target.well[k];
            UNROLL for (int n = 0; n < SERIES; n++) sum += power[n] * own[n];
            *(stored_vector *)(t->well + target.body + k * LANES) = sum;
        }
    }
    if (out == CROWDED) {
        for (int lane = 0; lane < GROUP; lane++)
            if (!serve_one(w, lane, begin, end, &target, &variance)) return;
        w->variance[level] += (REAL)0.1 * variance;
    }
    t->variance[first_group] = w->variance[level];
    t->pending[first_group] = 0;
}

/* Serve the groups of one node that are pending. A group that is pending at the end had more sources than its lists hold. */
void NAME(walk)(const long *table, const int *node, const int *piece, const REAL *softening_squared, const REAL *factor,
                const int *potential) {
    const Tree *t = (const Tree *)*table;
    Walk walk;
    walk.tree = t;
    walk.stack = t->lists + 2 * t->capacity * *piece;
    walk.open = walk.stack + t->capacity;
    walk.softening_squared = *softening_squared;
    walk.factor = *factor;
    walk.potential = *potential;
    walk.open[0] = 0;
    serve(&walk, *node, 0, 0, 1);
}
