// What an export needs of a run: the spheres at the end of each closed stage, and the contacts of the last one.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/snapshot.h"

namespace platen {

struct StageState {
  std::string name;
  std::int64_t step = 0;
  double time = 0.0;            // [s]
  double z_bottom = 0.0, z_top = 0.0;  // [m]
  bool sides_open = false;      // after `release`
  ParticleFields particles;
  std::vector<double> density;  // of each sphere [kg/m3]; empty where it is not known: unequal ones in files of older versions
};

struct RunStates {
  std::string title;
  double width = 0.0, depth = 0.0;  // of the box [m]; 0 where there is none
  bool periodic = false;
  std::vector<StageState> stages;   // at least one, in the order of the run
  ContactFields contacts;       // at the end of the last stage; empty with output.contacts = false
};

// Throws OutputError for a folder without results.h5 or without closed stages, CaseError for a damaged case.toml.
RunStates run_states(const std::filesystem::path& folder);

}  // namespace platen
