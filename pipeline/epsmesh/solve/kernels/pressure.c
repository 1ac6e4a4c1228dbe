/* Matrix-free products of mixed elements, cell by cell: the coupling int q div u, its transpose, the mass int p q.
 *
 * Straight cells use Bernstein coefficients, curved ones quadrature; both are stored as in product.c and curved.c, LANES
 * at a time, of which half are processed at once. Maps of gradients contain one root of the volume, roots the other one,
 * with the sign of the cell's determinant; padding cells add zero.
 */

#include "cells.h"
#include "kernels.h"

enum { WIDTH = 8 };

/* to = T from, T sparse by rows, with `size` numbers for each. */
static inline __attribute__((always_inline)) void transform(
    int rows, int size, const int* restrict first, const int* restrict column, const double* restrict weight,
    const doubles* restrict from, doubles* restrict to)
{
  for (int i = 0; i < rows; ++i)
    for (int r = 0; r < size; ++r)
    {
      doubles sum = {0};
      for (int k = first[i]; k < first[i + 1]; ++k)
        sum += weight[k] * from[size * column[k] + r];
      to[size * i + r] = sum;
    }
}

static inline void apply_mass(int count, const double* restrict mass, const doubles* restrict from, doubles* restrict to)
{
  for (int b = 0; b < count; ++b)
  {
    doubles sum = {0};
    for (int d = 0; d < count; ++d)
      sum += mass[b * count + d] * from[d];
    to[b] = sum;
  }
}

