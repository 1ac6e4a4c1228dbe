/* Functions called from Python; cffi reads this file. */

/* assembly.c: matrices of straight cells */
void find_entries(int rows, int width, const int* dofs, const int* offsets, const int* columns, const int* first_visit,
                  const int* visits, int* entry, int* places);
void add_stiffness(int count, const int* which, int points, const double* corners, const int* dofs, const int* places,
                   const double* S, const double* free, const int* region, const double* lambda, const double* mu,
                   double* blocks);
extern const double *tensors_1, *tensors_2, *tensors_3, *tensors_4;
void kernel_1(double* A, const double* w, const double* c, const double* x, const int* l, const uint8_t* p);
void kernel_2(double* A, const double* w, const double* c, const double* x, const int* l, const uint8_t* p);
void kernel_3(double* A, const double* w, const double* c, const double* x, const int* l, const uint8_t* p);
void kernel_4(double* A, const double* w, const double* c, const double* x, const int* l, const uint8_t* p);
void regions_1(double* A, const double* w, const double* c, const double* x, const int* l, const uint8_t* p);
void regions_2(double* A, const double* w, const double* c, const double* x, const int* l, const uint8_t* p);
void regions_3(double* A, const double* w, const double* c, const double* x, const int* l, const uint8_t* p);
void regions_4(double* A, const double* w, const double* c, const double* x, const int* l, const uint8_t* p);

/* product.c: the stiffness of straight cells */
void map_cells(int count, const int* which, const double* corners, double* maps);
void add_diagonal(int count, int points, const int* dofs, const double* maps, const double* lame, const double* S,
                  float* diagonal);
void add_product(int degree, int batches, const int* dofs, const float* maps, const float* lame, const int* first,
                 const int* column, const float* weight, const int* first_back, const int* column_back,
                 const float* weight_back, const int* raised, const float* mass, const float* x, float* y);
void add_product_double(int degree, int batches, const int* dofs, const double* maps, const double* lame,
                        const int* first, const int* column, const double* weight, const int* first_back,
                        const int* column_back, const double* weight_back, const int* raised, const double* mass,
                        const double* x, double* y);

/* curved.c: the stiffness of curved cells */
void map_curved(int count, int width, int quadrature, const double* nodes, const double* gradients,
                const double* weights, double* maps, double* roots);
void add_curved_diagonal(int points, int quadrature, int batches, const int* dofs, const double* maps,
                         const double* lame, const double* signs, const double* gradients, float* diagonal);
void add_curved(int points, int quadrature, int batches, const int* dofs, const float* maps, const float* lame,
                const float* signs, const float* gradients, const float* x, float* y);
void add_curved_double(int points, int quadrature, int batches, const int* dofs, const double* maps,
                       const double* lame, const double* signs, const double* gradients, const double* x, double* y);

/* pressure.c: the blocks of mixed elements */
void add_mass(int count, int batches, const int* pressures, const double* roots, const double* mass, const double* x,
              double* y);
void add_curved_mass(int count, int quadrature, int batches, const int* pressures, const double* roots,
                     const double* signs, const double* values, const double* x, double* y);
void add_dilation(int points, int count, int batches, const int* dofs, const int* pressures, const double* maps,
                  const double* roots, const int* first, const int* column, const double* weight,
                  const int* first_back, const int* column_back, const double* weight_back, const int* raised,
                  const double* mass, const double* x, double* y);
void add_pull(int points, int count, int batches, const int* dofs, const int* pressures, const double* maps,
              const double* roots, const int* first, const int* column, const double* weight,
              const int* first_back, const int* column_back, const double* weight_back, const int* raised,
              const double* mass, const double* x, double* y);
void add_curved_dilation(int points, int count, int quadrature, int batches, const int* dofs, const int* pressures,
                         const double* maps, const double* roots, const double* signs, const double* gradients,
                         const double* values, const double* x, double* y);
void add_curved_pull(int points, int count, int quadrature, int batches, const int* dofs, const int* pressures,
                     const double* maps, const double* roots, const double* signs, const double* gradients,
                     const double* values, const double* x, double* y);

/* multigrid.c: a cycle in single precision */
int invert_diagonal(int rows, const float* blocks, float* inverse);
void advance(int rows, const float* inverse, float a, float b, const float* r, float* d, float* x);
void subtract(int count, const float* q, float* r);
double dot(int count, const float* x, const float* y);
void find_places(int cells, int width, const int* dofs, int owned, int* cell, uint8_t* position);
void prolong(int rows, const int* cell, const uint8_t* position, int width, const int* points, const int* offsets,
             const int* columns, const float* weights, const float* free, const float* e, float* x);
void restrict_to(int rows, const int* cell, const uint8_t* position, int width, const int* points, const int* offsets,
                 const int* columns, const float* weights, const float* free, const float* r, float* g);
void prolong_on_edges(int rows, const int* ends, const float* free, const float* e, float* x);
void restrict_from_edges(int rows, const int* ends, const float* free, const float* r, float* g);
double largest(int count, const double* x);
void to_single(int count, double scale, const double* x, float* y);
void to_double(int count, double scale, const float* x, double* y);

/* krylov.c: vectors of a Krylov space in single precision */
void project(int count, int vectors, const uint64_t* stored, const double* x, double* products);
void combine(int count, int vectors, const uint64_t* stored, const double* weights, double* x);

/* tangent.c: the tangent at large displacements */
void evaluate_moduli(int cells, int points, int quadrature, const int* dofs, const double* maps, const double* roots,
                     int step, const double* factors, const double* gradients, const double* u, int count,
                     const int* pressures, const double* values, const double* p, const int* region,
                     const uint64_t* kernels, const int* positions, const double* constants, int most, int outputs,
                     float* found);
void add_tangent_diagonal(int points, int quadrature, int batches, const int* dofs, const double* maps, int step,
                          const double* gradients, const float* moduli, float* diagonal);
void add_tangent_dilation(int points, int quadrature, int batches, const int* dofs, const double* maps, int step,
                          const double* gradients, const float* coupling, int count, const int* pressures,
                          const double* values, const double* x, double* y);
void add_tangent_pull(int points, int quadrature, int batches, const int* dofs, const double* maps, int step,
                      const double* gradients, const float* coupling, int count, const int* pressures,
                      const double* values, const double* x, double* y);
void add_tangent(int points, int quadrature, int batches, const int* dofs, const float* maps, int step,
                 const float* gradients, const float* moduli, const float* x, float* y);
void add_tangent_double(int points, int quadrature, int batches, const int* dofs, const double* maps, int step,
                        const double* gradients, const float* moduli, const double* x, double* y);
