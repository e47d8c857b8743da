#include "protocol/run_command.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "kernels/kernel_table.h"
#include "protocol/branch.h"
#include "protocol/experiment.h"
#include "protocol/info.h"
#include "protocol/output.h"
#include "protocol/progress.h"
#include "protocol/report_command.h"
#include "protocol/stop_signals.h"
#include "protocol/units.h"
#include "protocol/usable_cores.h"
#include "protocol/usage_error.h"

namespace platen {
namespace {

namespace fs = std::filesystem;

// "1 sphere", "2 spheres".
template <class Number>
std::string counted(Number n, const char* what) {
  return fmt::format("{} {}{}", n, what, n == 1 ? "" : "s");
}

void print(const std::string& text) { std::fwrite(text.data(), 1, text.size(), stdout); }

// What the user should know beside the table: why the run did not simply end.
void report_end(const RunOutcome& outcome, const fs::path& folder, bool quiet) {
  switch (outcome.exit_code) {
    case exit_done: break;
    case exit_stopped:
      if (!has_checkpoint(folder))
        spdlog::warn("{}; what there is so far: {}; there is no checkpoint to go on from", outcome.message, folder.string());
      else if (!quiet)
        spdlog::warn("{}; what there is so far: {}; `platen resume {}` goes on", outcome.message, folder.string(), folder.string());
      break;
    default: {
      std::string how;
      if (outcome.exit_code == exit_goal && !quiet && has_checkpoint(folder))
        how = fmt::format("; `platen resume {} --set stage.{}.max_duration=...` goes on with a longer one", folder.string(), outcome.stages.back().name);
      spdlog::error("{}; what there is so far: {}{}", outcome.message, folder.string(), how);
    }
  }
}

}  // namespace

double parse_walltime(const std::string& text) {
  double seconds = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), seconds);
  try {
    if (error != std::errc{} || end != text.data() + text.size()) seconds = to_si(text, Quantity::time);
  } catch (const UnitError& problem) {
    throw UsageError(fmt::format("--max-walltime: {}; allowed: \"90 s\", \"10 min\", \"2 h\" or plain seconds", problem.what()));
  }
  if (!(seconds > 0.0) || !std::isfinite(seconds))
    throw UsageError(fmt::format("--max-walltime: {} is not a positive time", text));
  return seconds;
}

fs::path free_run_folder(const fs::path& case_file) {
  const std::string stem = case_file.stem().empty() ? "run" : case_file.stem().string();
  fs::path folder = fs::path("runs") / stem;
  std::error_code ignored;
  for (int k = 2; fs::exists(fs::symlink_status(folder, ignored)); ++k)
    folder = fs::path("runs") / fmt::format("{}-{}", stem, k);
  return folder;
}

std::string stage_named(const Case& c, const std::string& text) {
  std::string names;
  for (const StageSpec& stage : c.stages) {
    if (stage.name == text) return text;
    names += (names.empty() ? "" : ", ") + stage.name;
  }
  std::size_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error == std::errc{} && end == text.data() + text.size() && number >= 1 && number <= c.stages.size())
    return c.stages[number - 1].name;
  throw UsageError(fmt::format("--stop-after: the case has no stage \"{}\"; allowed: {}", text, names));
}

