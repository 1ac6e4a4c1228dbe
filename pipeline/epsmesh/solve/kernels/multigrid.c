/* A multigrid cycle's loops in single precision. Vectors hold three numbers a point. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>

#include "kernels.h"

/* Invert the diagonal blocks; return the number of singular ones. */
int invert_diagonal(int rows, const float* blocks, float* inverse)
{
  int singular = 0;
  for (int i = 0; i < rows; ++i)
  {
    const float* b = blocks + 9 * (size_t)i;
    const double a = b[0], c = b[1], d = b[2], e = b[4], f = b[5], g = b[8];
    const double A = e * g - f * f, B = d * f - c * g, C = c * f - d * e;
    const double determinant = a * A + c * B + d * C;
    if (!(determinant > 0.0))
      ++singular;
    const double s = 1.0 / determinant;
    float* m = inverse + 9 * (size_t)i;
    m[0] = (float)(s * A);
    m[1] = m[3] = (float)(s * B);
    m[2] = m[6] = (float)(s * C);
    m[4] = (float)(s * (a * g - d * d));
    m[5] = m[7] = (float)(s * (c * d - a * f));
    m[8] = (float)(s * (a * e - c * c));
  }
  return singular;
}

/* d = a d + b D^-1 r, and x += d: a step of Chebyshev's iteration. */
void advance(int rows, const float* restrict inverse, float a, float b, const float* restrict r, float* restrict d,
             float* restrict x)
{
  for (int i = 0; i < rows; ++i)
  {
    const float* m = inverse + 9 * (size_t)i;
    const float r0 = r[3 * i], r1 = r[3 * i + 1], r2 = r[3 * i + 2];
    const float d0 = a * d[3 * i] + b * (m[0] * r0 + m[1] * r1 + m[2] * r2);
    const float d1 = a * d[3 * i + 1] + b * (m[3] * r0 + m[4] * r1 + m[5] * r2);
    const float d2 = a * d[3 * i + 2] + b * (m[6] * r0 + m[7] * r1 + m[8] * r2);
    d[3 * i] = d0;
    d[3 * i + 1] = d1;
    d[3 * i + 2] = d2;
    x[3 * i] += d0;
    x[3 * i + 1] += d1;
    x[3 * i + 2] += d2;
  }
}

/* r -= q */
void subtract(int count, const float* restrict q, float* restrict r)
{
  for (int i = 0; i < count; ++i)
    r[i] -= q[i];
}

double dot(int count, const float* x, const float* y)
{
  double sum = 0.0;
  for (int i = 0; i < count; ++i)
    sum += (double)x[i] * (double)y[i];
  return sum;
}

/* For each owned point the last cell that has it, and its position in that cell: dofs (cells, width). */
void find_places(int cells, int width, const int* dofs, int owned, int* cell, uint8_t* position)
{
  for (int c = 0; c < cells; ++c)
    for (int i = 0; i < width; ++i)
    {
      const int point = dofs[(size_t)width * c + i];
      if (point < owned)
      {
        cell[point] = c;
        position[point] = (uint8_t)i;
      }
    }
}

/* x += P e by points; fine numbers that are not free are not written. Row i of P has the weights of its position in a
 * fine cell, offsets[position[i]] and so on; columns are positions in the coarse cell, whose points are (cells, width). */
void prolong(int rows, const int* cell, const uint8_t* position, int width, const int* points, const int* offsets,
             const int* columns, const float* weights, const float* free, const float* e, float* x)
{
  for (int i = 0; i < rows; ++i)
  {
    const int* at = points + (size_t)width * cell[i];
    float s0 = 0, s1 = 0, s2 = 0;
    for (int k = offsets[position[i]]; k < offsets[position[i] + 1]; ++k)
    {
      const size_t j = 3 * (size_t)at[columns[k]];
      s0 += weights[k] * e[j];
      s1 += weights[k] * e[j + 1];
      s2 += weights[k] * e[j + 2];
    }
    const size_t here = 3 * (size_t)i;
    x[here] += free[here] * s0;
    x[here + 1] += free[here + 1] * s1;
    x[here + 2] += free[here + 2] * s2;
  }
}

/* g += P^T r */
void restrict_to(int rows, const int* cell, const uint8_t* position, int width, const int* points, const int* offsets,
                 const int* columns, const float* weights, const float* free, const float* r, float* g)
{
  for (int i = 0; i < rows; ++i)
  {
    const int* at = points + (size_t)width * cell[i];
    const size_t here = 3 * (size_t)i;
    const float r0 = free[here] * r[here];
    const float r1 = free[here + 1] * r[here + 1];
    const float r2 = free[here + 2] * r[here + 2];
    for (int k = offsets[position[i]]; k < offsets[position[i] + 1]; ++k)
    {
      const size_t j = 3 * (size_t)at[columns[k]];
      g[j] += weights[k] * r0;
      g[j + 1] += weights[k] * r1;
      g[j + 2] += weights[k] * r2;
    }
  }
}

/* The same where P is the mean of two ends, (rows, 2), or the identity where they are one. */
void prolong_on_edges(int rows, const int* ends, const float* restrict free, const float* restrict e, float* restrict x)
{
  for (int i = 0; i < rows; ++i)
  {
    const float *a = e + 3 * (size_t)ends[2 * i], *b = e + 3 * (size_t)ends[2 * i + 1];
    const size_t here = 3 * (size_t)i;
    for (int c = 0; c < 3; ++c)
      x[here + c] += free[here + c] * (0.5f * a[c] + 0.5f * b[c]);
  }
}

void restrict_from_edges(int rows, const int* ends, const float* restrict free, const float* restrict r,
                         float* restrict g)
{
  for (int i = 0; i < rows; ++i)
  {
    float *a = g + 3 * (size_t)ends[2 * i], *b = g + 3 * (size_t)ends[2 * i + 1];
    const size_t here = 3 * (size_t)i;
    const float weight = a == b ? 1.0f : 0.5f;
    for (int c = 0; c < 3; ++c)
    {
      const float part = weight * (free[here + c] * r[here + c]);
      a[c] += part;
      if (a != b)
        b[c] += part;
    }
  }
}

/* The largest magnitude of x. */
double largest(int count, const double* x)
{
  double most = 0.0;
  for (int i = 0; i < count; ++i)
    most = fabs(x[i]) > most ? fabs(x[i]) : most;
  return most;
}

/* y = s x */
void to_single(int count, double scale, const double* x, float* y)
{
  for (int i = 0; i < count; ++i)
    y[i] = (float)(scale * x[i]);
}

/* y = s x */
void to_double(int count, double scale, const float* x, double* y)
{
  for (int i = 0; i < count; ++i)
    y[i] = scale * (double)x[i];
}
