// Checkpoints: all that a run needs to go on with the same bits, in one file that is either whole or refused.
//
//   checkpoint.h5       the newest one
//   checkpoint.prev.h5  the one before
//   checkpoint.new, checkpoint.body   while one is written
//
// HDF5 (groups spheres, pairs, plates, planes, totals) with the state of the experiment as JSON text; behind the HDF5 content
// a line with the XXH3 of all bytes before it, which HDF5 readers do not mind.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "core/simulation_state.h"

namespace platen {

struct Checkpoint {
  SimulationState bed;
  std::vector<double> density;     // by rank [kg/m3]; one number where all are equal
  std::string case_text;
  std::string start_time;          // of the run, ISO 8601
  std::string experiment;          // where the stages stand, JSON
  std::string instruction_set;
  bool reproducible = false;
};

// Writes checkpoint.h5; what was there becomes checkpoint.prev.h5. Throws OutputError, the former ones stay then.
void write_checkpoint(const std::filesystem::path& folder, const Checkpoint& checkpoint);

// Whether the bytes of a file are those that were written: the line at their end tells.
bool checkpoint_is_whole(std::string_view bytes);

// Throws OutputError for a file that is not there, damaged in any bit, or of another version.
Checkpoint read_checkpoint(const std::filesystem::path& file);

bool has_checkpoint(const std::filesystem::path& folder);  // whole or not

// The newest whole checkpoint of a folder; `passed_over` says what was wrong with newer ones. Throws OutputError where there
// is none.
Checkpoint newest_checkpoint(const std::filesystem::path& folder, std::string& passed_over);

void remove_checkpoints(const std::filesystem::path& folder);

}  // namespace platen
