// Runs the jobs of a study as child processes of this program, several at a time.
//
//   done already?   runs/<job>/summary.json has exit_code 0 and runs/<job>/case.toml is the wanted text: kept
//   otherwise       platen run cases/<job>.toml -o runs/<job> --threads N --force, its output in logs/<job>.txt
//   porosity matched    first, up to the settled sample, once the reference's run has come so far and until one is right:
//                   platen run cases/<job>-try1.toml -o tries/<job>/1 --stop-after settle ... (porosity_match.h)
// Jobs that are not timed go first, J at a time, references and the most expensive of each seed first; then the timed ones, alone, in
// the order sizes inside repetitions, so that a slow minute of the machine hits all sizes. A child dies with this
// process, however that ends.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "protocol/study/plan.h"

namespace platen {

enum class JobState { waiting, running, kept, done, failed, stopped };

struct JobOutcome {
  JobState state = JobState::waiting;
  int exit_code = 0;          // of a failed job; the signal's number + 128 where one ended it
  std::string message;        // last line that a failed job printed; warnings of one that is done
  double wall_seconds = 0.0;  // of this process's run of it
  std::optional<double>
      steal_seconds;  // timed jobs: taken by other guests of the machine meanwhile, over all its cores
};

struct StudyProgress {
  std::size_t jobs = 0, finished = 0, failed = 0, running = 0;
  double fraction = 0.0;               // of the expected cost
  double wall_seconds = 0.0;           // since the study was started
  std::optional<double> seconds_left;  // estimated once a job has ended
  std::string newest;                  // name of the job that was started or ended last
};

struct RunnerOptions {
  std::filesystem::path folder;                      // of the study
  std::filesystem::path program = "/proc/self/exe";  // platen
  int jobs = 1;
  std::function<void(const StudyProgress&)> progress;        // several times a second; may be empty
  std::function<void(const Job&, const JobOutcome&)> ended;  // may be empty
  const std::atomic<int>* stop_signal = nullptr;  // non-zero: children are told to stop, the rest is not started
};

std::filesystem::path run_folder(const std::filesystem::path& study_folder, const Job& job);

// Whether a run was made with --reproducible, by its summary.json.
bool made_reproducibly(const nlohmann::json& summary);
// Whether the folder of the job holds its finished run, made with --reproducible where that is wanted (timed: only there). Of a matched job only once its case is known (take_match).
bool is_done(const std::filesystem::path& study_folder, const Job& job);
// Whether the job's folder holds a finished run of another case, or one made without --reproducible where it is wanted, which the job replaces.
bool holds_another(const std::filesystem::path& study_folder, const Job& job);

// One outcome a job; matched jobs get their cases. A failing job does not end the others. Throws OutputError where the study's own files cannot be
// written or no process can be started.
std::vector<JobOutcome> run_jobs(StudyPlan& plan, const RunnerOptions& options);

// Steal time of the machine since it was started, over all cores [s]; empty where /proc/stat does not tell.
std::optional<double> steal_seconds();

}  // namespace platen
