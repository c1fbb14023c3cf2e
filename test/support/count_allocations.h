/// Counts calls of malloc in the whole test program. To be included by one file of it.
#pragma once

#include <atomic>
#include <cstddef>

// Sanitizers bring a malloc of their own, which cannot be counted.
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define VARIATOR_SIM_COUNTS_ALLOCATIONS
namespace {
std::atomic<long> allocations{0};
}

extern "C" {
void* __libc_malloc(std::size_t size);  // NOLINT

void* malloc(std::size_t size) {
  ++allocations;
  return __libc_malloc(size);
}
}
#endif
