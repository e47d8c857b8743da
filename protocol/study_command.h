// `platen study`: many runs, one question: how far is each scaled sample from the reference?
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace platen {

struct StudyCommand {
  std::filesystem::path study_file;
  std::filesystem::path folder;        // of the results; taken up again where it holds the same study
  std::vector<std::string> overrides;  // --set, of the study: study.seeds=[1,2,3]
  std::optional<int> jobs;             // runs at a time; default: usable_cores()
  bool reproducible = false;           // all runs: the same bits on every instruction set
  bool dry_run = false;                // print the runs and end
  bool quiet = false;
};

// Returns the exit code: 0, that of the first run that failed (6 where a signal ended it), 75 when stopped by request.
// Throws CaseError before anything is written, OutputError.
int study_command(const StudyCommand& command);

}  // namespace platen