#define BEGIN                                                                                                          \
  for (int part = 0; part < batches * (LANES / WIDTH); ++part)                                                         \
  {                                                                                                                    \
    const size_t batch = part / (LANES / WIDTH), begin = part % (LANES / WIDTH) * WIDTH;
#define END }

/* y += B x: dofs (batches, points, LANES), pressures (batches, count, LANES), maps (batches, 3, 3, LANES), roots
 * (batches, 1, LANES). first and so on take values of displacements to coefficients, those of `back` coefficients to
 * values of pressures; raised as in product.c, mass (count, count) includes the degree. */
void add_dilation(int points, int count, int batches, const int* dofs, const int* pressures, const double* maps,
                  const double* roots, const int* first, const int* column, const double* weight,
                  const int* first_back, const int* column_back, const double* weight_back, const int* raised,
                  const double* mass, const double* x, double* y)
{
  BEGIN
    doubles u[MOST_POINTS][3], c[MOST_POINTS][3], K[9], root, p[MOST_PRESSURES], d[MOST_PRESSURES];
    for (int n = 0; n < 9; ++n)
      memcpy(&K[n], maps + (9 * batch + n) * LANES + begin, sizeof K[n]);
    memcpy(&root, roots + LANES * batch + begin, sizeof root);
    gather(doubles)(points, dofs + batch * points * LANES + begin, x, u);
    transform(points, 3, first, column, weight, u[0], c[0]);
    for (int b = 0; b < count; ++b)
    {
      const int* up = raised + 4 * b;
      doubles sum = {0};
      for (int a = 0; a < 3; ++a)
        for (int r = 0; r < 3; ++r)
          sum += (c[up[a + 1]][r] - c[up[0]][r]) * K[3 * a + r];
      p[b] = root * sum;
    }
    apply_mass(count, mass, p, d);
    transform(count, 1, first_back, column_back, weight_back, d, p);
    scatter_pressures(count, pressures + batch * count * LANES + begin, p, y);
  END
}

/* y += B^T x; first and so on take values of pressures to coefficients, those of `back` coefficients to values of
 * displacements. */
void add_pull(int points, int count, int batches, const int* dofs, const int* pressures, const double* maps,
              const double* roots, const int* first, const int* column, const double* weight, const int* first_back,
              const int* column_back, const double* weight_back, const int* raised, const double* mass,
              const double* x, double* y)
{
  BEGIN
    doubles u[MOST_POINTS][3], c[MOST_POINTS][3], K[9], root, p[MOST_PRESSURES], d[MOST_PRESSURES];
    for (int n = 0; n < 9; ++n)
      memcpy(&K[n], maps + (9 * batch + n) * LANES + begin, sizeof K[n]);
    memcpy(&root, roots + LANES * batch + begin, sizeof root);
    gather_pressures(count, pressures + batch * count * LANES + begin, x, p);
    transform(count, 1, first, column, weight, p, d);
    apply_mass(count, mass, d, p);
    memset(c, 0, 3 * points * sizeof c[0][0]);
    for (int b = 0; b < count; ++b)
    {
      const int* up = raised + 4 * b;
      const doubles value = root * p[b];
      for (int a = 0; a < 3; ++a)
        for (int r = 0; r < 3; ++r)
        {
          const doubles f = value * K[3 * a + r];
          c[up[a + 1]][r] += f;
          c[up[0]][r] -= f;
        }
    }
    transform(points, 3, first_back, column_back, weight_back, c[0], u[0]);
    scatter(doubles)(points, dofs + batch * points * LANES + begin, u, y);
  END
}

/* y += M x on straight cells: mass (count, count) is of pressures on the reference cell. */
void add_mass(int count, int batches, const int* pressures, const double* roots, const double* mass, const double* x,
              double* y)
{
  BEGIN
    doubles p[MOST_PRESSURES], d[MOST_PRESSURES], root;
    memcpy(&root, roots + LANES * batch + begin, sizeof root);
    gather_pressures(count, pressures + batch * count * LANES + begin, x, p);
    apply_mass(count, mass, p, d);
    for (int b = 0; b < count; ++b)
      d[b] *= root * root;
    scatter_pressures(count, pressures + batch * count * LANES + begin, d, y);
  END
}

/* y += B x on curved cells: maps (batches, quadrature, 3, 3, LANES), roots (batches, quadrature, LANES), gradients
 * (quadrature, points, 3) of displacements, values (quadrature, count) of pressures; signs are those of weights. */
void add_curved_dilation(int points, int count, int quadrature, int batches, const int* dofs, const int* pressures,
                         const double* maps, const double* roots, const double* signs, const double* gradients,
                         const double* values, const double* x, double* y)
{
  BEGIN
    doubles u[MOST_POINTS][3], p[MOST_PRESSURES];
    memset(p, 0, sizeof p);
    gather(doubles)(points, dofs + batch * points * LANES + begin, x, u);
    for (int q = 0; q < quadrature; ++q)
    {
      const double* D = gradients + 3 * (size_t)points * q;
      doubles G[9] = {{0}}, sum = {0}, root;
      for (int i = 0; i < points; ++i)
        for (int a = 0; a < 3; ++a)
          for (int r = 0; r < 3; ++r)
            G[3 * a + r] += D[3 * i + a] * u[i][r];
      for (int n = 0; n < 9; ++n)
      {
        doubles K;
        memcpy(&K, maps + ((batch * quadrature + q) * 9 + n) * LANES + begin, sizeof K);
        sum += K * G[n];
      }
      memcpy(&root, roots + (batch * quadrature + q) * LANES + begin, sizeof root);
      sum *= signs[q] * root;
      for (int j = 0; j < count; ++j)
        p[j] += values[(size_t)count * q + j] * sum;
    }
    scatter_pressures(count, pressures + batch * count * LANES + begin, p, y);
  END
}

/* y += B^T x on curved cells. */
void add_curved_pull(int points, int count, int quadrature, int batches, const int* dofs, const int* pressures,
                     const double* maps, const double* roots, const double* signs, const double* gradients,
                     const double* values, const double* x, double* y)
{
  BEGIN
    doubles u[MOST_POINTS][3], p[MOST_PRESSURES];
    memset(u, 0, sizeof u);
    gather_pressures(count, pressures + batch * count * LANES + begin, x, p);
    for (int q = 0; q < quadrature; ++q)
    {
      const double* D = gradients + 3 * (size_t)points * q;
      doubles F[9], sum = {0}, root;
      for (int j = 0; j < count; ++j)
        sum += values[(size_t)count * q + j] * p[j];
      memcpy(&root, roots + (batch * quadrature + q) * LANES + begin, sizeof root);
      sum *= signs[q] * root;
      for (int n = 0; n < 9; ++n)
      {
        memcpy(&F[n], maps + ((batch * quadrature + q) * 9 + n) * LANES + begin, sizeof F[n]);
        F[n] *= sum;
      }
      for (int i = 0; i < points; ++i)
        for (int r = 0; r < 3; ++r)
          u[i][r] += D[3 * i] * F[r] + D[3 * i + 1] * F[3 + r] + D[3 * i + 2] * F[6 + r];
    }
    scatter(doubles)(points, dofs + batch * points * LANES + begin, u, y);
  END
}

/* y += M x on curved cells. */
void add_curved_mass(int count, int quadrature, int batches, const int* pressures, const double* roots,
                     const double* signs, const double* values, const double* x, double* y)
{
  BEGIN
    doubles p[MOST_PRESSURES], d[MOST_PRESSURES];
    memset(d, 0, sizeof d);
    gather_pressures(count, pressures + batch * count * LANES + begin, x, p);
    for (int q = 0; q < quadrature; ++q)
    {
      const double* value = values + (size_t)count * q;
      doubles sum = {0}, root;
      for (int j = 0; j < count; ++j)
        sum += value[j] * p[j];
      memcpy(&root, roots + (batch * quadrature + q) * LANES + begin, sizeof root);
      sum *= signs[q] * root * root;
      for (int j = 0; j < count; ++j)
        d[j] += value[j] * sum;
    }
    scatter_pressures(count, pressures + batch * count * LANES + begin, d, y);
  END
}
