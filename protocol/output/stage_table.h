// Tables of stages for people: at the end of a run and in `platen info`.
#pragma once

#include <limits>
#include <string>
#include <vector>

namespace platen {

// One stage, SI units; NaN = nothing to show.
struct StageLine {
  static constexpr double none = std::numeric_limits<double>::quiet_NaN();
  std::string name, end_reason;
  double time = none;                 // simulated in the stage [s]
  double stress_top = none;           // [Pa]
  double strain = none;               // [-]
  double porosity = none;             // [-]
  double coordination_number = none;  // [-]
  double wall_seconds = none;         // [s]; a table without any has no such column
  double strength = none;             // [Pa]
  double strength_strain = none;      // [-]
  double initial_stiffness = none;    // [Pa]
  bool peak_found = false;
  std::vector<std::string> warnings;
};

// At most 100 columns wide, ends with a newline: one line per stage, then strengths, then warnings.
std::string stage_table(const std::vector<StageLine>& stages);

}  // namespace platen
