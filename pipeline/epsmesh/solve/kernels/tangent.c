/* The tangent of a hyperelastic body, cell by cell: moduli at quadrature points, and products with them.
 *
 * Cells are stored as in product.c and curved.c, LANES at a time. With H = grad u at a quadrature point, the tangent is
 *
 *     sum over points of  H : A : H,   A = second derivatives of the energy density by F, a symmetric (9, 9) array.
 *
 * Gradients of cell k at point q are mapped by `maps`, which have the root of the volume ratio (and of the weight) as a
 * factor: straight cells have one map, step = 0; curved cells one a point, step = 9 LANES. A includes the rest of the
 * weight. Its upper triangle, row by row, is kept in single precision: an error of 1e-7 of the tangent does not change
 * what Newton's method converges to. Components of F are row by row, 3 r + s of the derivative of u_r by x_s.
 */

#include "cells.h"
#include "kernels.h"

enum { MODULI = 45, HALF = 8 };

typedef float halves __attribute__((vector_size(32)));

/* A generated cell kernel (UFCx); later versions have a seventh argument, which earlier ones ignore. */
typedef void (*cell_kernel)(double* A, const double* w, const double* c, const double* x, const int* l,
                            const uint8_t* p, void* data);

/* Nodes of the reference cell, corners and middles of edges. */
static const double reference_cell[30] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, .5, .5, .5,
                                          0, .5, .5, .5, 0, 0, 0, .5, 0, .5, 0, .5, 0, 0};

/* Evaluate a second derivative of the energy at the quadrature points of some cells; `outputs` is 45 for the upper
 * triangle of that by F twice, 9 for that by p and F, with one more root: found (batches, quadrature, outputs, LANES).
 *
 * roots (batches, quadrature or 1, LANES) are those of the maps, factors (quadrature) the rest of the weights. Pressures
 * p, if count > 0, have the functions values (quadrature, count). region (cells) is that of each cell; each region has a
 * kernel, the positions of F and p in what that reads (-1: not read), and its constants, `most` numbers a region. */
void evaluate_moduli(int cells, int points, int quadrature, const int* dofs, const double* maps, const double* roots,
                     int step, const double* factors, const double* gradients, const double* u, int count,
                     const int* pressures, const double* values, const double* p, const int* region,
                     const uint64_t* kernels, const int* positions, const double* constants, int most, int outputs,
                     float* found)
{
  const int size = outputs == MODULI ? 81 : outputs;
  for (int begin = 0; begin < cells; begin += HALF)
  {
    const size_t batch = begin / LANES, lanes = begin % LANES;
    doubles v[MOST_POINTS][3], H[9], K[9], root;
    gather(doubles)(points, dofs + batch * points * LANES + lanes, u, v);
    for (int q = 0; q < quadrature; ++q)
    {
      const size_t place = step ? batch * quadrature + q : batch;
      for (int n = 0; n < 9; ++n)
        memcpy(&K[n], maps + (place * 9 + n) * LANES + lanes, sizeof K[n]);
      memcpy(&root, roots + place * LANES + lanes, sizeof root);
      GRADIENT(doubles, H, (gradients + 3 * (size_t)points * q), points, v, K);
      for (int lane = 0; lane < HALF && begin + lane < cells; ++lane)
      {
        const int of = region[begin + lane], at_F = positions[2 * of], at_p = positions[2 * of + 1];
        double w[10] = {0}, A[81];
        for (int n = 0; n < 9 && at_F >= 0; ++n)
          w[at_F + n] = H[n][lane] / root[lane] + (n % 4 == 0);
        for (int j = 0; j < count && at_p >= 0; ++j)
          w[at_p] += values[q * count + j] * p[pressures[(batch * count + j) * LANES + lanes + lane]];
        memset(A, 0, size * sizeof(double));
        ((cell_kernel)kernels[of])(A, w, constants + (size_t)most * of, reference_cell, 0, 0, 0);
        float* to = found + (batch * quadrature + q) * outputs * LANES + lanes + lane;
        if (size == outputs)
          for (int n = 0; n < size; ++n)
            to[n * LANES] = (float)(factors[q] * root[lane] * A[n]);
        else
          for (int n = 0, k = 0; n < 9; ++n)
            for (int m = n; m < 9; ++m, ++k)
              to[k * LANES] = (float)(factors[q] * A[9 * n + m]);
      }
    }
  }
}

