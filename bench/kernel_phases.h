// Phases of the contact kernel one by one, to see what each of them takes.
#pragma once

#include "kernels/kernel_table.h"

namespace platen::bench {

enum class Phase { geometry, active, motion, springs, slips, forces, output };
inline constexpr const char* phase_names[] = {"geometry", "active", "motion", "springs", "slips", "forces", "output"};

// Goes through the whole chunks of a list, every phase once a chunk but `which` `times`.
using PhasePass = void (*)(const PairBatch&, const LawConstants&, Phase which, int times);

struct PhasePasses {
  PhasePass full = nullptr, linear = nullptr;
};

// None for sets other than AVX-512 and AVX2.
PhasePasses phase_passes(InstructionSet set);
PhasePasses phase_passes_avx2();
PhasePasses phase_passes_avx512();

}  // namespace platen::bench
