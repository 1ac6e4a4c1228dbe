/* Cells in batches: LANES at a time, one in each lane of vectors, the last batch padded. In double precision half of a
 * batch is processed at once. WIDTH is the number of lanes of a vector. */

#include <stddef.h>
#include <stdint.h>
#include <string.h>

enum { LANES = 16, MOST_POINTS = 35, MOST_PRESSURES = 20 }; /* of degree 4, and of 3 */

typedef float floats __attribute__((vector_size(64)));
typedef double doubles __attribute__((vector_size(64)));

/* gather_VECTOR: read vectors at the points of some cells, u (points, 3). scatter_VECTOR: add u to what is there.
 *
 * With AVX-512 the three numbers of a point are read together and transposed, four points in each of four registers;
 * single precision is written in the same way. Products then take 0.8 to 0.9 times as long. Sums keep their order.
 * Writes with a mask would be slower: what is read again soon after is delayed. */
#define DEFINE_GATHER(TYPE, VECTOR)                                                                                    \
static inline __attribute__((always_inline, unused)) void gather_##VECTOR(                                             \
    int points, const int* restrict at, const TYPE* restrict x, VECTOR (*restrict u)[3])                               \
{                                                                                                                      \
  enum { WIDTH = sizeof(VECTOR) / sizeof(TYPE) };                                                                      \
  for (int i = 0; i < points; ++i)                                                                                     \
  {                                                                                                                    \
    TYPE* row = (TYPE*)u[i];                                                                                           \
    for (int lane = 0; lane < WIDTH; ++lane)                                                                           \
    {                                                                                                                  \
      const TYPE* value = x + 3 * (size_t)at[i * LANES + lane];                                                        \
      row[lane] = value[0];                                                                                            \
      row[WIDTH + lane] = value[1];                                                                                    \
      row[2 * WIDTH + lane] = value[2];                                                                                \
    }                                                                                                                  \
  }                                                                                                                    \
}

#define DEFINE_SCATTER(TYPE, VECTOR)                                                                                   \
static inline __attribute__((always_inline, unused)) void scatter_##VECTOR(                                            \
    int points, const int* restrict at, VECTOR (*restrict u)[3], TYPE* restrict y)                                     \
{                                                                                                                      \
  enum { WIDTH = sizeof(VECTOR) / sizeof(TYPE) };                                                                      \
  for (int i = 0; i < points; ++i)                                                                                     \
  {                                                                                                                    \
    const TYPE* row = (const TYPE*)u[i];                                                                               \
    for (int lane = 0; lane < WIDTH; ++lane)                                                                           \
    {                                                                                                                  \
      TYPE* value = y + 3 * (size_t)at[i * LANES + lane];                                                              \
      value[0] += row[lane];                                                                                           \
      value[1] += row[WIDTH + lane];                                                                                   \
      value[2] += row[2 * WIDTH + lane];                                                                               \
    }                                                                                                                  \
  }                                                                                                                    \
}

#ifdef __AVX512VL__
#include <immintrin.h>

static inline __attribute__((always_inline, unused)) void gather_floats(
    int points, const int* restrict at, const float* restrict x, floats (*restrict u)[3])
{
  for (int i = 0; i < points; ++i)
  {
    __m512 q[4];
    for (int j = 0; j < 4; ++j)
    {
      const int* lane = at + i * LANES + j;
      q[j] = _mm512_castps128_ps512(_mm_maskz_loadu_ps(7, x + 3 * (size_t)lane[0]));
      q[j] = _mm512_insertf32x4(q[j], _mm_maskz_loadu_ps(7, x + 3 * (size_t)lane[4]), 1);
      q[j] = _mm512_insertf32x4(q[j], _mm_maskz_loadu_ps(7, x + 3 * (size_t)lane[8]), 2);
      q[j] = _mm512_insertf32x4(q[j], _mm_maskz_loadu_ps(7, x + 3 * (size_t)lane[12]), 3);
    }
    const __m512 low0 = _mm512_unpacklo_ps(q[0], q[1]), low1 = _mm512_unpacklo_ps(q[2], q[3]);
    const __m512 high0 = _mm512_unpackhi_ps(q[0], q[1]), high1 = _mm512_unpackhi_ps(q[2], q[3]);
    u[i][0] = (floats)_mm512_shuffle_ps(low0, low1, _MM_SHUFFLE(1, 0, 1, 0));
    u[i][1] = (floats)_mm512_shuffle_ps(low0, low1, _MM_SHUFFLE(3, 2, 3, 2));
    u[i][2] = (floats)_mm512_shuffle_ps(high0, high1, _MM_SHUFFLE(1, 0, 1, 0));
  }
}

static inline __attribute__((always_inline)) void add_three_floats(float* y, __m128 more)
{
  const __m128 pair = _mm_loadl_pi(_mm_setzero_ps(), (const __m64*)y);
  _mm_storel_pi((__m64*)y, _mm_add_ps(pair, more));
  y[2] += _mm_cvtss_f32(_mm_movehl_ps(more, more));
}

