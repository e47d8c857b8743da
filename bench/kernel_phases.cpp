#include "bench/kernel_phases.h"

namespace platen::bench {

PhasePasses phase_passes(InstructionSet set) {
  switch (set) {
    case InstructionSet::avx2: return phase_passes_avx2();
    case InstructionSet::avx512: return phase_passes_avx512();
    default: return {};
  }
}

}  // namespace platen::bench
