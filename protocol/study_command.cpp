#include "protocol/study_command.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <set>
#include <thread>

#include "protocol/experiment.h"
#include "protocol/output/files.h"
#include "protocol/progress.h"
#include "protocol/stop_signals.h"
#include "protocol/study/analysis.h"
#include "protocol/study/figures.h"
#include "protocol/study/plan.h"
#include "protocol/study/porosity_match.h"
#include "protocol/study/runner.h"
#include "protocol/study/statements.h"
#include "protocol/study/study_file.h"
#include "protocol/study/tables.h"
#include "protocol/usable_cores.h"

namespace platen {
namespace {

namespace fs = std::filesystem;

void print(const std::string& text) { std::fwrite(text.data(), 1, text.size(), stdout); }

std::string plan_table(const StudyPlan& plan, const fs::path& folder) {
  std::string out;
  for (Job job : plan.jobs) {
    if (job.match) take_match(job, match_state(plan, job, folder));
    out += fmt::format("{:<60} {:>8} spheres{}{}{}\n", job.name, job.c.particles.count, job.timed ? ", timed" : "",
                       job.match ? ", as porous as " + plan.jobs[job.match->reference].name : "", is_done(folder, job) ? ", done" : holds_another(folder, job) ? ", to be made anew" : "");
  }
  return out;
}

// Whether the process whose number is in the file lives. Also yes where there is none.
bool alive(int file) {
  char text[32] = "";
  if (::pread(file, text, sizeof text - 1, 0) <= 0) return true;
  const long process = std::strtol(text, nullptr, 10);
  return process <= 0 || ::kill(static_cast<pid_t>(process), 0) == 0 || errno != ESRCH;
}

// Keeps a second study out of the folder; falls with the process.
UniqueFd lock(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw OutputError(folder.string() + ": cannot write: " + error.message());
  const fs::path file = folder / ".lock";
  UniqueFd fd(::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666));
  if (fd.get() < 0) throw system_error(file, "cannot open", errno);
  // A child of a study that was killed just now holds the lock until it begins the run, which it then does not begin. That
  // takes long where the machine is busy, so a study that lives is told from one that does not by its number in the file.
  for (int k = 0; ::flock(fd.get(), LOCK_EX | LOCK_NB) != 0; ++k) {
    if (errno != EWOULDBLOCK) throw system_error(file, "cannot lock", errno);
    if (k >= 200 && (k == 3000 || alive(fd.get()))) throw OutputError(folder.string() + ": another process works in this folder");
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  const std::string own = std::to_string(::getpid()) + "\n";
  if (::ftruncate(fd.get(), 0) != 0 || ::pwrite(fd.get(), own.data(), own.size(), 0) < 0) errno = 0;  // the lock works without it
  return fd;
}

// A folder without a study.toml of ours must be empty: nobody's files are mixed with ours.
void refuse_foreign_folder(const fs::path& folder) {
  std::error_code ignored;
  if (!fs::exists(folder, ignored) || fs::exists(folder / "study.toml", ignored)) return;
  if (!fs::is_directory(folder, ignored)) throw OutputError(folder.string() + ": is not a folder");
  // Killed in its first moments a study leaves the unfinished study.toml.
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.path().filename() != ".lock" && entry.path().filename() != temporary_name("study.toml"))
      throw OutputError(folder.string() + ": is not empty and holds no study; choose another folder (-o)");
}

// One line, in place on a terminal; elsewhere once a minute.
class StudyPrinter {
 public:
  explicit StudyPrinter(ProgressPrinter::Style style) : style_(style) {}
  void update(const StudyProgress& p) {
    if (style_ == ProgressPrinter::Style::quiet || p.wall_seconds < next_) return;
    const bool in_place = style_ == ProgressPrinter::Style::in_place;
    next_ = p.wall_seconds + (in_place ? 0.2 : 60.0);
    std::string line =
        fmt::format("{} of {} runs done, {} running, {:.0f} %", p.finished, p.jobs, p.running, 100.0 * p.fraction);
    if (p.failed > 0) line += fmt::format(", {} failed", p.failed);
    if (p.seconds_left) line += fmt::format(", {} left", duration_text(*p.seconds_left));
    if (p.running > 0) line += ", " + p.newest;
    std::fputs((in_place ? "\r" + line.substr(0, 79) + "\x1b[K" : line + "\n").c_str(), stderr);
    std::fflush(stderr);
    shown_ = in_place;
  }
  void clear() {
    if (shown_) std::fputs("\r\x1b[K", stderr);
    shown_ = false;
  }

 private:
  ProgressPrinter::Style style_;
  double next_ = 0.0;
  bool shown_ = false;
};

// "2 at a time", "one at a time", or both where some runs are timed.
std::string runs_at_a_time(const StudyPlan& plan, int jobs) {
  const auto timed = static_cast<std::size_t>(std::count_if(plan.jobs.begin(), plan.jobs.end(), [](const Job& job) { return job.timed; }));
  if (jobs == 1 || timed == plan.jobs.size()) return "one at a time";
  return fmt::format("{} at a time", jobs) + (timed > 0 ? fmt::format(", then {} timed ones one at a time", timed) : "");
}

int exit_code_of(const std::vector<JobOutcome>& outcomes) {
  for (const JobOutcome& outcome : outcomes)
    if (outcome.state == JobState::failed)
      return outcome.exit_code > 127 ? exit_goal : outcome.exit_code == 0 ? exit_io : outcome.exit_code;
  return exit_done;
}

}  // namespace

