/* Direct sum of softened gravity, written by hand for the vector unit of the machine: the speed to compare with.
 *
 *   a_i = sum_j m_j d (|d|^2 + eps^2)^(-3/2),  d = x_j - x_i,  eps > 0 (the term j = i is zero)
 *
 * Structure of arrays; a task holds BLOCK vectors of bodies i in registers and walks all j as broadcast scalars.
 * The inverse root is the hardware estimate and Newton steps y <- y (3 - r2 y^2) / 2: 14 bits and one step for f32,
 * 14 bits and two steps for f64 (AVX-512); 11.5 bits and one or three steps (AVX2). Plain C leaves it to the compiler.
 * Sizes must be multiples of 128; the caller pads with bodies of no mass.
 *
 * Build: cc -O3 -march=native -mprefer-vector-width=512 -ffast-math -fopenmp -fPIC -c, and linked without -ffast-math (c_reference.py)
 */
#include <math.h>
#include <stdint.h>

#if defined(__AVX512F__) && defined(__AVX512DQ__)
#include <immintrin.h>
#define INSTRUCTION_SET "AVX-512"
#define WIDTH_f32 16
#define WIDTH_f64 8
#define BLOCK_f32 8
#define BLOCK_f64 8
typedef __m512 vector_f32;
typedef __m512d vector_f64;
#define set_f32 _mm512_set1_ps
#define set_f64 _mm512_set1_pd
#define load_f32 _mm512_loadu_ps
#define load_f64 _mm512_loadu_pd
#define store_f32 _mm512_storeu_ps
#define store_f64 _mm512_storeu_pd
static inline vector_f32 inverse_root_f32(vector_f32 r2) {
    const vector_f32 y = _mm512_rsqrt14_ps(r2), half = r2 * set_f32(0.5f);
    return y * (set_f32(1.5f) - half * y * y);
}
static inline vector_f64 inverse_root_f64(vector_f64 r2) {
    const vector_f64 half = r2 * set_f64(0.5);
    vector_f64 y = _mm512_rsqrt14_pd(r2);
    y = y * (set_f64(1.5) - half * y * y);
    return y * (set_f64(1.5) - half * y * y);
}
#elif defined(__AVX2__) && defined(__FMA__)
#include <immintrin.h>
#define INSTRUCTION_SET "AVX2"
#define WIDTH_f32 8
#define WIDTH_f64 4
#define BLOCK_f32 2
#define BLOCK_f64 2
typedef __m256 vector_f32;
typedef __m256d vector_f64;
#define set_f32 _mm256_set1_ps
#define set_f64 _mm256_set1_pd
#define load_f32 _mm256_loadu_ps
#define load_f64 _mm256_loadu_pd
#define store_f32 _mm256_storeu_ps
#define store_f64 _mm256_storeu_pd
static inline vector_f32 inverse_root_f32(vector_f32 r2) {
    const vector_f32 y = _mm256_rsqrt_ps(r2), half = r2 * set_f32(0.5f);
    return y * (set_f32(1.5f) - half * y * y);
}
static inline vector_f64 inverse_root_f64(vector_f64 r2) {
    const vector_f64 half = r2 * set_f64(0.5);
    vector_f64 y = _mm256_cvtps_pd(_mm_rsqrt_ps(_mm256_cvtpd_ps(r2)));
    for (int step = 0; step < 3; step++) y = y * (set_f64(1.5) - half * y * y);
    return y;
}
#else
#define INSTRUCTION_SET "plain C"
#define WIDTH_f32 1
#define WIDTH_f64 1
#define BLOCK_f32 64
#define BLOCK_f64 64
typedef float vector_f32;
typedef double vector_f64;
#define set_f32(x) (x)
#define set_f64(x) (x)
#define load_f32(p) (*(p))
#define load_f64(p) (*(p))
#define store_f32(p, x) (*(p) = (x))
#define store_f64(p, x) (*(p) = (x))
#define inverse_root_f32(x) (1.0f / sqrtf(x))
#define inverse_root_f64(x) (1.0 / sqrt(x))
#endif

const char *instruction_set(void) { return INSTRUCTION_SET; }

#define DEFINE_GRAVITY(P, real)                                                                                       \
    void gravity_##P(int64_t count, const real *x, const real *y, const real *z, const real *m, real *ax, real *ay,   \
                     real *az, real softening2, int threads) {                                                        \
        enum { width = WIDTH_##P, tile = WIDTH_##P * BLOCK_##P };                                \
        _Pragma("omp parallel for schedule(static) num_threads(threads)")                                             \
        for (int64_t b = 0; b < count; b += tile) {                                                                   \
            vector_##P xi[BLOCK_##P], yi[BLOCK_##P], zi[BLOCK_##P], sx[BLOCK_##P], sy[BLOCK_##P], sz[BLOCK_##P];      \
            for (int k = 0; k < BLOCK_##P; k++) {                                                                     \
                xi[k] = load_##P(x + b + k * width);                                                                  \
                yi[k] = load_##P(y + b + k * width);                                                                  \
                zi[k] = load_##P(z + b + k * width);                                                                  \
                sx[k] = sy[k] = sz[k] = set_##P(0);                                                                   \
            }                                                                                                         \
            for (int64_t j = 0; j < count; j++) {                                                                     \
                const vector_##P xj = set_##P(x[j]), yj = set_##P(y[j]), zj = set_##P(z[j]), mj = set_##P(m[j]);      \
                _Pragma("GCC unroll 8")                                                                               \
                for (int k = 0; k < BLOCK_##P; k++) {                                                                 \
                    const vector_##P dx = xj - xi[k], dy = yj - yi[k], dz = zj - zi[k];                               \
                    const vector_##P r2 = dx * dx + (dy * dy + (dz * dz + set_##P(softening2)));                      \
                    const vector_##P inverse = inverse_root_##P(r2);                                                  \
                    const vector_##P s = (mj * inverse) * (inverse * inverse);                                        \
                    sx[k] += s * dx;                                                                                  \
                    sy[k] += s * dy;                                                                                  \
                    sz[k] += s * dz;                                                                                  \
                }                                                                                                     \
            }                                                                                                         \
            for (int k = 0; k < BLOCK_##P; k++) {                                                                     \
                store_##P(ax + b + k * width, sx[k]);                                                                 \
                store_##P(ay + b + k * width, sy[k]);                                                                 \
                store_##P(az + b + k * width, sz[k]);                                                                 \
            }                                                                                                         \
        }                                                                                                             \
    }

DEFINE_GRAVITY(f32, float)
DEFINE_GRAVITY(f64, double)
