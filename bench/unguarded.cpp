#include "bench/unguarded.h"

namespace platen::bench {

UnguardedKernels unguarded_kernels(InstructionSet set) {
  switch (set) {
    case InstructionSet::avx2: return unguarded_avx2();
    case InstructionSet::avx512: return unguarded_avx512();
    default: return {};
  }
}

}  // namespace platen::bench
