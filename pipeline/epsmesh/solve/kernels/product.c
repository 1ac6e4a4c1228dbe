/* Matrix-free products with the stiffness of straight-sided tetrahedra, cell by cell.
 *
 * In Bernstein polynomials of degree p, in barycentric coordinates, each coefficient of a gradient, of degree p - 1,
 * depends on two coefficients:
 *
 *     d_a u = sum_b p (c[b + e_a] - c[b + e_0]) B_b,   a = 1, 2, 3.
 *
 * On a straight cell one constant matrix maps the gradient to space, and another one to stress; the rest is the mass of
 * degree p - 1. A sparse matrix converts values at points to coefficients. Cells are stored LANES at a time, one in each
 * lane of vectors; in double precision half of them are processed at once.
 */

#include <math.h>

#include "cells.h"
#include "kernels.h"

enum { MOST_COEFFICIENTS = 20 }; /* of the gradient in degree 4 */

/* The mapping of gradients times the root of the cell's volume, lane by lane: maps (batches, 3, 3, LANES), which the
 * `count` cells do not fill to the end. */
void map_cells(int count, const int* which, const double* corners, double* maps)
{
  for (int k = 0; k < count; ++k)
  {
    const double(*x)[3] = (const double(*)[3])(corners + 12 * (size_t)which[k]);
    double J[3][3], K[3][3];
    for (int a = 0; a < 3; ++a)
      for (int r = 0; r < 3; ++r)
        J[a][r] = x[a + 1][r] - x[0][r];
    for (int a = 0; a < 3; ++a)
      for (int r = 0; r < 3; ++r)
      {
        const int b = (a + 1) % 3, c = (a + 2) % 3, s = (r + 1) % 3, t = (r + 2) % 3;
        K[a][r] = J[b][s] * J[c][t] - J[b][t] * J[c][s];
      }
    const double root = sqrt(fabs(J[0][0] * K[0][0] + J[0][1] * K[0][1] + J[0][2] * K[0][2]));
    double* map = maps + (size_t)(k / LANES) * 9 * LANES + k % LANES;
    for (int a = 0; a < 3; ++a)
      for (int r = 0; r < 3; ++r)
        map[(3 * a + r) * LANES] = K[a][r] / root;
  }
}

/* Add the blocks on the diagonal: S (3, 3, points) is of the reference cell, lame (batches, 2, LANES). */
void add_diagonal(int count, int points, const int* dofs, const double* maps, const double* lame, const double* S,
                  float* diagonal)
{
  for (int k = 0; k < count; ++k)
  {
    const size_t batch = k / LANES, lane = k % LANES;
    const double lambda = lame[2 * LANES * batch + lane], mu = lame[2 * LANES * batch + LANES + lane];
    double K[3][3];
    for (int q = 0; q < 9; ++q)
      K[q / 3][q % 3] = maps[(9 * batch + q) * LANES + lane];
    for (int i = 0; i < points; ++i)
    {
      double P[3][3] = {{0}};
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b)
          for (int r = 0; r < 3; ++r)
            for (int s = 0; s < 3; ++s)
              P[r][s] += S[(3 * a + b) * points + i] * K[a][r] * K[b][s];
      const double trace = mu * (P[0][0] + P[1][1] + P[2][2]);
      float* block = diagonal + 9 * (size_t)dofs[(batch * points + i) * LANES + lane];
      for (int r = 0; r < 3; ++r)
        for (int s = 0; s < 3; ++s)
          block[3 * r + s] += (float)(lambda * P[r][s] + mu * P[s][r] + (r == s ? trace : 0.0));
    }
  }
}

/* y += A x over whole batches of cells: dofs (batches, points, LANES), maps (batches, 3, 3, LANES), lame (batches, 2,
 * LANES); padding cells of the last batch have zero maps. Row i of the map from values to coefficients has the
 * entries first[i] to first[i + 1] - 1; first_back and so on are its transpose. raised (coefficients, 4) has the
 * positions of b + e_0, ..., b + e_3; mass (coefficients, coefficients) includes p^2. */
#define DEFINE_PRODUCT(NAME, TYPE, VECTOR)                                                                             \
static inline __attribute__((always_inline)) void transform(NAME)(                                                     \
    int points, const int* restrict first, const int* restrict column, const TYPE* restrict weight,                    \
    const VECTOR (*restrict from)[3], VECTOR (*restrict to)[3])                                                        \
{                                                                                                                      \
  for (int i = 0; i < points; ++i)                                                                                     \
  {                                                                                                                    \
    VECTOR s0 = {0}, s1 = {0}, s2 = {0};                                                                               \
    for (int k = first[i]; k < first[i + 1]; ++k)                                                                      \
    {                                                                                                                  \
      const VECTOR* v = from[column[k]];                                                                               \
      s0 += weight[k] * v[0];                                                                                          \
      s1 += weight[k] * v[1];                                                                                          \
      s2 += weight[k] * v[2];                                                                                          \
    }                                                                                                                  \
    to[i][0] = s0;                                                                                                     \
    to[i][1] = s1;                                                                                                     \
    to[i][2] = s2;                                                                                                     \
  }                                                                                                                    \
}                                                                                                                      \
                                                                                                                       \
