/* Matrix-free products with the stiffness of curved tetrahedra, cell by cell, by quadrature.
 *
 * Cells are stored as in product.c, LANES at a time; in double precision half of them are taken at once.
 */

#include <math.h>

#include "cells.h"
#include "kernels.h"

/* The mapping of gradients at each quadrature point, times the root of the weight's magnitude and of the volume ratio
 * there, lane by lane: maps (batches, quadrature, 3, 3, LANES). roots (batches, quadrature, LANES) are these roots, with
 * the sign of the determinant. nodes (count, width, 3) are those of the geometry, gradients (quadrature, width, 3) of its
 * functions. */
void map_curved(int count, int width, int quadrature, const double* nodes, const double* gradients,
                const double* weights, double* maps, double* roots)
{
  for (int k = 0; k < count; ++k)
    for (int q = 0; q < quadrature; ++q)
    {
      const double* x = nodes + 3 * (size_t)width * k;
      const double* D = gradients + 3 * (size_t)width * q;
      double J[3][3] = {{0}}, K[3][3];
      for (int n = 0; n < width; ++n)
        for (int a = 0; a < 3; ++a)
          for (int r = 0; r < 3; ++r)
            J[a][r] += D[3 * n + a] * x[3 * n + r];
      for (int a = 0; a < 3; ++a)
        for (int r = 0; r < 3; ++r)
        {
          const int b = (a + 1) % 3, c = (a + 2) % 3, s = (r + 1) % 3, t = (r + 2) % 3;
          K[a][r] = J[b][s] * J[c][t] - J[b][t] * J[c][s];
        }
      const double volume = J[0][0] * K[0][0] + J[0][1] * K[0][1] + J[0][2] * K[0][2];
      const double scale = sqrt(fabs(weights[q] / volume));
      const size_t point = (size_t)(k / LANES) * quadrature + q;
      double* map = maps + point * 9 * LANES + k % LANES;
      roots[point * LANES + k % LANES] = scale * volume;
      for (int a = 0; a < 3; ++a)
        for (int r = 0; r < 3; ++r)
          map[(3 * a + r) * LANES] = scale * K[a][r];
    }
}

/* Add the blocks on the diagonal: gradients (quadrature, points, 3) are of the space's functions. A weight may be
 * negative: signs (quadrature) has 1 or -1. */
void add_curved_diagonal(int points, int quadrature, int batches, const int* restrict dofs,
                         const double* restrict maps, const double* restrict lame, const double* restrict signs,
                         const double* restrict gradients, float* restrict diagonal)
{
  enum { WIDTH = 8 };
  for (int part = 0; part < batches * (LANES / WIDTH); ++part)
  {
    const size_t batch = part / (LANES / WIDTH), begin = part % (LANES / WIDTH) * WIDTH;
    doubles P[MOST_POINTS][6], lambda, mu;
    memset(P, 0, sizeof P);
    memcpy(&lambda, lame + 2 * LANES * batch + begin, sizeof lambda);
    memcpy(&mu, lame + 2 * LANES * batch + LANES + begin, sizeof mu);
    for (int q = 0; q < quadrature; ++q)
    {
      doubles K[9];
      for (int n = 0; n < 9; ++n)
        memcpy(&K[n], maps + ((batch * quadrature + q) * 9 + n) * LANES + begin, sizeof K[n]);
      for (int i = 0; i < points; ++i)
      {
        const double* D = gradients + 3 * ((size_t)points * q + i);
        doubles g[3];
        for (int s = 0; s < 3; ++s)
          g[s] = D[0] * K[s] + D[1] * K[3 + s] + D[2] * K[6 + s];
        for (int r = 0, n = 0; r < 3; ++r)
          for (int s = r; s < 3; ++s, ++n)
            P[i][n] += signs[q] * g[r] * g[s];
      }
    }
    for (int i = 0; i < points; ++i)
    {
      const doubles trace = mu * (P[i][0] + P[i][3] + P[i][5]), both = lambda + mu;
      const doubles blocks[9] = {both * P[i][0] + trace, both * P[i][1], both * P[i][2],
                                 both * P[i][1], both * P[i][3] + trace, both * P[i][4],
                                 both * P[i][2], both * P[i][4], both * P[i][5] + trace};
      for (int lane = 0; lane < WIDTH; ++lane)
      {
        float* block = diagonal + 9 * (size_t)dofs[(batch * points + i) * LANES + begin + lane];
        for (int n = 0; n < 9; ++n)
          block[n] += (float)blocks[n][lane];
      }
    }
  }
}

/* y += A x over whole batches of cells: dofs (batches, points, LANES), maps (batches, quadrature, 3, 3, LANES), lame
 * (batches, 2, LANES); padding cells of the last batch have zero maps. */
#define DEFINE_PRODUCT(NAME, TYPE, VECTOR)                                                                             \
void NAME(int points, int quadrature, int batches, const int* restrict dofs, const TYPE* restrict maps,                \
          const TYPE* restrict lame, const TYPE* restrict signs, const TYPE* restrict gradients,                       \
          const TYPE* restrict x, TYPE* restrict y)                                                                    \
{                                                                                                                      \
  enum { WIDTH = sizeof(VECTOR) / sizeof(TYPE) };                                                                      \
  for (int part = 0; part < batches * (LANES / WIDTH); ++part)                                                         \
  {                                                                                                                    \
    const size_t batch = part / (LANES / WIDTH), begin = part % (LANES / WIDTH) * WIDTH;                               \
    const int* restrict at = dofs + batch * points * LANES + begin;                                                    \
    VECTOR u[MOST_POINTS][3], f[MOST_POINTS][3], lambda, mu;                                                           \
    memcpy(&lambda, lame + 2 * LANES * batch + begin, sizeof lambda);                                                  \
    memcpy(&mu, lame + 2 * LANES * batch + LANES + begin, sizeof mu);                                                  \
    memset(f, 0, 3 * points * sizeof(VECTOR));                                                                         \
    gather(VECTOR)(points, at, x, u);                                                                                  \
    for (int q = 0; q < quadrature; ++q)                                                                               \
    {                                                                                                                  \
      const TYPE* restrict D = gradients + 3 * (size_t)points * q;                                                     \
      VECTOR K[9], H[9], T[9];                                                                                         \
      for (int n = 0; n < 9; ++n)                                                                                      \
        memcpy(&K[n], maps + ((batch * quadrature + q) * 9 + n) * LANES + begin, sizeof(VECTOR));                      \
      GRADIENT(VECTOR, H, D, points, u, K);                                                                            \
      const VECTOR pressure = signs[q] * lambda * (H[0] + H[4] + H[8]), signed_mu = signs[q] * mu;                     \
      for (int r = 0; r < 3; ++r)                                                                                      \
      {                                                                                                                \
        for (int s = 0; s < 3; ++s)                                                                                    \
          T[3 * r + s] = signed_mu * (H[3 * r + s] + H[3 * s + r]);                                                    \
        T[4 * r] += pressure;                                                                                          \
      }                                                                                                                \
      ADD_FORCES(VECTOR, f, D, points, T, K);                                                                          \
    }                                                                                                                  \
    scatter(VECTOR)(points, at, f, y);                                                                                 \
  }                                                                                                                    \
}

DEFINE_PRODUCT(add_curved, float, floats)
DEFINE_PRODUCT(add_curved_double, double, doubles)
