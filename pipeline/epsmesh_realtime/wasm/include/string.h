/* The functions of string.h that the evaluator and a compiler call; wasm.c defines them. */
#ifndef EPSMESH_WASM_STRING_H
#define EPSMESH_WASM_STRING_H

#include <stddef.h>

int memcmp(const void *a, const void *b, size_t size);
void *memcpy(void *to, const void *from, size_t size);
void *memset(void *to, int byte, size_t size);
size_t strlen(const char *text);

#endif