namespace {

// Whether a run ended well, and not only as far as somebody had asked for.
bool all_stages_done(const fs::path& folder, const Case& c) {
  if (!fs::exists(folder / "summary.json")) return false;
  const nlohmann::json summary = nlohmann::json::parse(read_whole_file(folder / "summary.json"), nullptr, false);
  return summary.is_object() && summary.value("exit_code", -1) == exit_done && summary.contains("stages") && summary["stages"].size() >= c.stages.size();
}

// What both commands do once the folder is theirs.
struct Course {
  const Case& c;
  RunFolder& folder;
  RunOptions options;
  const Checkpoint* from = nullptr;
  bool fresh = true;  // a folder of its own making: a report.html that is there is not its own
  bool report = true, json = false, quiet = false;
};

int carry_out(Course& course) {
  const fs::path path = course.folder.path();
  RunOptions& options = course.options;
  options.stop_signal = &catch_stop_signals(course.quiet);
  options.checkpoint_signal = &checkpoint_requests();
  std::vector<std::string> names;
  for (const StageSpec& stage : course.c.stages) names.push_back(stage.name);
  ProgressPrinter printer(stderr, progress_style(stderr, course.quiet), names);
  options.progress = [&](const Progress& progress) { printer.update(progress); };
  options.stage_closed = [&](const StageResult& stage) { printer.stage_closed(stage); };
  const RunOutcome outcome = run_experiment(course.c, course.folder, options, course.from);
  printer.clear();
  // Whatever the page lacks, the run is done and stands in its files.
  bool reported = course.report;
  if (reported && fs::exists(path / "report.html") && course.fresh) {  // that of a former run is gone by now
    reported = false;
    spdlog::warn("{}: is yours and stays; `platen report` writes one elsewhere", (path / "report.html").string());
  }
  if (reported) try {
    write_report(path);
  } catch (const std::exception& error) {
    reported = false;
    spdlog::warn("no report.html: {}", error.what());
  }
  if (course.json) {
    print(read_whole_file(path / "summary.json"));
  } else if (!course.quiet) {
    print(summary_table(outcome.stages));
    print(fmt::format("results: {} (results.h5, series.csv, summary.json)\n", path.string()));
    if (reported) print(fmt::format("report: {}\n", (path / "report.html").string()));
    if (outcome.exit_code == exit_done) print(fmt::format("state hash: {:016x}\n", outcome.state_hash));
  }
  report_end(outcome, path, course.quiet);
  return outcome.exit_code;
}

// Options of a run that goes on from a checkpoint. `where` stands in the message on a stage that is over already.
template <class Command>
RunOptions options_from(const Checkpoint& from, const CheckpointFacts& facts, const Case& c, const Command& command, const std::string& where) {
  RunOptions options;
  options.threads = command.threads.value_or(usable_cores());
  options.reproducible = from.reproducible;
  options.max_walltime = command.max_walltime;
  if (command.stop_after.empty()) return options;
  options.stop_after = stage_named(c, command.stop_after);
  for (std::size_t k = 0; k < facts.stage && k < c.stages.size(); ++k)
    if (c.stages[k].name == options.stop_after)
      throw UsageError(fmt::format("--stop-after: {} has left stage \"{}\" behind; it goes on with \"{}\"", where, options.stop_after, c.stages[std::min(facts.stage, c.stages.size() - 1)].name));
  return options;
}

// The case of a run that goes on, with more time for stages that are not over: all that may change.
Case with_more_time(const Case& c, const CheckpointFacts& facts, const ResumeCommand& command) {
  Case longer = read_case(command.folder / "case.toml", command.overrides, CaseUse::resume);
  for (std::size_t k = 0; k < c.stages.size(); ++k) {
    if (k < facts.stage && longer.stages[k].max_duration != c.stages[k].max_duration)
      throw UsageError(fmt::format("--set: stage \"{}\" is over; allowed: stages from \"{}\" on", c.stages[k].name, c.stages[std::min(facts.stage, c.stages.size() - 1)].name));
    if (longer.stages[k].max_duration < c.stages[k].max_duration)
      throw UsageError(fmt::format("--set: stage.{}.max_duration = {:g} s is less than it was; allowed: more than {:g} s", c.stages[k].name, longer.stages[k].max_duration, c.stages[k].max_duration));
  }
  return longer;
}

// Nothing else of a run that goes on may change.
void refuse_other_keys(const ResumeCommand& command) {
  for (const std::string& text : command.overrides) {
    std::string key = text.substr(0, text.find('='));
    key.erase(key.find_last_not_of(" \t") + 1);
    if (!key.starts_with("stage.") || !key.ends_with(".max_duration"))
      throw UsageError(fmt::format("--set: {} stays as it is in a run that goes on; allowed: stage.NAME.max_duration, or a new run", key));
  }
}

int say_done(const ResumeCommand& command) {
  if (command.json) print(read_whole_file(command.folder / "summary.json"));
  else if (!command.quiet) spdlog::info("{}: {}; nothing is left to do", command.folder.string(), run_state(command.folder).text);
  return exit_done;
}

// `platen run --from`: as a new run in its folder, as a resumed one in all else.
int branch_command(const RunCommand& command) {
  const fs::path& of = *command.from;
  if (of.empty()) throw UsageError("--from: the name of a run folder is missing");
  for (const char* name : {"case.toml", "series.csv", "results.h5"})
    if (!fs::exists(of / name)) throw OutputError(fmt::format("{}: is not a run folder with a finished stage, there is no {}", of.string(), name));
  const UniqueFd unchanged = RunFolder::read_lock(of);
  if (!has_checkpoint(of))
    throw UsageError(fmt::format("--from: {} has no checkpoint, as runs that came to their end; allowed: a run that was told where to stop, by --stop-after", of.string()));
  const Case c = read_case(command.case_file, command.overrides, CaseUse::resume);
  std::string passed_over;
  const Checkpoint from = newest_checkpoint(of, passed_over);
  const CheckpointFacts facts = facts_of(from);
  if (facts.within)
    throw UsageError(fmt::format("--from: {} stands in the middle of a stage; allowed: one stopped by --stop-after, as by `platen resume {} --stop-after {}`", of.string(),
                                 of.string(), facts.stage + 1));
  refuse_other_history(c, from, facts.stage, of);
  if (command.reproducible && !from.reproducible) throw UsageError(fmt::format("--reproducible: {} was run without it", of.string()));
  const RunOptions options = options_from(from, facts, c, command, of.string());
  const fs::path path = command.folder.empty() ? free_run_folder(command.case_file) : command.folder;
  if (fs::exists(path) && fs::equivalent(path, of)) throw UsageError(fmt::format("--from: {} is the folder of the new run too; allowed: another -o", of.string()));
  catch_stop_signals(command.quiet);
  make_simulation(c, from, 1);  // fails before the folder is touched, if it does
  RunFolder made = RunFolder::create(path, c.text, command.force);
  const std::string start = made.start_time();
  UniqueFd held = std::move(made).close();
  copy_history(of, from, path, c.text, start);
  RunFolder folder = RunFolder::reopen(std::move(held), path, facts.rows, facts.closed, facts.frames, start);
  if (!passed_over.empty()) spdlog::warn("{}; going on from the checkpoint before it", passed_over);
  if (!command.quiet)
    spdlog::info("{}: {}, from {} after stage {}, {} of {} stages are left, {}, into {}", command.case_file.filename().string(), counted(from.bed.id.size(), "sphere"), of.string(),
                 c.stages[facts.stage - 1].name, c.stages.size() - facts.stage, c.stages.size(), counted(options.threads, "thread"), path.string());
  folder.log("from", {{"run", of.string()}, {"step", from.bed.step}, {"after", c.stages[facts.stage - 1].name}});
  Course course{c, folder, options, &from, true, command.report, command.json, command.quiet};
  return carry_out(course);
}

}  // namespace

