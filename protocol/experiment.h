// The experiment: runs the stages of a case on a Simulation and writes what they give.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/simulation.h"
#include "protocol/case_file.h"
#include "protocol/output.h"
#include "protocol/output/checkpoint_file.h"
#include "protocol/records.h"

namespace platen {

// Exit codes of the program.
enum ExitCode : int {
  exit_done = 0, exit_usage = 2, exit_case = 3, exit_numerical = 4, exit_io = 5, exit_goal = 6, exit_stopped = 75
};

// What a run looks like at the moment; handed out a few times a second.
struct Progress {
  std::string stage;
  int stage_number = 1, stages = 1;   // from 1
  std::int64_t step = 0;
  double time = 0.0;                  // simulated since the run began [s]
  double stage_time = 0.0;            // simulated in this stage [s]
  std::optional<double> fraction;     // of the stage, 0 to 1, where it can be told
  double wall_seconds = 0.0;          // since the run began
  std::optional<double> seconds_left; // of this stage, estimated
  double particle_steps_per_second = 0.0;
  SeriesRow row;                      // the newest sample
};

struct RunOptions {
  int threads = 1;
  bool reproducible = false;
  std::optional<double> max_walltime;     // [s]; then exit_stopped
  std::string stop_after;                 // name of the stage after which the run ends with exit_done
  std::function<void(const Progress&)> progress;            // may be empty
  std::function<void(const StageResult&)> stage_closed;     // may be empty
  const std::atomic<int>* stop_signal = nullptr;            // non-zero: stop soon, exit_stopped
  const std::atomic<int>* checkpoint_signal = nullptr;      // whenever it changes: a checkpoint soon
};

struct RunOutcome {
  int exit_code = exit_done;
  std::string message;                 // why, where exit_code is not 0
  std::vector<StageResult> stages;
  Performance performance;
  std::uint64_t state_hash = 0;
};

// The Simulation of a case before its first stage. Spheres come from the case's table or, for `fill`, are placed by the
// first stage's method (rain: above the bottom plate; growth: between z = 0 and the height of the target porosity).
// The time step is set. Throws RunError.
std::unique_ptr<Simulation> make_simulation(const Case& c, int threads, bool reproducible);

// The Simulation of a checkpoint. Throws OutputError where its kernels are not to be had or it is that of another case.
std::unique_ptr<Simulation> make_simulation(const Case& c, const Checkpoint& from, int threads);

// Time step before contacts exist, and the limits that it comes from [docs/laws.md, "Stability"].
struct FirstStep {
  double dt = 0.0;             // what the run starts with [s]
  StepLimits limits;           // of a dense bed of the smallest spheres
  std::string rule;            // what rules it, for people
};
FirstStep first_step(const Case& c);

// Throws CaseError where a fixed time.step is above 0.9 dt_limit and time.allow_unstable is not set.
void refuse_unstable_step(const Case& c);

// Runs all stages. Failures of the run itself (RunError, stop requests, goals not reached) are in the outcome, with the
// data so far written; OutputError is thrown.
// `from`: where to go on; its folder was reopened with facts_of.
RunOutcome run_experiment(const Case& c, RunFolder& folder, const RunOptions& options, const Checkpoint* from = nullptr);

// What a checkpoint counted on. Throws OutputError.
struct CheckpointFacts {
  std::size_t rows = 0;                // of series.csv
  std::vector<double> frames;          // their times [s]
  std::size_t stage = 0;               // to go on with, from 0
  bool within = false;                 // in the middle of that stage
  std::vector<StageResult> closed;
};
CheckpointFacts facts_of(const Checkpoint& checkpoint);

}  // namespace platen
