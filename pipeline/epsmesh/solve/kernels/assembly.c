/* Operators on straight-sided tetrahedra, added to a matrix whose pattern is known; first of all the stiffness.
 *
 * On a straight cell the gradients of the reference element are mapped by one constant matrix, so that
 *
 *     P_rs(i, j) = integral of d_r phi_i d_s phi_j = sum_ab K_ar K_bs S_ab(i, j) |det J|,   K = inverse of J,
 *
 * with the nine tensors S_ab of the reference cell: no quadrature is left. The block of the points i and j is
 *
 *     lambda P + mu (P' + trace P).
 *
 * Blocks are stored by columns, as PETSc stores them. Pairs of points are those with i <= j, row by row.
 */

#include <math.h>
#include <stddef.h>
#include <stdint.h>

#include "kernels.h"

enum { MOST_PAIRS = 630 }; /* the 35 points of degree 4 */

/* Fill `places`, (cells, width, width): the number of the entry that each pair of points of a cell has in a matrix.
 *
 * A cell has `width` points, `dofs`. Row r has the entries offsets[r] to offsets[r + 1] - 1, with their `columns`. The
 * visits of a row are, in the same way, the positions at which its point occurs among the points of all cells. `entry` is
 * work space, one number per column.
 */
void find_entries(int rows, int width, const int* dofs, const int* offsets, const int* columns, const int* first_visit,
                  const int* visits, int* entry, int* places)
{
  for (int row = 0; row < rows; ++row)
  {
    for (int k = offsets[row]; k < offsets[row + 1]; ++k)
      entry[columns[k]] = k;
    for (int v = first_visit[row]; v < first_visit[row + 1]; ++v)
    {
      const int* cell = dofs + visits[v] / width * (size_t)width;
      for (int j = 0; j < width; ++j)
        places[visits[v] * (size_t)width + j] = entry[cell[j]];
    }
  }
}

/* The mapping of gradients times the root of the cell's volume, from the cell's corners. */
static void mapping(const double corners[4][3], double K[3][3])
{
  double J[3][3];
  for (int a = 0; a < 3; ++a)
    for (int r = 0; r < 3; ++r)
      J[a][r] = corners[a + 1][r] - corners[0][r];
  for (int a = 0; a < 3; ++a)
    for (int r = 0; r < 3; ++r)
    {
      const int b = (a + 1) % 3, c = (a + 2) % 3, s = (r + 1) % 3, t = (r + 2) % 3;
      K[a][r] = J[b][s] * J[c][t] - J[b][t] * J[c][s];
    }
  const double det = J[0][0] * K[0][0] + J[0][1] * K[0][1] + J[0][2] * K[0][2];
  for (int a = 0; a < 3; ++a)
    for (int r = 0; r < 3; ++r)
      K[a][r] /= sqrt(fabs(det));
}

/* The blocks of all pairs, entry by entry: B[3 * s + r] holds row r, column s. */
static void stiffness(int pairs, const double* restrict S, const double K[3][3], double lambda, double mu,
                      double B[restrict 9][MOST_PAIRS])
{
  for (int p = 0; p < pairs; ++p)
  {
    double T[3][3], P[3][3];
    for (int r = 0; r < 3; ++r)
      for (int b = 0; b < 3; ++b)
        T[r][b] = K[0][r] * S[b * pairs + p] + K[1][r] * S[(3 + b) * pairs + p] + K[2][r] * S[(6 + b) * pairs + p];
    for (int r = 0; r < 3; ++r)
      for (int s = 0; s < 3; ++s)
        P[r][s] = T[r][0] * K[0][s] + T[r][1] * K[1][s] + T[r][2] * K[2][s];
    const double trace = mu * (P[0][0] + P[1][1] + P[2][2]);
    for (int r = 0; r < 3; ++r)
      for (int s = 0; s < 3; ++s)
        B[3 * s + r][p] = lambda * P[r][s] + mu * P[s][r] + (r == s ? trace : 0.0);
  }
}

/* Set rows and columns of prescribed displacements to zero. Most cells have none. */
static void hold(int points, const int* dofs, const double* free, double B[restrict 9][MOST_PAIRS])
{
  int held = 0;
  for (int i = 0; i < points; ++i)
    for (int r = 0; r < 3; ++r)
      held |= free[3 * (size_t)dofs[i] + r] == 0.0;
  if (!held)
    return;
  for (int i = 0, p = 0; i < points; ++i)
    for (int j = i; j < points; ++j, ++p)
      for (int s = 0; s < 3; ++s)
        for (int r = 0; r < 3; ++r)
          B[3 * s + r][p] *= free[3 * (size_t)dofs[i] + r] * free[3 * (size_t)dofs[j] + s];
}

