// What a run reports: rows of the series and results of stages. Written by output.cpp, filled by experiment.cpp.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "core/measures.h"
#include "core/stress_tensor.h"
#include "protocol/case_file.h"

namespace platen {

struct SeriesRow {
  std::string stage;                                            // stage name
  double strain = std::numeric_limits<double>::quiet_NaN();     // NaN until its zero is known
  double inertial_number = 0.0;
  double kinetic_to_potential = 0.0;
  Measures measures;
};

// The time step in a stage and the limits that were found meanwhile, smallest ones [s]; infinite where none were.
struct StepRange {
  double smallest = std::numeric_limits<double>::infinity(), largest = 0.0;
  double dt_crit = std::numeric_limits<double>::infinity(), dt_limit = std::numeric_limits<double>::infinity();
  double largest_share = 0.0;  // of the step over the limit of the same moment, as they were found
  std::string ruled_by;  // contact that rules at the end of the stage; empty without contacts
};

struct StageResult {
  std::string name;
  StageKind kind = StageKind::run;
  std::string end_reason;              // e.g. "stress 40 kPa reached"
  bool reached = true;                 // false: max_duration came first (exit 6)
  std::int64_t first_step = 0, last_step = 0;
  double time_begin = 0.0, time_end = 0.0;   // simulated [s]
  double wall_seconds = 0.0;
  std::int64_t particles = 0;
  std::optional<double> strain_zero_height;  // height at which strain is 0 [m]
  std::optional<double> strength;            // largest 5 ms mean of stress_top [Pa], crush only
  std::optional<double> strength_strain;
  std::optional<double> initial_stiffness;   // [Pa]
  std::optional<bool> peak_found;
  StepRange time_step;
  double residual_share = std::numeric_limits<double>::quiet_NaN();  // change of the ledger's residual over what the stage dissipated
                                             // (at least 1 % of all so far); NaN without a ledger or an end
  std::optional<BedStress> bed;              // mean stress and fabric at the end; none where there is no volume
  std::vector<std::string> warnings;
  SeriesRow last;                            // the stage's last row
};

struct Performance {
  int threads = 1;
  std::string instruction_set, scene;
  bool reproducible = false;  // operations that are the same on every instruction set
  std::int64_t particle_steps = 0;
  double wall_seconds = 0.0;
  std::int64_t rebuilds = 0, prunes = 0;
  std::int64_t redone_steps = 0;  // steps done twice because lists did not hold
};

}  // namespace platen
