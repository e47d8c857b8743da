#include "protocol/study/runner.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "protocol/experiment.h"
#include "protocol/output/checkpoint_file.h"
#include "protocol/output/files.h"
#include "protocol/output/hdf5_file.h"
#include "protocol/output/series_csv.h"
#include "protocol/study/porosity_match.h"
#include "protocol/study/settled_sample.h"

namespace platen {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

double since(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

// Whether an interrupted run of this very case has left all that `resume` needs, and was made as wanted. What else may keep that from going on (a full
// disk, somebody else at work there) passes, so the run is not given up for it.
bool can_go_on(const fs::path& folder, const std::string& case_text, bool reproducible) {
  try {
    if (!fs::exists(folder / "case.toml") || read_whole_file(folder / "case.toml") != case_text) return false;
    std::string passed_over;
    const Checkpoint from = newest_checkpoint(folder, passed_over);
    const CheckpointFacts facts = facts_of(from);
    const auto sets = available_instruction_sets();
    const bool kernels = from.reproducible || std::any_of(sets.begin(), sets.end(), [&](InstructionSet set) { return to_string(set) == from.instruction_set; });
    read_series(folder / "series.csv", facts.rows);
    if (!facts.closed.empty()) Hdf5File::open(folder / "results.h5");
    return kernels && from.case_text == case_text && (from.reproducible || !reproducible);
  } catch (const std::exception&) {
    return false;
  }
}

std::string text_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

// The last line of a log that is not empty.
std::string last_line(const fs::path& log) {
  std::istringstream lines(text_of(log));
  std::string found;
  for (std::string line; std::getline(lines, line);)
    if (line.find_first_not_of(" \t\r") != std::string::npos) found = line;
  return found;
}

// Step of the last whole row of a series; none before there is one. The file may be growing.
std::optional<double> last_step(const fs::path& series) {
  std::ifstream in(series, std::ios::binary | std::ios::ate);
  if (!in) return std::nullopt;
  const std::streamoff size = in.tellg(), tail = std::min<std::streamoff>(size, 4096);
  std::string text(static_cast<std::size_t>(tail), '\0');
  in.seekg(size - tail);
  if (!in.read(text.data(), tail)) return std::nullopt;
  const std::size_t end = text.rfind('\n'), begin = end == std::string::npos || end == 0 ? std::string::npos : text.rfind('\n', end - 1);
  if (begin == std::string::npos) return std::nullopt;
  const std::size_t comma = text.find(',', begin);  // time, step, ...
  char* after = nullptr;
  const double step = comma < end ? std::strtod(text.c_str() + comma + 1, &after) : 0.0;
  return after != nullptr && *after == ',' ? std::optional(step) : std::nullopt;
}

// A run that was killed a moment ago may still hold its folder: waits until nobody does, at most 10 s. After that the
// child itself says who holds it.
void wait_until_free(const fs::path& folder) {
  const int fd = ::open((folder / ".lock").c_str(), O_RDWR | O_CLOEXEC);
  if (fd < 0) return;
  for (int k = 0; k < 1000 && ::flock(fd, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK; ++k)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  ::close(fd);
}

// Starts the program with its output in `log`; the child gets `end_signal` when this process ends.
pid_t start(const fs::path& program, const std::vector<std::string>& words, const fs::path& log) {
  std::vector<char*> argv;
  for (const std::string& word : words) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);
  const int out = ::open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (out < 0) throw system_error(log, "cannot open", errno);
  const UniqueFd held(out);
  const pid_t parent = ::getpid();
  const pid_t child = ::fork();
  if (child < 0) throw OutputError(fmt::format("cannot start {}: {}", program.string(), std::strerror(errno)));
  if (child > 0) return child;
  // Only calls that are allowed between fork and exec.
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(127);  // it ended before the line above
  ::dup2(out, 1);
  ::dup2(out, 2);
  const int nothing = ::open("/dev/null", O_RDONLY);
  if (nothing >= 0) ::dup2(nothing, 0);
  for (const int number : {SIGINT, SIGTERM, SIGHUP, SIGXCPU, SIGPIPE, SIGXFSZ, SIGUSR1}) ::signal(number, SIG_DFL);
  ::execv(program.c_str(), argv.data());
  ::_exit(127);
}

// The summary of a run that has finished well; null where there is none.
nlohmann::json finished_summary(const fs::path& folder) {
  std::error_code ignored;
  if (!fs::is_regular_file(folder / "summary.json", ignored)) return {};
  nlohmann::json summary = nlohmann::json::parse(text_of(folder / "summary.json"), nullptr, false);
  const auto code = summary.is_object() ? summary.find("exit_code") : summary.end();
  if (!summary.is_object() || code == summary.end() || *code != 0) return {};
  return summary;
}

bool is_as_wanted(const fs::path& folder, const nlohmann::json& summary, const Job& job) {
  if (text_of(folder / "case.toml") != job.c.text) return false;
  const bool reproducible = made_reproducibly(summary);
  return job.timed ? reproducible == job.reproducible : reproducible || !job.reproducible;  // times of two kinds of kernels do not compare
}

// Warnings of all stages of a run, for one cell of a table.
std::string warnings_of(const nlohmann::json& summary) {
  std::string text;
  if (!summary.is_object() || !summary.contains("stages")) return text;
  for (const nlohmann::json& stage : summary["stages"])
    for (const nlohmann::json& warning : stage.value("warnings", nlohmann::json::array()))
      text += (text.empty() ? "" : "; ") + stage.value("name", std::string()) + ": " + warning.get<std::string>();
  return text;
}

class Runner {
 public:
  Runner(StudyPlan& plan, const RunnerOptions& options)
      : plan_(plan), options_(options), outcomes_(plan.jobs.size()), look_at_(plan.jobs.size()) {
    std::error_code error;
    for (const char* name : {"cases", "logs", "runs"}) {
      fs::create_directories(options.folder / name, error);
      if (error) throw OutputError((options.folder / name).string() + ": cannot write: " + error.message());
    }
    for (const Job& job : plan.jobs) all_weight_ += job.weight;
  }

  std::vector<JobOutcome> run() {
    std::vector<std::size_t> many, alone;
    for (std::size_t k = 0; k < plan_.jobs.size(); ++k) {
      if (plan_.jobs[k].match) take_match(plan_.jobs[k], match_state(plan_, plan_.jobs[k], options_.folder));
      if (is_done(options_.folder, plan_.jobs[k]))
        keep(k);
      else
        (plan_.jobs[k].timed ? alone : many).push_back(k);
    }
    std::stable_sort(many.begin(), many.end(), [&](std::size_t a, std::size_t b) {
      const Job &p = plan_.jobs[a], &q = plan_.jobs[b];
      if (p.c.seed != q.c.seed) return p.c.seed < q.c.seed;
      return p.match.has_value() != q.match.has_value() ? q.match.has_value() : p.weight > q.weight;
    });
    // By repetition: the plan has them side by side.
    const auto repetition = [&](std::size_t k) { return plan_.jobs[k].name.substr(plan_.jobs[k].name.rfind("-t")); };
    std::stable_sort(alone.begin(), alone.end(), [&](std::size_t a, std::size_t b) {
      const std::string p = repetition(a), q = repetition(b);
      return p.size() != q.size() ? p.size() < q.size() : p < q;
    });
    work(std::move(many), options_.jobs);
    work(std::move(alone), 1);
    for (JobOutcome& outcome : outcomes_)
      if (outcome.state == JobState::waiting) outcome.state = JobState::stopped;
    return std::move(outcomes_);
  }

 private:
  struct Child {
    pid_t pid;
    std::size_t job;
    std::size_t attempt;  // number of the try; 0: the run itself
    double steps_before;         // made before it took the run up
    Clock::time_point begin;
    std::optional<double> steal;
    fs::path series;             // of its run folder
    double spheres = 0.0, particle_steps = 0.0, own_steps = 0.0;  // particle-steps of the run so far, and of this child
    fs::file_time_type born = fs::file_time_type::clock::now();
  };

  bool stopping() const { return options_.stop_signal != nullptr && *options_.stop_signal != 0; }

  void work(std::vector<std::size_t> queue, int at_once) {
    queue_ = std::move(queue);
    bool told = false;
    while (!queue_.empty() || !children_.empty()) {
      while (!stopping() && static_cast<int>(children_.size()) < at_once && go_on_with_one()) {
      }
      if (stopping()) {
        queue_.clear();
        if (!told)
          for (const Child& child : children_) ::kill(child.pid, SIGTERM);
        told = true;
      }
      if (!reap() && !(queue_.empty() && children_.empty())) std::this_thread::sleep_for(std::chrono::milliseconds(20));
      report();
    }
  }

  // Takes the first job of the queue that can go on a step further; false where all have to wait.
  bool go_on_with_one() {
    for (auto place = queue_.begin(); place != queue_.end(); ++place) {
      const std::size_t k = *place;
      const Job& job = plan_.jobs[k];
      if (!job.match || job.match->met) {
        queue_.erase(place);
        if (is_done(options_.folder, job))
          keep(k);  // of an earlier search
        else
          launch(k, 0, job.c);
        return true;
      }
      if (Clock::now() < look_at_[k]) continue;
      const MatchState state = match_state(plan_, job, options_.folder);
      take_match(plan_.jobs[k], state);
      if (state.kind == MatchState::Kind::waits) {
        const JobState reference = outcomes_[job.match->reference].state;
        if (reference == JobState::waiting || reference == JobState::running) {
          look_at_[k] = Clock::now() + std::chrono::milliseconds(200);
          continue;
        }
        queue_.erase(place);
        fail(k, exit_goal, "its reference " + plan_.jobs[job.match->reference].name + " has no settled sample");
      } else if (state.kind == MatchState::Kind::attempt) {
        queue_.erase(place);
        launch(k, state.tries.size() + 1, state.c);
      } else if (state.kind == MatchState::Kind::failed) {
        queue_.erase(place);
        fail(k, exit_goal, state.message);
      }
      return true;  // met: the next look runs it
    }
    return false;
  }

  // The run of a job, or one of its tries.
  void launch(std::size_t k, std::size_t attempt, const Case& c) {
    const Job& job = plan_.jobs[k];
    const std::string name = title(k, attempt, "-try");
    const fs::path folder = attempt == 0 ? run_folder(options_.folder, job) : try_folder(options_.folder, job, attempt);
    const fs::path file = options_.folder / "cases" / (name + ".toml");
    write_whole_file(file, c.text);
    wait_until_free(folder);
    std::vector<std::string> words{"platen"};
    const bool resumed = attempt == 0 && !job.timed && can_go_on(folder, c.text, job.reproducible);
    if (resumed)
      words.insert(words.end(), {"resume", folder.string()});
    else
      words.insert(words.end(), {"run", file.string(), "-o", folder.string(), "--force"});
    if (!resumed && job.reproducible) words.push_back("--reproducible");
    words.insert(words.end(), {"--threads", std::to_string(job.threads), "--quiet", "--no-report"});
    if (attempt > 0) words.insert(words.end(), {"--stop-after", settled_stage(c)->name});
    outcomes_[k].state = JobState::running;
    const std::optional<double> steal = job.timed ? steal_seconds() : std::nullopt;
    const auto steps_before = resumed ? last_step(folder / "series.csv") : std::nullopt;
    children_.push_back(
        {start(options_.program, words, options_.folder / "logs" / (name + ".txt")), k, attempt, static_cast<double>(steps_before.value_or(0)), Clock::now(), steal, folder / "series.csv",
         static_cast<double>(c.particles.table ? static_cast<std::int64_t>(c.particles.table->size()) : c.particles.count)});
    newest_ = title(k, attempt, " try ");
  }

  std::string title(std::size_t k, std::size_t attempt, const char* word) const {
    return plan_.jobs[k].name + (attempt > 0 ? word + std::to_string(attempt) : "");
  }

  // Takes in every child that has ended; whether there was one.
  bool reap() {
    bool any = false;
    for (std::size_t i = 0; i < children_.size();) {
      int status = 0;
      const pid_t ended = ::waitpid(children_[i].pid, &status, WNOHANG);
      if (ended == 0 || (ended < 0 && errno == EINTR)) {
        ++i;
        continue;
      }
      close(children_[i], status);
      children_.erase(children_.begin() + static_cast<std::ptrdiff_t>(i));
      any = true;
    }
    return any;
  }

  void close(const Child& child, int status) {
    const Job& job = plan_.jobs[child.job];
    JobOutcome& outcome = outcomes_[child.job];
    outcome.wall_seconds = since(child.begin);
    const int exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    if (stopping() && exit_code != 0) {
      outcome.state = JobState::stopped;
      outcome.exit_code = exit_code;
    } else if (child.attempt > 0 && match_state(plan_, job, options_.folder).tries.size() >= child.attempt) {
      outcome.state = JobState::waiting;
      queue_.insert(queue_.begin(), child.job);  // the next try, or the run, before jobs that have not begun
      return;
    } else if (is_done(options_.folder, job)) {
      outcome.state = JobState::done;
      outcome.exit_code = 0;
      take_summary(child.job);
      if (child.steal) {
        if (const auto now = steal_seconds()) outcome.steal_seconds = *now - *child.steal;
        const nlohmann::json timing = {{"wall_seconds", outcome.wall_seconds},
                                       {"steal_seconds", outcome.steal_seconds.value_or(0.0)}};
        write_whole_file(run_folder(options_.folder, job) / "timing.json", timing.dump(2) + "\n");
      }
    } else {
      std::string message = WIFEXITED(status) ? last_line(options_.folder / "logs" / (title(child.job, child.attempt, "-try") + ".txt"))
                                              : fmt::format("ended by signal {}", WTERMSIG(status));
      if (message.empty()) message = fmt::format("exit code {}", exit_code);
      if (child.attempt > 0) message = fmt::format("try {}: ", child.attempt) + message;
      return fail(child.job, exit_code, message);
    }
    if (outcome.state != JobState::stopped) ++finished_;
    newest_ = job.name;
    if (options_.ended) options_.ended(job, outcome);
  }

  void keep(std::size_t k) {
    outcomes_[k].state = JobState::kept;
    take_summary(k);
    ++finished_;
    if (options_.ended) options_.ended(plan_.jobs[k], outcomes_[k]);
  }

  // What a finished run cost, for the time that is left and for how far the guesses of the others are off; and what it
  // warned of, since runs of a study print nothing.
  void take_summary(std::size_t k) {
    const Job& job = plan_.jobs[k];
    const nlohmann::json summary = nlohmann::json::parse(text_of(run_folder(options_.folder, job) / "summary.json"), nullptr, false);
    outcomes_[k].message = warnings_of(summary);
    const nlohmann::json performance = summary.is_object() ? summary.value("performance", nlohmann::json::object()) : nlohmann::json::object();
    done_weight_ += job.weight;
    done_steps_ += performance.value("particle_steps", job.weight);
    done_seconds_ += performance.value("wall_seconds", 0.0);
  }

  void fail(std::size_t k, int exit_code, const std::string& message) {
    outcomes_[k].state = JobState::failed;
    outcomes_[k].exit_code = exit_code;
    outcomes_[k].message = message;
    all_weight_ -= plan_.jobs[k].weight;
    ++failed_, ++finished_;
    newest_ = plan_.jobs[k].name;
    if (options_.ended) options_.ended(plan_.jobs[k], outcomes_[k]);
  }

  void look_at_children() {
    if (Clock::now() < next_look_) return;
    next_look_ = Clock::now() + std::chrono::seconds(1);
    for (Child& child : children_) {
      std::error_code none;  // a series from before this child is that of an earlier attempt
      const auto written = fs::last_write_time(child.series, none);
      if (none || written < child.born) continue;
      if (const auto step = last_step(child.series)) child.particle_steps = child.spheres * *step, child.own_steps = child.spheres * std::max(0.0, static_cast<double>(*step) - child.steps_before);
    }
  }

  void report() {
    if (!options_.progress) return;
    StudyProgress p;
    p.jobs = plan_.jobs.size();
    p.finished = finished_;
    p.failed = failed_;
    p.running = children_.size();
    p.wall_seconds = since(begin_);
    p.newest = children_.empty() ? newest_ : title(children_.back().job, children_.back().attempt, " try ");  // one that is at work
    look_at_children();
    // Guesses are off alike: what the finished runs took instead of theirs holds for the others too.
    const double stretch = done_weight_ > 0.0 ? done_steps_ / done_weight_ : 1.0;
    double under_way = 0.0, running_steps = 0.0, seconds = done_seconds_;  // steps that these seconds took
    for (const Child& child : children_) {
      if (child.attempt > 0) continue;
      running_steps += child.own_steps;
      under_way += std::min(0.97 * plan_.jobs[child.job].weight, child.particle_steps / stretch);
      seconds += since(child.begin);
    }
    const double behind = done_weight_ + under_way, steps = done_steps_ + running_steps;
    if (steps > 0.0 && seconds > 1.0)
      p.seconds_left = std::max(0.0, all_weight_ - behind) * stretch * seconds / steps /
                       std::max<double>(1.0, std::min<double>(options_.jobs, static_cast<double>(p.jobs - finished_)));
    p.fraction = all_weight_ > 0.0 ? behind / all_weight_ : 1.0;
    options_.progress(p);
  }

  StudyPlan& plan_;
  const RunnerOptions& options_;
  std::vector<JobOutcome> outcomes_;
  std::vector<Clock::time_point> look_at_;  // when a job that waits for its reference is looked at again
  std::vector<std::size_t> queue_;          // jobs of which nothing runs, to be gone on with in this order
  std::string newest_;
  std::vector<Child> children_;
  Clock::time_point begin_ = Clock::now(), next_look_ = begin_;
  double all_weight_ = 0.0, done_weight_ = 0.0, done_steps_ = 0.0, done_seconds_ = 0.0;
  std::size_t finished_ = 0, failed_ = 0;
};

}  // namespace

fs::path run_folder(const fs::path& study_folder, const Job& job) { return study_folder / "runs" / job.name; }

bool made_reproducibly(const nlohmann::json& summary) {
  const auto figures = summary.find("performance");
  if (figures == summary.end() || !figures->is_object()) return false;
  const auto said = figures->find("reproducible");
  return said != figures->end() && *said == true;
}

bool is_done(const fs::path& study_folder, const Job& job) {
  if (job.match && !job.match->met) return false;
  const nlohmann::json summary = finished_summary(run_folder(study_folder, job));
  // One that somebody told where to stop is not over.
  return !summary.is_null() && summary.value("stages", nlohmann::json::array()).size() >= job.c.stages.size() && is_as_wanted(run_folder(study_folder, job), summary, job);
}

bool holds_another(const fs::path& study_folder, const Job& job) {
  if (job.match && !job.match->met) return false;  // its case is not known yet
  const nlohmann::json summary = finished_summary(run_folder(study_folder, job));
  return !summary.is_null() && !is_as_wanted(run_folder(study_folder, job), summary, job);
}

std::vector<JobOutcome> run_jobs(StudyPlan& plan, const RunnerOptions& options) {
  return Runner(plan, options).run();
}

std::optional<double> steal_seconds() {
  std::ifstream stat("/proc/stat");
  std::string word;
  double value = 0.0, steal = 0.0;
  if (!(stat >> word) || word != "cpu") return std::nullopt;
  for (int k = 0; k < 8; ++k) {
    if (!(stat >> value)) return std::nullopt;
    steal = value;  // the eighth number
  }
  return steal / static_cast<double>(::sysconf(_SC_CLK_TCK));
}

}  // namespace platen