static inline __attribute__((always_inline, unused)) void scatter_floats(
    int points, const int* restrict at, floats (*restrict u)[3], float* restrict y)
{
  for (int i = 0; i < points; ++i)
  {
    const __m512 z = (__m512)u[i][2];
    const __m512 low = _mm512_unpacklo_ps((__m512)u[i][0], (__m512)u[i][1]);
    const __m512 high = _mm512_unpackhi_ps((__m512)u[i][0], (__m512)u[i][1]);
    const __m512 q[4] = {
        _mm512_shuffle_ps(low, z, _MM_SHUFFLE(0, 0, 1, 0)),
        _mm512_shuffle_ps(low, z, _MM_SHUFFLE(1, 1, 3, 2)),
        _mm512_shuffle_ps(high, z, _MM_SHUFFLE(2, 2, 1, 0)),
        _mm512_shuffle_ps(high, z, _MM_SHUFFLE(3, 3, 3, 2)),
    };
    const int* lane = at + i * LANES;
    for (int j = 0; j < 4; ++j)
      add_three_floats(y + 3 * (size_t)lane[j], _mm512_castps512_ps128(q[j]));
    for (int j = 0; j < 4; ++j)
      add_three_floats(y + 3 * (size_t)lane[4 + j], _mm512_extractf32x4_ps(q[j], 1));
    for (int j = 0; j < 4; ++j)
      add_three_floats(y + 3 * (size_t)lane[8 + j], _mm512_extractf32x4_ps(q[j], 2));
    for (int j = 0; j < 4; ++j)
      add_three_floats(y + 3 * (size_t)lane[12 + j], _mm512_extractf32x4_ps(q[j], 3));
  }
}

static inline __attribute__((always_inline, unused)) void gather_doubles(
    int points, const int* restrict at, const double* restrict x, doubles (*restrict u)[3])
{
  const __m512i first = _mm512_setr_epi64(0, 1, 8, 9, 4, 5, 12, 13), last = _mm512_setr_epi64(2, 3, 10, 11, 6, 7, 14, 15);
  for (int i = 0; i < points; ++i)
  {
    __m512d q[4];
    for (int j = 0; j < 4; ++j)
    {
      const int* lane = at + i * LANES + j;
      q[j] = _mm512_castpd256_pd512(_mm256_maskz_loadu_pd(7, x + 3 * (size_t)lane[0]));
      q[j] = _mm512_insertf64x4(q[j], _mm256_maskz_loadu_pd(7, x + 3 * (size_t)lane[4]), 1);
    }
    const __m512d even0 = _mm512_unpacklo_pd(q[0], q[1]), even1 = _mm512_unpacklo_pd(q[2], q[3]);
    const __m512d odd0 = _mm512_unpackhi_pd(q[0], q[1]), odd1 = _mm512_unpackhi_pd(q[2], q[3]);
    u[i][0] = (doubles)_mm512_permutex2var_pd(even0, first, even1);
    u[i][1] = (doubles)_mm512_permutex2var_pd(odd0, first, odd1);
    u[i][2] = (doubles)_mm512_permutex2var_pd(even0, last, even1);
  }
}
#else
DEFINE_GATHER(float, floats)
DEFINE_SCATTER(float, floats)
DEFINE_GATHER(double, doubles)
#endif
DEFINE_SCATTER(double, doubles)
#define gather(VECTOR) gather_##VECTOR
#define scatter(VECTOR) scatter_##VECTOR

/* The same for pressures, in double precision: p (count). */
static inline __attribute__((unused)) void gather_pressures(int count, const int* restrict at, const double* restrict x,
                                                            doubles* restrict p)
{
  for (int j = 0; j < count; ++j)
    for (int lane = 0; lane < LANES / 2; ++lane)
      p[j][lane] = x[at[j * LANES + lane]];
}

static inline __attribute__((unused)) void scatter_pressures(int count, const int* restrict at,
                                                             const doubles* restrict p, double* restrict y)
{
  for (int j = 0; j < count; ++j)
    for (int lane = 0; lane < LANES / 2; ++lane)
      y[at[j * LANES + lane]] += p[j][lane];
}

/* The gradient H of u at a quadrature point, H[3 r + s] = d u_r / d x_s times the factor of the map K: D (points, 3) are
 * reference gradients. */
#define GRADIENT(VECTOR, H, D, points, u, K)                                                                           \
  do                                                                                                                   \
  {                                                                                                                    \
    VECTOR G[3][3] = {{{0}}};                                                                                          \
    for (int i = 0; i < points; ++i)                                                                                   \
      for (int a = 0; a < 3; ++a)                                                                                      \
        for (int r = 0; r < 3; ++r)                                                                                    \
          G[a][r] += D[3 * i + a] * u[i][r];                                                                           \
    for (int r = 0; r < 3; ++r)                                                                                        \
      for (int s = 0; s < 3; ++s)                                                                                      \
        H[3 * r + s] = G[0][r] * K[s] + G[1][r] * K[3 + s] + G[2][r] * K[6 + s];                                       \
  } while (0)

/* The transpose: add the nodal forces of the stress T[3 r + s] at a quadrature point to f. */
#define ADD_FORCES(VECTOR, f, D, points, T, K)                                                                         \
  do                                                                                                                   \
  {                                                                                                                    \
    for (int r = 0; r < 3; ++r)                                                                                        \
    {                                                                                                                  \
      VECTOR F[3];                                                                                                     \
      for (int a = 0; a < 3; ++a)                                                                                      \
        F[a] = T[3 * r] * K[3 * a] + T[3 * r + 1] * K[3 * a + 1] + T[3 * r + 2] * K[3 * a + 2];                        \
      for (int i = 0; i < points; ++i)                                                                                 \
        f[i][r] += D[3 * i] * F[0] + D[3 * i + 1] * F[1] + D[3 * i + 2] * F[2];                                        \
    }                                                                                                                  \
  } while (0)