/* The blocks on the diagonal, added to diagonal (local points, 9). */
void add_tangent_diagonal(int points, int quadrature, int batches, const int* dofs, const double* maps, int step,
                          const double* gradients, const float* moduli, float* diagonal)
{
  for (int part = 0; part < 2 * batches; ++part)
  {
    const size_t batch = part / 2, lanes = part % 2 * HALF;
    doubles P[MOST_POINTS][9];
    memset(P, 0, points * sizeof P[0]);
    for (int q = 0; q < quadrature; ++q)
    {
      const double* map = maps + (step ? batch * quadrature + q : batch) * 9 * LANES + lanes;
      const float* from = moduli + (batch * quadrature + q) * MODULI * LANES + lanes;
      doubles K[9], A[9][9];
      for (int n = 0; n < 9; ++n)
        memcpy(&K[n], map + n * LANES, sizeof K[n]);
      for (int n = 0; n < 9; ++n)
        for (int m = n; m < 9; ++m, from += LANES)
        {
          halves modulus;
          memcpy(&modulus, from, sizeof modulus);
          A[n][m] = A[m][n] = __builtin_convertvector(modulus, doubles);
        }
      for (int i = 0; i < points; ++i)
      {
        const double* D = gradients + 3 * ((size_t)points * q + i);
        doubles g[3], T[9][3];
        for (int s = 0; s < 3; ++s)
          g[s] = D[0] * K[s] + D[1] * K[3 + s] + D[2] * K[6 + s];
        for (int n = 0; n < 9; ++n)
          for (int r = 0; r < 3; ++r)
            T[n][r] = A[n][3 * r] * g[0] + A[n][3 * r + 1] * g[1] + A[n][3 * r + 2] * g[2];
        for (int r = 0; r < 3; ++r)
          for (int s = 0; s < 3; ++s)
            P[i][3 * r + s] += T[3 * r][s] * g[0] + T[3 * r + 1][s] * g[1] + T[3 * r + 2][s] * g[2];
      }
    }
    for (int i = 0; i < points; ++i)
      for (int lane = 0; lane < HALF; ++lane)
      {
        float* block = diagonal + 9 * (size_t)dofs[(batch * points + i) * LANES + lanes + lane];
        for (int n = 0; n < 9; ++n)
          block[n] += (float)P[i][n][lane];
      }
  }
}

/* y += B x: pressures (batches, count, LANES), values (quadrature, count), coupling (batches, quadrature, 9, LANES). */
void add_tangent_dilation(int points, int quadrature, int batches, const int* dofs, const double* maps, int step,
                          const double* gradients, const float* coupling, int count, const int* pressures,
                          const double* values, const double* x, double* y)
{
  for (int part = 0; part < 2 * batches; ++part)
  {
    const size_t batch = part / 2, lanes = part % 2 * HALF;
    doubles u[MOST_POINTS][3], f[MOST_PRESSURES] = {{0}}, H[9], K[9];
    gather(doubles)(points, dofs + batch * points * LANES + lanes, x, u);
    for (int q = 0; q < quadrature; ++q)
    {
      const double* map = maps + (step ? batch * quadrature + q : batch) * 9 * LANES + lanes;
      for (int n = 0; n < 9; ++n)
        memcpy(&K[n], map + n * LANES, sizeof K[n]);
      GRADIENT(doubles, H, (gradients + 3 * (size_t)points * q), points, u, K);
      doubles sum = {0};
      for (int n = 0; n < 9; ++n)
      {
        halves factor;
        memcpy(&factor, coupling + ((batch * quadrature + q) * 9 + n) * LANES + lanes, sizeof factor);
        sum += __builtin_convertvector(factor, doubles) * H[n];
      }
      for (int j = 0; j < count; ++j)
        f[j] += values[q * count + j] * sum;
    }
    scatter_pressures(count, pressures + batch * count * LANES + lanes, f, y);
  }
}

