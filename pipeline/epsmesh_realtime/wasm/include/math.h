/* The functions of math.h that the evaluator calls: instructions of WebAssembly, or the page's Math. */
#ifndef EPSMESH_WASM_MATH_H
#define EPSMESH_WASM_MATH_H

#define NAN __builtin_nan("")
#define HUGE_VAL __builtin_huge_val()
#define isfinite(x) __builtin_isfinite(x)
#define sqrt(x) __builtin_sqrt(x)
#define fabs(x) __builtin_fabs(x)
#define ceil(x) __builtin_ceil(x)

double acosh(double x);
double asin(double x);
double cos(double x);
double exp(double x);
double expm1(double x);
double log(double x);
double pow(double x, double y);
double sin(double x);
double tan(double x);

#endif
