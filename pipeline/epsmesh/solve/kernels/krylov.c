/* Sums over vectors of a Krylov space, stored in single precision at the addresses `stored`. BLOCK numbers of the double
 * vector stay in the cache while all stored vectors pass. */
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "kernels.h"

enum { BLOCK = 1024 };

/* products[j] = stored_j . x */
void project(int count, int vectors, const uint64_t* stored, const double* x, double* products)
{
  memset(products, 0, (size_t)vectors * sizeof(double));
  for (size_t begin = 0; begin < (size_t)count; begin += BLOCK)
  {
    const size_t end = begin + BLOCK < (size_t)count ? begin + BLOCK : (size_t)count;
    for (int j = 0; j < vectors; ++j)
    {
      const float* v = (const float*)(uintptr_t)stored[j];
      double sums[8] = {0}; /* several, so that they are vectors */
      size_t i = begin;
      for (; i + 8 <= end; i += 8)
        for (int lane = 0; lane < 8; ++lane)
          sums[lane] += (double)v[i + lane] * x[i + lane];
      for (; i < end; ++i)
        sums[0] += (double)v[i] * x[i];
      for (int lane = 0; lane < 8; ++lane)
        products[j] += sums[lane];
    }
  }
}

/* x += sum over j of weights[j] stored_j */
void combine(int count, int vectors, const uint64_t* stored, const double* weights, double* restrict x)
{
  for (size_t begin = 0; begin < (size_t)count; begin += BLOCK)
  {
    const size_t end = begin + BLOCK < (size_t)count ? begin + BLOCK : (size_t)count;
    for (int j = 0; j < vectors; ++j)
    {
      const float* restrict v = (const float*)(uintptr_t)stored[j];
      const double weight = weights[j];
      for (size_t i = begin; i < end; ++i)
        x[i] += weight * (double)v[i];
    }
  }
}
