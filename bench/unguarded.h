// Kernels of the full scene without their guards, to measure what the guards cost.
#pragma once

#include "kernels/kernel_table.h"

namespace platen::bench {

struct UnguardedKernels {
  decltype(KernelTable::contacts) contacts = nullptr;
  decltype(KernelTable::motion) motion = nullptr;
};

// None for sets other than AVX-512 and AVX2.
UnguardedKernels unguarded_kernels(InstructionSet set);
UnguardedKernels unguarded_avx2();
UnguardedKernels unguarded_avx512();

}  // namespace platen::bench
