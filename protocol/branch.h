// A run that begins with the bed of another one: `platen run --from`. What both have in common is taken over, file by file.
#pragma once

#include <filesystem>
#include <string>

#include "protocol/case_file.h"
#include "protocol/experiment.h"
#include "protocol/output/checkpoint_file.h"

namespace platen {

// Throws CaseError, one line for each thing in which the case `c` is another than that of the run whose checkpoint this is: seed, particles, plates, box,
// environment, engine, time, output.energy, and the first `stages` stages (how often they write frames aside). Title, output and later stages are free.
void refuse_other_history(const Case& c, const Checkpoint& checkpoint, std::size_t stages, const std::filesystem::path& run);

// Puts what a run wrote up to its checkpoint into the folder of another one, where `reopen` can take it up, and a checkpoint
// that goes on with `case_text`. Throws OutputError.
void copy_history(const std::filesystem::path& run, const Checkpoint& checkpoint, const std::filesystem::path& folder, const std::string& case_text,
                  const std::string& start_time);

}  // namespace platen
