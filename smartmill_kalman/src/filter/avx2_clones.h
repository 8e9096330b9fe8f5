#pragma once

// Code for the processor in use. Clang, which only analyses this file, requires the attribute on
// declarations.
#ifdef __clang__
#define AVX2_AND_DEFAULT
#else
#define AVX2_AND_DEFAULT __attribute__((target_clones("avx2", "default")))
#endif