static inline __attribute__((always_inline)) void of_degree(NAME)(                                                     \
    int points, int coefficients, int batches, const int* restrict dofs, const TYPE* restrict maps,                    \
    const TYPE* restrict lame, const int* restrict first, const int* restrict column, const TYPE* restrict weight,     \
    const int* restrict first_back, const int* restrict column_back, const TYPE* restrict weight_back,                 \
    const int* restrict raised, const TYPE* restrict mass, const TYPE* restrict x, TYPE* restrict y)                   \
{                                                                                                                      \
  enum { WIDTH = sizeof(VECTOR) / sizeof(TYPE) };                                                                      \
  for (int part = 0; part < batches * (LANES / WIDTH); ++part)                                                         \
  {                                                                                                                    \
    const size_t batch = part / (LANES / WIDTH), begin = part % (LANES / WIDTH) * WIDTH;                               \
    const int* restrict at = dofs + batch * points * LANES + begin;                                                    \
    VECTOR u[MOST_POINTS][3], c[MOST_POINTS][3], stress[6][MOST_COEFFICIENTS], K[3][3], lambda, mu;                    \
    for (int q = 0; q < 9; ++q)                                                                                        \
      memcpy(&K[q / 3][q % 3], maps + (9 * batch + q) * LANES + begin, sizeof(VECTOR));                                \
    memcpy(&lambda, lame + 2 * LANES * batch + begin, sizeof lambda);                                                  \
    memcpy(&mu, lame + 2 * LANES * batch + LANES + begin, sizeof mu);                                                  \
    gather(VECTOR)(points, at, x, u);                                                                                  \
    transform(NAME)(points, first, column, weight, u, c);                                                              \
    for (int b = 0; b < coefficients; ++b)                                                                             \
    {                                                                                                                  \
      const int* up = raised + 4 * b;                                                                                  \
      VECTOR H[3][3];                                                                                                  \
      for (int r = 0; r < 3; ++r)                                                                                      \
      {                                                                                                                \
        const VECTOR g0 = c[up[1]][r] - c[up[0]][r], g1 = c[up[2]][r] - c[up[0]][r], g2 = c[up[3]][r] - c[up[0]][r];   \
        for (int s = 0; s < 3; ++s)                                                                                    \
          H[r][s] = g0 * K[0][s] + g1 * K[1][s] + g2 * K[2][s];                                                        \
      }                                                                                                                \
      const VECTOR pressure = lambda * (H[0][0] + H[1][1] + H[2][2]);                                                  \
      stress[0][b] = pressure + mu * (H[0][0] + H[0][0]);                                                              \
      stress[1][b] = pressure + mu * (H[1][1] + H[1][1]);                                                              \
      stress[2][b] = pressure + mu * (H[2][2] + H[2][2]);                                                              \
      stress[3][b] = mu * (H[1][2] + H[2][1]);                                                                         \
      stress[4][b] = mu * (H[0][2] + H[2][0]);                                                                         \
      stress[5][b] = mu * (H[0][1] + H[1][0]);                                                                         \
    }                                                                                                                  \
    memset(c, 0, 3 * points * sizeof(VECTOR));                                                                         \
    for (int b = 0; b < coefficients; ++b)                                                                             \
    {                                                                                                                  \
      const int* up = raised + 4 * b;                                                                                  \
      VECTOR t[6];                                                                                                     \
      for (int q = 0; q < 6; ++q)                                                                                      \
      {                                                                                                                \
        t[q] = mass[b * coefficients] * stress[q][0];                                                                  \
        for (int d = 1; d < coefficients; ++d)                                                                         \
          t[q] += mass[b * coefficients + d] * stress[q][d];                                                           \
      }                                                                                                                \
      const VECTOR T[3][3] = {{t[0], t[5], t[4]}, {t[5], t[1], t[3]}, {t[4], t[3], t[2]}};                             \
      for (int r = 0; r < 3; ++r)                                                                                      \
      {                                                                                                                \
        VECTOR sum = {0};                                                                                              \
        for (int a = 0; a < 3; ++a)                                                                                    \
        {                                                                                                              \
          const VECTOR f = T[r][0] * K[a][0] + T[r][1] * K[a][1] + T[r][2] * K[a][2];                                  \
          c[up[a + 1]][r] += f;                                                                                        \
          sum += f;                                                                                                    \
        }                                                                                                              \
        c[up[0]][r] -= sum;                                                                                            \
      }                                                                                                                \
    }                                                                                                                  \
    transform(NAME)(points, first_back, column_back, weight_back, c, u);                                               \
    scatter(VECTOR)(points, at, u, y);                                                                                 \
  }                                                                                                                    \
}                                                                                                                      \
                                                                                                                       \
void NAME(int degree, int batches, const int* dofs, const TYPE* maps, const TYPE* lame, const int* first,              \
          const int* column, const TYPE* weight, const int* first_back, const int* column_back,                        \
          const TYPE* weight_back, const int* raised, const TYPE* mass, const TYPE* x, TYPE* y)                        \
{                                                                                                                      \
  if (degree == 1) /* loops of constant length are unrolled */                                                         \
    of_degree(NAME)(4, 1, batches, dofs, maps, lame, first, column, weight, first_back, column_back, weight_back,      \
                    raised, mass, x, y);                                                                               \
  else if (degree == 2)                                                                                                \
    of_degree(NAME)(10, 4, batches, dofs, maps, lame, first, column, weight, first_back, column_back, weight_back,     \
                    raised, mass, x, y);                                                                               \
  else if (degree == 3)                                                                                                \
    of_degree(NAME)(20, 10, batches, dofs, maps, lame, first, column, weight, first_back, column_back, weight_back,    \
                    raised, mass, x, y);                                                                               \
  else                                                                                                                 \
    of_degree(NAME)(35, 20, batches, dofs, maps, lame, first, column, weight, first_back, column_back, weight_back,    \
                    raised, mass, x, y);                                                                               \
}

#define transform(NAME) NAME##_transform
#define of_degree(NAME) NAME##_of_degree

DEFINE_PRODUCT(add_product, float, floats)
DEFINE_PRODUCT(add_product_double, double, doubles)
