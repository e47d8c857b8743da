#include "bench/kernel_phases_impl.h"

namespace platen::bench {

PhasePasses phase_passes_avx2() { return passes_of<Avx2>(); }

}  // namespace platen::bench