int run_command(const RunCommand& command) {
  if (command.from) return branch_command(command);
  // Everything that can be wrong with the request is found before the folder is touched.
  const Case c = read_case(command.case_file, command.overrides);
  refuse_unstable_step(c);
  RunOptions options;
  options.threads = command.threads.value_or(usable_cores());
  options.reproducible = command.reproducible;
  options.max_walltime = command.max_walltime;
  if (!command.stop_after.empty()) options.stop_after = stage_named(c, command.stop_after);

  const fs::path path = command.folder.empty() ? free_run_folder(command.case_file) : command.folder;
  catch_stop_signals(command.quiet);  // before anything is begun that should be ended in good order
  RunFolder folder = RunFolder::create(path, c.text, command.force);
  if (!command.quiet)
    spdlog::info("{}: {}, {}, {}, into {}", command.case_file.filename().string(), counted(c.particles.count, "sphere"),
                 counted(c.stages.size(), "stage"), counted(options.threads, "thread"), path.string());
  Course course{c, folder, options, nullptr, true, command.report, command.json, command.quiet};
  return carry_out(course);
}

int resume_command(const ResumeCommand& command) {
  const fs::path& path = command.folder;
  refuse_other_keys(command);
  if (!fs::exists(path / "case.toml") || !fs::exists(path / "series.csv")) throw OutputError(path.string() + ": is not a run folder");
  // In hand before anything is read: whoever is still at work there writes the last checkpoint first.
  UniqueFd held = RunFolder::hold(path);
  Case c = read_case(path / "case.toml", {}, CaseUse::resume);
  if (!has_checkpoint(path) && all_stages_done(path, c)) return say_done(command);
  std::string passed_over;
  Checkpoint from = newest_checkpoint(path, passed_over);
  // Killed between the two files of `--set`, the same command goes on.
  if (c.text != from.case_text && (command.overrides.empty() || read_case(path / "case.toml", command.overrides, CaseUse::resume).text != from.case_text))
    throw CaseError(fmt::format("{}: is not the case that the run was begun with; put that back (dataset /case of the checkpoint has it), or begin anew with `platen run`", (path / "case.toml").string()));
  const CheckpointFacts facts = facts_of(from);
  if (!facts.within && facts.stage >= c.stages.size() && all_stages_done(path, c)) return say_done(command);  // kept by --stop-after, for `run --from`
  const RunOptions options = options_from(from, facts, c, command, "the run");
  if (!command.overrides.empty()) c = with_more_time(c, facts, command);
  catch_stop_signals(command.quiet);
  make_simulation(c, from, 1);  // fails before the folder is touched, if it does
  if (!command.overrides.empty()) {
    from.case_text = c.text;
    for (int k = 0; k < 2; ++k) write_checkpoint(path, from);  // also the one before it
    write_whole_file(path / "case.toml", c.text);
  }
  RunFolder folder = RunFolder::reopen(std::move(held), path, facts.rows, facts.closed, facts.frames, from.start_time);
  if (!passed_over.empty()) spdlog::warn("{}; going on from the checkpoint before it", passed_over);
  if (!command.quiet)
    spdlog::info("{}: {}, on from step {}, {:.4g} s simulated, {}", path.string(), counted(from.bed.id.size(), "sphere"), from.bed.step,
                 from.bed.time_base + static_cast<double>(from.bed.step - from.bed.step_base) * from.bed.dt, counted(options.threads, "thread"));
  Course course{c, folder, options, &from, false, command.report, command.json, command.quiet};
  return carry_out(course);
}

}  // namespace platen
