/* Vectors of 64 bytes, 16 numbers in f32 and 8 in f64, for series_math.h and series_walk.h.
 *
 * A file that includes them has defined IN_F32 as 1 or 0.
 */
#include <immintrin.h>

#define INLINE static inline __attribute__((always_inline))
#define ALONE static __attribute__((noinline))
#define UNROLL _Pragma("clang loop unroll(full)")

#if IN_F32
#define REAL float
#define LANES 16
typedef float vector __attribute__((vector_size(64)));
typedef float stored_vector __attribute__((vector_size(64), aligned(4))); /* at any place of an array */
typedef int mask_vector __attribute__((vector_size(64)));
#else
#define REAL double
#define LANES 8
typedef double vector __attribute__((vector_size(64)));
typedef double stored_vector __attribute__((vector_size(64), aligned(8)));
typedef long mask_vector __attribute__((vector_size(64)));
#endif

INLINE vector all(REAL x) { return x - (vector){0}; }

#if IN_F32
#define LESS(a, b) _mm512_cmp_ps_mask((__m512)(a), (__m512)(b), _CMP_LT_OQ)

INLINE vector rough_inverse_root(vector q) { return (vector)_mm512_rsqrt14_ps((__m512)q); } /* to 2^-14 */

INLINE REAL sum_of(vector v) { return _mm512_reduce_add_ps((__m512)v); }

INLINE vector add_chosen(vector v, __mmask16 chosen, vector term) {
    return (vector)_mm512_mask_add_ps((__m512)v, chosen, (__m512)v, (__m512)term);
}

INLINE __m512i load_numbers(const int *from) { return _mm512_loadu_si512(from); }

INLINE __m512i gather_numbers(const int *from, __m512i index, __mmask16 chosen) {
    return _mm512_mask_i32gather_epi32(_mm512_setzero_si512(), chosen, index, from, 4);
}

INLINE __m512 join_rows(const REAL *a, const REAL *b, const REAL *c, const REAL *d) {
    __m512 v = _mm512_castps128_ps512(_mm_loadu_ps(a));
    v = _mm512_mask_broadcast_f32x4(v, 0x00f0, _mm_loadu_ps(b));
    v = _mm512_mask_broadcast_f32x4(v, 0x0f00, _mm_loadu_ps(c));
    return _mm512_mask_broadcast_f32x4(v, 0xf000, _mm_loadu_ps(d));
}

/* Four numbers of each of LANES rows, as four vectors. */
INLINE void load_columns(const REAL *rows, const long *offset, vector *result) {
    __m512 q[4];
    UNROLL for (int k = 0; k < 4; k++)
        q[k] = join_rows(rows + offset[k], rows + offset[k + 4], rows + offset[k + 8], rows + offset[k + 12]);
    const __m512d a = _mm512_castps_pd(_mm512_unpacklo_ps(q[0], q[1])), b = _mm512_castps_pd(_mm512_unpacklo_ps(q[2], q[3]));
    const __m512d c = _mm512_castps_pd(_mm512_unpackhi_ps(q[0], q[1])), d = _mm512_castps_pd(_mm512_unpackhi_ps(q[2], q[3]));
    result[0] = (vector)_mm512_unpacklo_pd(a, b);
    result[1] = (vector)_mm512_unpackhi_pd(a, b);
    result[2] = (vector)_mm512_unpacklo_pd(c, d);
    result[3] = (vector)_mm512_unpackhi_pd(c, d);
}
#else
#define LESS(a, b) _mm512_cmp_pd_mask((__m512d)(a), (__m512d)(b), _CMP_LT_OQ)

INLINE vector rough_inverse_root(vector q) { return (vector)_mm512_rsqrt14_pd((__m512d)q); } /* to 2^-14 */

INLINE REAL sum_of(vector v) { return _mm512_reduce_add_pd((__m512d)v); }

INLINE vector add_chosen(vector v, __mmask16 chosen, vector term) {
    return (vector)_mm512_mask_add_pd((__m512d)v, (__mmask8)chosen, (__m512d)v, (__m512d)term);
}

INLINE __m512i load_numbers(const int *from) {
    return _mm512_castsi256_si512(_mm256_loadu_si256((const __m256i *)from));
}

INLINE __m512i gather_numbers(const int *from, __m512i index, __mmask16 chosen) { /* the upper eight numbers are 0 */
    return _mm512_mask_i32gather_epi32(_mm512_setzero_si512(), chosen, index, from, 4);
}

/* Four numbers of each of LANES rows, as four vectors. */
INLINE void load_columns(const REAL *rows, const long *offset, vector *result) {
    const __m512i even = _mm512_setr_epi64(0, 1, 8, 9, 4, 5, 12, 13), odd = _mm512_setr_epi64(2, 3, 10, 11, 6, 7, 14, 15);
    __m512d q[4];
    UNROLL for (int k = 0; k < 4; k++)
        q[k] = _mm512_mask_broadcast_f64x4(_mm512_castpd256_pd512(_mm256_loadu_pd(rows + offset[k])), 0xf0,
                                           _mm256_loadu_pd(rows + offset[k + 4]));
    const __m512d a = _mm512_unpacklo_pd(q[0], q[1]), b = _mm512_unpacklo_pd(q[2], q[3]);
    const __m512d c = _mm512_unpackhi_pd(q[0], q[1]), d = _mm512_unpackhi_pd(q[2], q[3]);
    result[0] = (vector)_mm512_permutex2var_pd(a, even, b);
    result[1] = (vector)_mm512_permutex2var_pd(c, even, d);
    result[2] = (vector)_mm512_permutex2var_pd(a, odd, b);
    result[3] = (vector)_mm512_permutex2var_pd(c, odd, d);
}
#endif

/* The rough root y has a rounding t = 1 - q y^2 with |t| < 2^-12.9, and (1 - t)^(-1/2) and (1 - t)^(-3/2) are series in t. The
 * first term left out is below 3 t^2/8 < 2^-27 in f32 and 35 t^4/128 < 2^-53 in f64; for the cube, five and nine times that. */
INLINE vector inverse_root(vector q) {
    const vector y = rough_inverse_root(q), t = 1 - q * (y * y);
    if (LANES == 16) return y + y * (t * (REAL)0.5);
    return y + y * (t * ((REAL)0.5 + t * ((REAL)0.375 + t * (REAL)0.3125)));
}

/* mass / q^(3/2) */
INLINE vector pull_of(vector mass, vector q) {
    const vector y = rough_inverse_root(q), squared = y * y, t = 1 - q * squared, rough = (mass * y) * squared;
    if (LANES == 16) return rough + rough * (t * (REAL)1.5);
    return rough + rough * (t * ((REAL)1.5 + t * ((REAL)1.875 + t * (REAL)2.1875)));
}
