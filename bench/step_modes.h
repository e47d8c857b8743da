// The tables of bench_step.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "bench/beds.h"
#include "bench/harness.h"

namespace platen::bench {

struct StepOptions {
  std::vector<std::int64_t> particles;  // empty: the mode's own
  std::vector<int> threads;
  std::vector<std::string> scenes;
  std::vector<InstructionSet> sets;  // empty: the preferred one
  double seconds = 1.0;              // of a block
  std::int64_t steps = 0;            // of a block; 0: from `seconds`
  int warm = 500;                    // steps before anything is timed
  int rounds = 5;
  int batch = 0, unroll = 0;     // 0 = chosen
  double cache = 0.0;            // [MiB]; 0 = chosen
  double skin = 0.0, gap = 0.0;  // of lists, in radii; 0 = chosen
  std::string json;
  std::filesystem::path beds;
};

// What was asked for, or else what a mode takes by itself.
template <class T>
std::vector<T> either(const std::vector<T>& given, std::vector<T> otherwise) {
  return given.empty() ? std::move(otherwise) : given;
}
inline std::vector<InstructionSet> sets_of(const StepOptions& o) { return either(o.sets, {preferred_instruction_set()}); }

BenchEngine engine_of(const StepOptions& options, InstructionSet set, int threads);

// Particles x scenes x instruction sets x threads, through Simulation::advance.
void table_of_steps(const StepOptions& options);
// One thread against the largest of options.threads, in turn: the ratio.
void table_of_threads(const StepOptions& options);
// The full scene against every other one, in turn: what a feature costs.
void table_of_features(const StepOptions& options);
// One thread against the scalar yardstick, in turn. Returns false where their positions differ by 1e-9 R or more after
// 100 steps.
bool table_of_scalar(const StepOptions& options);
// Flow graph, split and fused, against two parallel_for a step, in turn. Returns false where their bits differ.
bool table_of_executors(const StepOptions& options);
// Rain from its start file, 2,000 steps or more, rebuilds included.
void table_of_rain(const StepOptions& options);
// Sorting and listing everything anew: ns per particle, by wall clock and by processor time of all threads.
void table_of_rebuilds(const StepOptions& options);
// Contacts, integration and the rest, and the bytes that they move.
void table_of_phases(const StepOptions& options);
// How the graph would run on more cores, simulated.
void table_of_schedules(const StepOptions& options);
// What the order of a large bed's tasks saves, by count.
void table_of_orders(const StepOptions& options);
// One scene on one bed, one JSON line on standard output: for scripts that run other programs in turn with it.
void one_block(const StepOptions& options, bool rain);

}  // namespace platen::bench
