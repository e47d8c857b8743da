// How fast the machine is at the moment, measured by loops that have nothing to do with platen. Servers and their
// hypervisors move between a fast and a slow state that differ by a third; a figure without the state it was measured
// in cannot be compared with another one.
#pragma once

#include <nlohmann/json.hpp>

#include "kernels/kernel_table.h"

namespace platen::bench {

struct ReferenceLoops {
  double fma = 0.0;  // fused multiply-adds of independent registers, two operations each [Gflop/s], one core
  double l2 = 0.0;   // reading an array of half the second-level cache [GB/s], one core
  double l3 = 0.0;   // reading an array of a quarter of the third-level cache, at most 16 MiB [GB/s], one core
  double cores = 0.0;  // one cache line there and back between two cores [ns]; 0 where there is one core
};

// Each loop takes about `seconds`, the best of five parts of it. The set must be one the processor has.
ReferenceLoops reference_loops(InstructionSet set, double seconds = 0.02);

// Adds "fma", "l2", "l3", "cores" to a row, and "state": fma now over the largest fma seen in this process with this set, which
// is 1 while the machine stays in its fast state.
void add_reference(nlohmann::json& row, InstructionSet set);

}  // namespace platen::bench
