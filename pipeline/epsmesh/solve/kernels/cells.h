/* Cells in batches: LANES at a time, one in each lane of vectors, the last batch padded. In double precision half of a
 * batch is processed at once. WIDTH is the number of lanes of a vector. */

#include <stddef.h>
#include <stdint.h>
#include <string.h>

enum { LANES = 16, MOST_POINTS = 35, MOST_PRESSURES = 20 }; /* of degree 4, and of 3 */

typedef float floats __attribute__((vector_size(64)));
typedef double doubles __attribute__((vector_size(64)));

/* gather_VECTOR: read vectors at the points of some cells, u (points, 3). scatter_VECTOR: add u to what is there. */
#define DEFINE_TRANSFER(TYPE, VECTOR)                                                                                  \
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
}                                                                                                                      \
                                                                                                                       \
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

DEFINE_TRANSFER(float, floats)
DEFINE_TRANSFER(double, doubles)
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
