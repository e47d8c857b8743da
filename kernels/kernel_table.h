// The kernels of one run: chosen once, for an instruction set and a scene, then called through pointers.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene.h"
#include "kernels/views.h"

namespace platen {

enum class InstructionSet { scalar, avx2, avx512 };

struct KernelTable {
  void (*contacts)(const PairBatch&, const LawConstants&, PairTotals&) noexcept = nullptr;
  void (*plates)(const PlateBatch&, const Plane&, const PlateConstants&, PlateTotals&) noexcept = nullptr;
  void (*motion)(const MotionBatch&, const MotionConstants&, MotionTotals&) noexcept = nullptr;
  void (*merge)(const SharesBatch&) noexcept = nullptr;
  int (*search)(const SearchMembers&, const SearchRange*, int count, const SearchedSphere&, std::int32_t* found) noexcept = nullptr;
  void (*choose)(const ChooseBatch&) noexcept = nullptr;
  void (*look)(const LookBatch&, const LookConstants&, LookTotals&) noexcept = nullptr;
  void (*settle)(const SettleBatch&, const LookConstants&) noexcept = nullptr;
  InstructionSet instruction_set = InstructionSet::scalar;
  int scene = 0;             // index into built_scenes
  bool stages = false;       // contacts need PairBatch::stage where rows alone hold the state
  bool energy = true;        // sums of the ledger are formed
  bool reproducible = false; // IEEE operations only: the same bits on every instruction set
};

struct KernelRequest {
  SceneTraits needed;
  bool rolling = false;       // pairs or plates have rolling friction
  bool reproducible = false;
  int scene = -1;             // a scene of the list by number; -1: the cheapest that covers `needed`
};

// Instruction sets that this processor and this build have, best last.
std::vector<InstructionSet> available_instruction_sets();

// The best one, or the one that the environment variable PLATEN_ISA (scalar, avx2, avx512) forces.
// Throws std::invalid_argument if that is unknown or not to be had.
InstructionSet preferred_instruction_set();

KernelTable choose_kernels(InstructionSet set, const KernelRequest& request);

const char* to_string(InstructionSet set);

}  // namespace platen
