#include "bench/unguarded_kernels.h"

namespace platen::bench {

UnguardedKernels unguarded_avx512() { return unguarded_full<Avx512>(); }

}  // namespace platen::bench