/* y += B' x */
void add_tangent_pull(int points, int quadrature, int batches, const int* dofs, const double* maps, int step,
                      const double* gradients, const float* coupling, int count, const int* pressures,
                      const double* values, const double* x, double* y)
{
  for (int part = 0; part < 2 * batches; ++part)
  {
    const size_t batch = part / 2, lanes = part % 2 * HALF;
    doubles f[MOST_POINTS][3], p[MOST_PRESSURES], K[9], T[9];
    memset(f, 0, points * sizeof f[0]);
    gather_pressures(count, pressures + batch * count * LANES + lanes, x, p);
    for (int q = 0; q < quadrature; ++q)
    {
      const double* map = maps + (step ? batch * quadrature + q : batch) * 9 * LANES + lanes;
      const double* D = gradients + 3 * (size_t)points * q;
      doubles sum = {0};
      for (int j = 0; j < count; ++j)
        sum += values[q * count + j] * p[j];
      for (int n = 0; n < 9; ++n)
      {
        halves factor;
        memcpy(&factor, coupling + ((batch * quadrature + q) * 9 + n) * LANES + lanes, sizeof factor);
        memcpy(&K[n], map + n * LANES, sizeof K[n]);
        T[n] = __builtin_convertvector(factor, doubles) * sum;
      }
      ADD_FORCES(doubles, f, D, points, T, K);
    }
    scatter(doubles)(points, dofs + batch * points * LANES + lanes, f, y);
  }
}

/* y += K x in single precision, or in double with the same moduli; LOAD reads them as VECTOR. */
#define DEFINE_PRODUCT(NAME, TYPE, VECTOR, LOADED)                                                                     \
void NAME(int points, int quadrature, int batches, const int* restrict dofs, const TYPE* restrict maps, int step,      \
          const TYPE* restrict gradients, const float* restrict moduli, const TYPE* restrict x, TYPE* restrict y)      \
{                                                                                                                      \
  enum { WIDTH = sizeof(VECTOR) / sizeof(TYPE) };                                                                      \
  for (int part = 0; part < batches * (LANES / WIDTH); ++part)                                                         \
  {                                                                                                                    \
    const size_t batch = part / (LANES / WIDTH), begin = part % (LANES / WIDTH) * WIDTH;                               \
    const int* restrict at = dofs + batch * points * LANES + begin;                                                    \
    VECTOR u[MOST_POINTS][3], f[MOST_POINTS][3];                                                                       \
    memset(f, 0, 3 * points * sizeof(VECTOR));                                                                         \
    gather(VECTOR)(points, at, x, u);                                                                                  \
    for (int q = 0; q < quadrature; ++q)                                                                               \
    {                                                                                                                  \
      const TYPE* restrict D = gradients + 3 * (size_t)points * q;                                                     \
      const TYPE* restrict map = maps + (step ? batch * quadrature + q : batch) * 9 * LANES + begin;                   \
      const float* restrict A = moduli + (batch * quadrature + q) * MODULI * LANES + begin;                            \
      VECTOR K[9], H[9], T[9] = {{0}};                                                                                 \
      for (int n = 0; n < 9; ++n)                                                                                      \
        memcpy(&K[n], map + n * LANES, sizeof(VECTOR));                                                                \
      GRADIENT(VECTOR, H, D, points, u, K);                                                                            \
      _Pragma("GCC unroll 9")                                                                                          \
      for (int n = 0; n < 9; ++n)                                                                                      \
        _Pragma("GCC unroll 9")                                                                                        \
        for (int m = n; m < 9; ++m)                                                                                    \
        {                                                                                                              \
          LOADED loaded;                                                                                               \
          memcpy(&loaded, A + (9 * n - n * (n - 1) / 2 + m - n) * LANES, sizeof loaded);                               \
          const VECTOR modulus = __builtin_convertvector(loaded, VECTOR);                                              \
          T[n] += modulus * H[m];                                                                                      \
          if (m > n)                                                                                                   \
            T[m] += modulus * H[n];                                                                                    \
        }                                                                                                              \
      ADD_FORCES(VECTOR, f, D, points, T, K);                                                                          \
    }                                                                                                                  \
    scatter(VECTOR)(points, at, f, y);                                                                                 \
  }                                                                                                                    \
}

DEFINE_PRODUCT(add_tangent, float, floats, floats)
DEFINE_PRODUCT(add_tangent_double, double, doubles, halves)
