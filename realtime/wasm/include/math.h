/* The functions of math.h that the evaluator calls: instructions of WebAssembly, or the page's Math. */
#ifndef EPSMESH_WASM_MATH_H
#define EPSMESH_WASM_MATH_H

#define NAN __builtin_nan("")
#define isfinite(x) __builtin_isfinite(x)
#define sqrt(x) __builtin_sqrt(x)
#define fabs(x) __builtin_fabs(x)
#define fmin(x, y) __builtin_fmin(x, y)

#define IMPORTED(name) __attribute__((import_module("math"), import_name(#name)))
IMPORTED(pow) double pow(double x, double y);
IMPORTED(log) double log(double x);
IMPORTED(tan) double tan(double x);
IMPORTED(exp) double exp(double x);
IMPORTED(expm1) double expm1(double x);
IMPORTED(sin) double sin(double x);
IMPORTED(cos) double cos(double x);
IMPORTED(atan2) double atan2(double y, double x);
IMPORTED(asinh) double asinh(double x);

#endif
