#include "bench/unguarded_kernels.h"

namespace platen::bench {

UnguardedKernels unguarded_avx2() { return unguarded_full<Avx2>(); }

}  // namespace platen::bench
