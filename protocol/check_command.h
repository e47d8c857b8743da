// `platen check`: whether a case is right, and what follows from it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/stability.h"
#include "protocol/case_file.h"
#include "protocol/expected_time.h"
#include "protocol/sphere_facts.h"

namespace platen {

// I = (v/H) 2R sqrt(rho/sigma) of a stage that drives the top plate [A34].
struct InertialNumber {
  std::string stage;
  double stress = 0.0;  // [Pa]
  std::string of;       // which stress this is
  double value = 0.0;
};

struct CheckReport {
  SphereFacts spheres;
  double dt = 0.0;                       // [s]
  StepLimits limits;                     // of a dense bed of the smallest spheres
  std::string rule;                      // what rules dt
  std::optional<double> settled_porosity, settled_height;  // estimates [-], [m]; without a box there are none
  std::optional<double> bond_number;     // |f0|/(m g) of the mean sphere; none without gravity
  std::vector<InertialNumber> inertial;
  double memory = 0.0;                   // estimate [bytes]
  std::string scene, instruction_set, why_scene, why_instruction_set;
  int threads = 1;                       // that the engine makes use of
  double particle_steps_per_second = 0.0;  // measured, dense bed; 0: could not be
  std::vector<ExpectedStage> stages;
  std::vector<std::string> notes;
};

// Measures the speed of this machine for about 0.3 s. Throws CaseError for a time step that a run would refuse.
CheckReport check_report(const Case& c, int threads);
std::string check_text(const Case& c, const CheckReport& report);
std::string check_json(const Case& c, const CheckReport& report);

struct CheckCommand {
  std::filesystem::path case_file;
  std::vector<std::string> overrides;  // --set
  std::optional<int> threads;
  bool json = false;
};

// Returns the exit code; throws UsageError, CaseError.
int check_command(const CheckCommand& command);

}  // namespace platen
