#include "bench/kernel_phases_impl.h"

namespace platen::bench {

PhasePasses phase_passes_avx512() { return passes_of<Avx512>(); }

}  // namespace platen::bench