int study_command(const StudyCommand& command) {
  // Everything that can be wrong with the study is found before the folder is touched.
  const Study study = read_study(command.study_file, command.overrides);
  StudyPlan plan = make_plan(study);
  for (Job& job : plan.jobs) job.reproducible = command.reproducible;
  if (command.dry_run) {
    print(plan_table(plan, command.folder));
    return exit_done;
  }
  refuse_foreign_folder(command.folder);
  const UniqueFd held = lock(command.folder);
  write_whole_file(command.folder / "study.toml", study.text);

  StudyPrinter printer(progress_style(stderr, command.quiet));
  RunnerOptions options;
  options.folder = command.folder;
  int widest = 1;  // threads of a run that goes beside others
  for (const Job& job : plan.jobs)
    if (!job.timed) widest = std::max(widest, job.threads);
  options.jobs = command.jobs.value_or(std::max(1, usable_cores() / widest));
  options.stop_signal = &catch_stop_signals(command.quiet);
  options.progress = [&](const StudyProgress& progress) { printer.update(progress); };
  options.ended = [&](const Job& job, const JobOutcome& outcome) {
    printer.clear();
    if (outcome.state == JobState::failed)
      spdlog::error("{}: failed, exit code {}: {}", job.name, outcome.exit_code, outcome.message);
    else if (!command.quiet && outcome.state == JobState::done)
      spdlog::info("{}: done in {}{}", job.name, duration_text(outcome.wall_seconds),
                   outcome.steal_seconds ? fmt::format(", steal time {:.1f} s", *outcome.steal_seconds) : "");
  };
  if (!command.quiet)
    spdlog::info("{}: {} runs, {}, into {}", command.study_file.filename().string(), plan.jobs.size(),
                 runs_at_a_time(plan, options.jobs), command.folder.string());
  const auto other = std::count_if(plan.jobs.begin(), plan.jobs.end(), [&](const Job& job) { return holds_another(command.folder, job); });
  if (other > 0 && !command.quiet) spdlog::warn("{} finished run{} of other cases{} in {} {} made anew", other, other == 1 ? "" : "s", command.reproducible ? ", or without --reproducible," : "", command.folder.string(), other == 1 ? "is" : "are");
  const std::vector<JobOutcome> outcomes = run_jobs(plan, options);
  printer.clear();

  write_run_table(command.folder, plan, outcomes);
  const auto stopped =
      std::count_if(outcomes.begin(), outcomes.end(), [](const JobOutcome& o) { return o.state == JobState::stopped; });
  if (stopped > 0) {
    if (!command.quiet)
      spdlog::warn("stopped by request, {} of {} runs are left; the same command goes on", stopped, plan.jobs.size());
    return exit_stopped;
  }
  std::set<std::string> damaged;
  const std::vector<PartResults> results = analyse(plan, command.folder, damaged);
  for (const std::string& one : damaged) spdlog::error("{}", one);
  const std::vector<Statement> statements = judge(plan, results);
  for (const PartResults& part : results) {
    write_part_tables(command.folder, plan, part);
    for (const std::string& wrong : draw_figures(command.folder, plan, part)) spdlog::warn("{}", wrong);
  }
  write_statements(command.folder, statements);
  write_study_h5(command.folder, plan, results, statements);
  if (!command.quiet) {
    const auto count = [&](std::optional<bool> holds) {
      return std::count_if(statements.begin(), statements.end(), [&](const Statement& s) { return s.holds == holds; });
    };
    if (!statements.empty()) {
      const bool few = std::any_of(statements.begin(), statements.end(), [](const Statement& s) { return s.seeds < 3; });
      print(fmt::format("statements: {} hold, {} do not hold, {} not judged (statements.md{})\n", count(true),
                        count(false), count(std::nullopt), few ? "; provisional where there are fewer than three seeds" : ""));
    }
    print(fmt::format("results: {} (study.h5, statements.md, runs.csv, runs/, {})\n", command.folder.string(),
                      study.parts.empty() ? "tables/, figures/" : "tables/ and figures/ in a folder for each part"));
  }
  const auto warned = std::count_if(outcomes.begin(), outcomes.end(), [](const JobOutcome& o) { return o.state != JobState::failed && !o.message.empty(); });
  if (warned > 0 && !command.quiet)
    spdlog::warn("{} of {} runs have warnings: column message of {}", warned, plan.jobs.size(), (command.folder / "runs.csv").string());
  const int failed = exit_code_of(outcomes), code = failed == exit_done && !damaged.empty() ? exit_io : failed;
  if (failed != exit_done)
    spdlog::error("{} of {} runs failed: {}",
                  std::count_if(outcomes.begin(), outcomes.end(),
                                [](const JobOutcome& o) { return o.state == JobState::failed; }),
                  plan.jobs.size(), (command.folder / "runs.csv").string());
  return code;
}

}  // namespace platen