/* Add the blocks of all pairs, and their transposes, to the matrix. */
static void scatter(int points, const int* places, const double B[restrict 9][MOST_PAIRS], double* blocks)
{
  for (int i = 0, p = 0; i < points; ++i)
    for (int j = i; j < points; ++j, ++p)
    {
      double* here = blocks + 9 * (size_t)places[i * points + j];
      for (int q = 0; q < 9; ++q)
        here[q] += B[q][p];
      if (i == j)
        continue;
      double* there = blocks + 9 * (size_t)places[j * points + i];
      for (int s = 0; s < 3; ++s)
        for (int r = 0; r < 3; ++r)
          there[3 * r + s] += B[3 * s + r][p];
    }
}

/* Add the stiffness of some cells to the `blocks` of a matrix.
 *
 * corners (cells, 4, 3); dofs (cells, points); places (cells, points, points) from find_entries; S (3, 3, pairs);
 * free (dofs, 3): 1, or 0 where a displacement is prescribed; `which` are the `count` cells to add; region (cells) are
 * the region numbers, with lambda and mu of each region.
 */
void add_stiffness(int count, const int* which, int points, const double* corners, const int* dofs, const int* places,
                   const double* S, const double* free, const int* region, const double* lambda, const double* mu,
                   double* blocks)
{
  const int pairs = points * (points + 1) / 2, places_each = points * points;
  for (int k = 0; k < count; ++k)
  {
    if (k + 1 < count) /* prefetch the next cell's blocks, two cache lines each */
      for (int q = 0; q < places_each; ++q)
      {
        const double* next = blocks + 9 * (size_t)places[which[k + 1] * (size_t)places_each + q];
        __builtin_prefetch(next, 1);
        __builtin_prefetch(next + 8, 1);
      }
    const size_t cell = which[k];
    double K[3][3], B[9][MOST_PAIRS];
    mapping((const double(*)[3])(corners + 12 * cell), K);
    stiffness(pairs, S, K, lambda[region[cell]], mu[region[cell]], B);
    hold(points, dofs + points * cell, free, B);
    scatter(points, places + places_each * cell, B, blocks);
  }
}

/* The same as a cell kernel for dolfinx, which assembles by itself (the interface is UFCx's).
 *
 * A (3 points, 3 points) of one cell, lame its lambda and mu, x the cell's nodes, corners first.
 */
static void add_cell(int points, const double* S, double* restrict A, const double* lame, const double* x)
{
  double K[3][3], B[9][MOST_PAIRS];
  mapping((const double(*)[3])x, K);
  stiffness(points * (points + 1) / 2, S, K, lame[0], lame[1], B);
  for (int i = 0, p = 0; i < points; ++i)
    for (int j = i; j < points; ++j, ++p)
      for (int s = 0; s < 3; ++s)
        for (int r = 0; r < 3; ++r)
        {
          A[(3 * i + r) * 3 * points + 3 * j + s] += B[3 * s + r][p];
          if (i != j)
            A[(3 * j + s) * 3 * points + 3 * i + r] += B[3 * s + r][p];
        }
}

const double *tensors_1, *tensors_2, *tensors_3, *tensors_4; /* S of each degree, to be set before its kernel is used */

/* Lambda and mu are constants c of the form; or, of several regions, functions w that are constant on each cell. */
#define KERNEL(name, points, S, lame)                                                                                  \
  void name(double* restrict A, const double* restrict w, const double* restrict c, const double* restrict x,          \
            const int* restrict entity, const uint8_t* restrict permutation)                                           \
  {                                                                                                                    \
    add_cell(points, S, A, lame, x);                                                                                   \
  }
KERNEL(kernel_1, 4, tensors_1, c)
KERNEL(kernel_2, 10, tensors_2, c)
KERNEL(kernel_3, 20, tensors_3, c)
KERNEL(kernel_4, 35, tensors_4, c)
KERNEL(regions_1, 4, tensors_1, w)
KERNEL(regions_2, 10, tensors_2, w)
KERNEL(regions_3, 20, tensors_3, w)
KERNEL(regions_4, 35, tensors_4, w)
