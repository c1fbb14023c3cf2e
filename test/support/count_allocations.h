/// Counts what each thread of the test program allocates: malloc itself, so that Eigen's and the C
/// library's own calls are seen, too. To be included by one file of the program.
#pragma once

#include <cstddef>

namespace {
[[maybe_unused]] thread_local long allocations = 0;
[[maybe_unused]] thread_local bool counting = true;
}  // namespace

// Sanitizers bring a malloc of their own, which cannot be counted.
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define VARIATOR_SIM_COUNTS_ALLOCATIONS
extern "C" {
void* __libc_malloc(std::size_t size);                 // NOLINT
void* __libc_calloc(std::size_t n, std::size_t size);  // NOLINT
void* __libc_realloc(void* block, std::size_t size);   // NOLINT

void* malloc(std::size_t size) {
  if (counting) ++allocations;
  return __libc_malloc(size);
}
void* calloc(std::size_t n, std::size_t size) {
  if (counting) ++allocations;
  return __libc_calloc(n, size);
}
void* realloc(void* block, std::size_t size) {
  if (counting) ++allocations;
  return __libc_realloc(block, size);
}
}
#endif
