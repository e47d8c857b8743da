#include "kernels/kernel_table.h"

#include <cstdlib>
#include <cstring>
#include <stdexcept>

namespace platen {

KernelTable kernels_scalar(const KernelRequest& request);
KernelTable kernels_avx2(const KernelRequest& request);
KernelTable kernels_avx512(const KernelRequest& request);

const char* to_string(InstructionSet set) {
  switch (set) {
    case InstructionSet::scalar: return "scalar";
    case InstructionSet::avx2: return "avx2";
    case InstructionSet::avx512: return "avx512";
  }
  return "?";
}

std::vector<InstructionSet> available_instruction_sets() {
  // __builtin_cpu_supports also asks the operating system (XGETBV) whether it keeps the wide registers.
  std::vector<InstructionSet> sets = {InstructionSet::scalar};
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) sets.push_back(InstructionSet::avx2);
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl") &&
      __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("fma"))
    sets.push_back(InstructionSet::avx512);
  return sets;
}

InstructionSet preferred_instruction_set() {
  const auto sets = available_instruction_sets();
  const char* forced = std::getenv("PLATEN_ISA");
  if (forced == nullptr || *forced == '\0') return sets.back();
  std::string known;
  for (const InstructionSet set : sets) {
    if (std::strcmp(forced, to_string(set)) == 0) return set;
    known += std::string(known.empty() ? "" : ", ") + to_string(set);
  }
  throw std::invalid_argument("PLATEN_ISA=" + std::string(forced) + ": this processor has " + known);
}

KernelTable choose_kernels(InstructionSet set, const KernelRequest& asked) {
  KernelRequest request = asked;
  if (request.scene < 0) request.scene = cheapest_scene(request.needed);
  switch (set) {
    case InstructionSet::avx2: return kernels_avx2(request);
    case InstructionSet::avx512: return kernels_avx512(request);
    case InstructionSet::scalar: break;
  }
  return kernels_scalar(request);
}

}  // namespace platen
