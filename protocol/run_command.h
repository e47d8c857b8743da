// `platen run`: a case from its file to a run folder; `platen resume`: a run that was interrupted, on to its end.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "protocol/case_file.h"

namespace platen {

struct RunCommand {
  std::filesystem::path case_file;
  std::filesystem::path folder;         // empty: runs/<stem of the case file>, with the next free number
  std::vector<std::string> overrides;   // --set
  std::optional<std::filesystem::path> from;  // run folder to begin with instead of the first stage
  std::optional<int> threads;           // default: usable_cores()
  std::optional<double> max_walltime;   // [s]
  std::string stop_after;               // stage by name, or by number from 1
  bool reproducible = false;
  bool force = false;                   // replace a run that is in the folder
  bool report = true;                   // report.html at the end
  bool json = false;                    // the summary as JSON on standard output instead of the table
  bool quiet = false;                   // nothing but errors
};

// A duration as users write it: "90 s", "10 min", "2 h" or plain seconds, > 0. Throws UsageError.
double parse_walltime(const std::string& text);

// runs/<stem>, or with -2, -3 ... where that is taken.
std::filesystem::path free_run_folder(const std::filesystem::path& case_file);

// The name of the stage that `text` means; throws UsageError naming all stages.
std::string stage_named(const Case& c, const std::string& text);

// Returns the exit code. Throws UsageError and CaseError before anything is written, OutputError.
int run_command(const RunCommand& command);

struct ResumeCommand {
  std::filesystem::path folder;
  std::vector<std::string> overrides;   // --set: max_duration of stages that are not over
  std::optional<int> threads;           // default: usable_cores()
  std::optional<double> max_walltime;   // [s]
  std::string stop_after;
  bool report = true, json = false, quiet = false;  // as of RunCommand
};

// Goes on with a run that was stopped or killed, from its newest whole checkpoint. A run of which all stages are done is left
// alone, exit code 0. Throws UsageError, CaseError for a case that was changed, OutputError.
int resume_command(const ResumeCommand& command);

}  // namespace platen
