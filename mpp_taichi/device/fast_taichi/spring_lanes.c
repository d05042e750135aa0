/* Forces of half-springs, a particle in each lane of a vector: 64 bytes of numbers, 16 in f32 and 8 in f64. spring_lanes.py
 * calls the functions. Taichi reads the .bc file beside this file; tools/make/assemble_bitcode.py makes it.
 *
 *   elastic   F_i = sum_h D_h (|d| - L_h) d/|d|
 *   friction  F_i = sum_h c_h (u.d) d/d^2          d = x_j - x_i,  u = v_j - v_i;  none where both ends coincide
 *
 * A slice holds the rows of as many particles as there are lanes: entry h of all rows lies side by side in memory. The positions
 * of the neighbors are read as whole vectors (x, y, z and a number that is not used) and transposed in registers: on an AMD EPYC
 * (Zen 5) a step then takes 0.6 of its time with the instructions that gather single numbers. Behind the last vector of a field
 * there must be memory for one number more.
 *
 * A function gets the addresses of the arrays, the number of the slice and the number of particles, each by a pointer to a
 * variable of the kernel. It writes the forces of the slice, component by component.
 */
typedef float f32x2 __attribute__((vector_size(8), aligned(4)));
typedef float f32x4 __attribute__((vector_size(16), aligned(4)));
typedef float f32x8 __attribute__((vector_size(32)));
typedef float f32x16 __attribute__((vector_size(64), aligned(4)));
typedef int i32x16 __attribute__((vector_size(64), aligned(4)));
typedef double f64x2 __attribute__((vector_size(16), aligned(8)));
typedef double f64x4 __attribute__((vector_size(32), aligned(8)));
typedef double f64x8 __attribute__((vector_size(64), aligned(8)));
typedef long i64x8 __attribute__((vector_size(64), aligned(8)));

f32x16 root_f32(f32x16) __asm__("llvm.sqrt.v16f32");
f64x8 root_f64(f64x8) __asm__("llvm.sqrt.v8f64");

#define INLINE static inline __attribute__((always_inline))
#define JOINED_4(a, b) __builtin_shufflevector(a, b, 0, 1, 2, 3)
#define JOINED_8(a, b) __builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7)
#define JOINED_16(a, b) __builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)

/* The vectors of the particles in `index`, one component in each result. */
INLINE void load_f32_3(const float *from, const int *index, f32x16 *result) {
    f32x16 quads[4];
    for (int k = 0; k < 4; k++) {
        const f32x4 a = *(const f32x4 *)(from + 3L * index[k]), b = *(const f32x4 *)(from + 3L * index[k + 4]);
        const f32x4 c = *(const f32x4 *)(from + 3L * index[k + 8]), d = *(const f32x4 *)(from + 3L * index[k + 12]);
        const f32x8 ab = JOINED_8(a, b), cd = JOINED_8(c, d);
        quads[k] = JOINED_16(ab, cd);
    }
#define LOW(a, b) __builtin_shufflevector(a, b, 0, 16, 1, 17, 4, 20, 5, 21, 8, 24, 9, 25, 12, 28, 13, 29)
#define HIGH(a, b) __builtin_shufflevector(a, b, 2, 18, 3, 19, 6, 22, 7, 23, 10, 26, 11, 27, 14, 30, 15, 31)
#define FIRST(a, b) __builtin_shufflevector(a, b, 0, 1, 16, 17, 4, 5, 20, 21, 8, 9, 24, 25, 12, 13, 28, 29)
#define SECOND(a, b) __builtin_shufflevector(a, b, 2, 3, 18, 19, 6, 7, 22, 23, 10, 11, 26, 27, 14, 15, 30, 31)
    const f32x16 low = LOW(quads[0], quads[1]), other_low = LOW(quads[2], quads[3]);
    const f32x16 high = HIGH(quads[0], quads[1]), other_high = HIGH(quads[2], quads[3]);
    result[0] = FIRST(low, other_low);
    result[1] = SECOND(low, other_low);
    result[2] = FIRST(high, other_high);
#undef LOW
#undef HIGH
#undef FIRST
#undef SECOND
}

