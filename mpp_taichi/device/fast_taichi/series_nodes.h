/* Nodes of neighbors/tree_nodes.py with the moments of series_math.h, and a record of each for tests of distances. */
enum {
    LEAF = 16,
    GROUP = 32,
    TILES = GROUP / LANES,
    LEVELS = 16,       /* of targets that are worked off together */
    ROOM = 64,         /* numbers that one test may write behind a list, and more */
    FAR = 240,         /* sources in a list from which on they are summed */
    NEAR = 48,         /* leaves; 1024 pulls are added one after another at most, because each addition rounds */
    SHAPE = 6,         /* numbers of a node: center, radius, bound of the octupole, likely octupole */
    RECORD = 8,        /* center, radius, two numbers of the error, 1 for a leaf, spread */
    ROW = (4 + MOMENTS + 3) / 4 * 4 /* center, scale, moments */
};

/* What the functions read and write: addresses and counts in this order, each of eight bytes. */
typedef struct {
    const REAL *position, *mass, *shape, *node_moments, *limit;
    const int *skip, *first_leaf, *leaves;
    int *pending, *lists;
    REAL *records, *rows, *total, *well, *variance;
    long padded, moment_width, capacity, most; /* numbers in one list; leaves that a group sums at most */
} Tree;

/* One piece of the walk. */
typedef struct {
    const Tree *tree;
    int *stack, *open; /* sources to be tested; sources that targets left to their children */
    REAL softening_squared, factor;
    int potential;
    int path[LEVELS];
    REAL series[LEVELS][SERIES], variance[LEVELS];
} Walk;

INLINE REAL larger(REAL a, REAL b) { return a > b ? a : b; }
INLINE REAL scale_of(REAL radius) { return larger(radius, (REAL)1e-18); }

/* The error of a source's series goes with powers of its spread, from 1/3 to 1 (tree_series.py). */
INLINE void write_record(const Tree *t, int node) {
    const REAL *shape = t->shape + (long)node * SHAPE;
    REAL *record = t->records + (long)node * RECORD, *row = t->rows + (long)node * ROW;
    const REAL mass = t->node_moments[node * t->moment_width + 3], radius = shape[3];
    REAL outer = 0, spread = 1;
    if (radius > 0 && shape[4] > 0) {
        outer = shape[4] / radius / radius / radius; /* tr Q / b^2 */
        spread = __builtin_sqrt(shape[5] / shape[4] * (REAL)0.70710678118654752440);
    }
    REAL likely = P + 1;
    for (int k = 0; k < P / 2 + 1; k++) likely *= spread;
    for (int a = 0; a < 3; a++) record[a] = row[a] = shape[a];
    record[3] = radius;
    record[4] = (mass - outer) * (P + 1);
    record[5] = outer * likely;
    record[6] = t->leaves[node] == 1;
    record[7] = spread;
    row[3] = scale_of(radius);
    for (int k = 4; k < ROW; k++) row[k] = 0;
}

INLINE void find_leaf(const Tree *t, int node) {
    REAL *row = t->rows + (long)node * ROW;
    vector sum[MOMENTS];
    UNROLL for (int k = 0; k < MOMENTS; k++) sum[k] = all(0);
    for (int part = 0; part < LEAF; part += LANES) {
        const long first = (long)t->first_leaf[node] * LEAF + part;
        const vector mass = *(const stored_vector *)(t->mass + first), zero = all(0);
        const mask_vector has_mass = mass != zero; /* bodies that fill up the last leaf are far away, and have no mass */
        vector x[3], power[MOMENTS];
        UNROLL for (int a = 0; a < 3; a++) {
            x[a] = (row[a] - *(const stored_vector *)(t->position + a * t->padded + first)) / row[3];
            x[a] = (vector)((mask_vector)x[a] & has_mass);
        }
        find_powers(x, P - 1, power);
        UNROLL for (int k = 0; k < MOMENTS; k++) sum[k] += mass * power[k];
    }
    UNROLL for (int k = 0; k < MOMENTS; k++) row[4 + k] = sum_of(sum[k]);
}

INLINE void join_parts(const Tree *t, int node) {
    REAL *row = t->rows + (long)node * ROW;
    int part = node + 1;
    for (int k = 0; k < 2; k++) {
        const REAL *own = t->rows + (long)part * ROW;
        REAL shift[3];
        for (int a = 0; a < 3; a++) shift[a] = (row[a] - own[a]) / row[3];
        add_moments(own + 4, shift, own[3] / row[3], row + 4);
        part = t->skip[part];
    }
}

/* The moments of the nodes from `last` down to `first`; children have higher numbers than their parents. */
void NAME(moments)(const long *table, const int *first, const int *last) {
    const Tree *t = (const Tree *)*table;
    for (int node = *last; node >= *first; node--) {
        write_record(t, node);
        if (t->leaves[node] == 1) find_leaf(t, node);
        else join_parts(t, node);
    }
}