INLINE void load_f32_2(const float *from, const int *index, f32x16 *result) {
    f32x16 halves[2];
    for (int k = 0; k < 2; k++) {
        f32x4 quads[4];
        for (int m = 0; m < 4; m++) {
            const int *own = index + 8 * k + 2 * m;
            const f32x2 a = *(const f32x2 *)(from + 2L * own[0]), b = *(const f32x2 *)(from + 2L * own[1]);
            quads[m] = JOINED_4(a, b);
        }
        const f32x8 ab = JOINED_8(quads[0], quads[1]), cd = JOINED_8(quads[2], quads[3]);
        halves[k] = JOINED_16(ab, cd);
    }
    result[0] = __builtin_shufflevector(halves[0], halves[1], 0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
    result[1] = __builtin_shufflevector(halves[0], halves[1], 1, 3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 23, 25, 27, 29, 31);
}

INLINE void load_f64_3(const double *from, const int *index, f64x8 *result) {
    f64x8 quads[4];
    for (int k = 0; k < 4; k++) {
        const f64x4 a = *(const f64x4 *)(from + 3L * index[k]), b = *(const f64x4 *)(from + 3L * index[k + 4]);
        quads[k] = JOINED_8(a, b);
    }
#define LOW(a, b) __builtin_shufflevector(a, b, 0, 8, 2, 10, 4, 12, 6, 14)
#define HIGH(a, b) __builtin_shufflevector(a, b, 1, 9, 3, 11, 5, 13, 7, 15)
#define FIRST(a, b) __builtin_shufflevector(a, b, 0, 1, 8, 9, 4, 5, 12, 13)
#define SECOND(a, b) __builtin_shufflevector(a, b, 2, 3, 10, 11, 6, 7, 14, 15)
    const f64x8 low = LOW(quads[0], quads[1]), other_low = LOW(quads[2], quads[3]);
    const f64x8 high = HIGH(quads[0], quads[1]), other_high = HIGH(quads[2], quads[3]);
    result[0] = FIRST(low, other_low);
    result[1] = FIRST(high, other_high);
    result[2] = SECOND(low, other_low);
#undef LOW
#undef HIGH
#undef FIRST
#undef SECOND
}

INLINE void load_f64_2(const double *from, const int *index, f64x8 *result) {
    f64x4 quads[4];
    for (int k = 0; k < 4; k++) {
        const f64x2 a = *(const f64x2 *)(from + 2L * index[2 * k]), b = *(const f64x2 *)(from + 2L * index[2 * k + 1]);
        quads[k] = JOINED_4(a, b);
    }
    const f64x8 ab = JOINED_8(quads[0], quads[1]), cd = JOINED_8(quads[2], quads[3]);
    result[0] = __builtin_shufflevector(ab, cd, 0, 2, 4, 6, 8, 10, 12, 14);
    result[1] = __builtin_shufflevector(ab, cd, 1, 3, 5, 7, 9, 11, 13, 15);
}

#define DEFINE(NAME, P, DIMENSIONS, LANES, REAL, VECTOR, MASK, ELASTIC, FRICTION)                                            \
    void NAME(const long *position, const long *velocity, const long *start, const long *neighbor, const long *stiffness,    \
              const long *rest_length, const long *damping, const long *pull, const int *slice, const int *count) {          \
        const REAL *x = (const REAL *)*position, *v = (const REAL *)*velocity;                                               \
        const int *rows = (const int *)*start, *others = (const int *)*neighbor;                                             \
        const int first = *slice * LANES, last = *count - 1;                                                                 \
        int own[LANES];                                                                                                      \
        for (int k = 0; k < LANES; k++) own[k] = first + k < last ? first + k : last;                                        \
        VECTOR here[DIMENSIONS], moving[DIMENSIONS], sum[DIMENSIONS];                                                        \
        load_##P##_##DIMENSIONS(x, own, here);                                                                               \
        if (FRICTION) load_##P##_##DIMENSIONS(v, own, moving);                                                               \
        for (int k = 0; k < DIMENSIONS; k++) sum[k] = (VECTOR){0};                                                           \
        for (int h = rows[*slice]; h < rows[*slice + 1]; h++) {                                                              \
            const int *index = others + (long)h * LANES;                                                                     \
            VECTOR d[DIMENSIONS], u[DIMENSIONS], squared = {0}, closing = {0}, along = {0};                                  \
            load_##P##_##DIMENSIONS(x, index, d);                                                                            \
            for (int k = 0; k < DIMENSIONS; k++) d[k] -= here[k];                                                            \
            for (int k = 0; k < DIMENSIONS; k++) squared = d[k] * d[k] + squared;                                            \
            if (ELASTIC) {                                                                                                   \
                const VECTOR length = root_##P(squared);                                                                     \
                const VECTOR stretch = length - ((const VECTOR *)*rest_length)[h];                                           \
                const VECTOR tension = ((const VECTOR *)*stiffness)[h] * stretch;                                            \
                along = FRICTION ? tension * length : tension / length;                                                      \
            }                                                                                                                \
            if (FRICTION) {                                                                                                  \
                load_##P##_##DIMENSIONS(v, index, u);                                                                        \
                for (int k = 0; k < DIMENSIONS; k++) closing = (u[k] - moving[k]) * d[k] + closing;                          \
                along = (along + ((const VECTOR *)*damping)[h] * closing) / squared;                                         \
            }                                                                                                                \
            along = (VECTOR)((MASK)along & (MASK)(squared > (VECTOR){0}));                                                   \
            for (int k = 0; k < DIMENSIONS; k++) sum[k] = along * d[k] + sum[k];                                             \
        }                                                                                                                    \
        const long all = (*count + LANES - 1L) / LANES * LANES;                                                              \
        for (int k = 0; k < DIMENSIONS; k++) *(VECTOR *)((REAL *)*pull + k * all + first) = sum[k];                          \
    }

#define DEFINE_KINDS(P, DIMENSIONS, LANES, REAL, VECTOR, MASK)                                                               \
    DEFINE(elastic_##P##_##DIMENSIONS, P, DIMENSIONS, LANES, REAL, VECTOR, MASK, 1, 0)                                       \
    DEFINE(damped_##P##_##DIMENSIONS, P, DIMENSIONS, LANES, REAL, VECTOR, MASK, 1, 1)                                        \
    DEFINE(friction_##P##_##DIMENSIONS, P, DIMENSIONS, LANES, REAL, VECTOR, MASK, 0, 1)

DEFINE_KINDS(f32, 2, 16, float, f32x16, i32x16)
DEFINE_KINDS(f32, 3, 16, float, f32x16, i32x16)
DEFINE_KINDS(f64, 2, 8, double, f64x8, i64x8)
DEFINE_KINDS(f64, 3, 8, double, f64x8, i64x8)
