#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cctype>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <nlohmann/json.hpp>
#include <thread>

#include "protocol/output.h"
#include "protocol/output/checkpoint_file.h"
#include "protocol/output/results_h5.h"
#include "protocol/output/summary_json.h"

namespace platen {

namespace fs = std::filesystem;

namespace {

constexpr const char* lock_name = ".lock";

// What every run writes, and what some runs write besides frames/*.hdf.
constexpr std::array main_files{"case.toml", "series.csv", "results.h5", "summary.json", "log.jsonl"};
constexpr std::array other_files{"report.html", "frames.hdf.series"};

// "2026-01-31T12:00:00.123Z"
std::string now_iso8601() {
  using namespace std::chrono;
  const auto now = floor<milliseconds>(system_clock::now());
  const std::time_t seconds = system_clock::to_time_t(now);
  std::tm utc{};
  ::gmtime_r(&seconds, &utc);
  char text[64];
  const std::size_t n = std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%S", &utc);
  const auto rest = static_cast<int>(now.time_since_epoch().count() % 1000);
  std::snprintf(text + n, sizeof text - n, ".%03dZ", rest);
  return text;
}

bool holds_run(const fs::path& folder) {
  for (const char* name : {"series.csv", "results.h5", "summary.json"})
    if (fs::exists(folder / name)) return true;
  return false;
}

// Every run leaves its lock behind, which copies of a folder may lack; its log begins alike.
bool written_by_platen(const fs::path& folder) {
  if (fs::exists(folder / lock_name)) return true;
  const fs::path log = folder / "log.jsonl";
  return fs::is_regular_file(log) && read_whole_file(log).starts_with("{\"timestamp\":\"");
}

bool is_frame(const fs::path& file) { return file.extension() == ".hdf" || file.string().ends_with(".hdf.tmp"); }

void refuse_if_used(const fs::path& folder) {
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().filename() == lock_name) continue;
    throw OutputError(folder.string() + (holds_run(folder) ? ": holds a run already" : ": is not empty") +
                      "; choose another folder (-o), or let --force overwrite what platen wrote there");
  }
}

// `platen run case.toml -o . --force` must not replace the user's own case by one with overrides, nor other files of his that
// have names of ours.
void refuse_to_replace_foreign(const fs::path& folder, const std::string& case_text) {
  if (fs::exists(folder / "study.toml") && fs::is_directory(folder / "runs")) throw OutputError(folder.string() + ": is the folder of a study; choose another folder (-o)");
  if (written_by_platen(folder)) return;
  const auto refuse = [](const fs::path& file) { throw OutputError(file.string() + ": was not written by platen, as no lock and no log of a run stand beside it, and is not overwritten; choose another folder (-o)"); };
  const fs::path own_case = folder / "case.toml";
  if (fs::exists(own_case) && read_whole_file(own_case) != case_text) refuse(own_case);
  for (const char* name : main_files)
    if (fs::exists(folder / name) && folder / name != own_case) refuse(folder / name);
  if (fs::exists(folder / "frames.hdf.series")) refuse(folder / "frames.hdf.series");
  if (has_checkpoint(folder)) refuse(folder / (fs::exists(folder / "checkpoint.h5") ? "checkpoint.h5" : "checkpoint.prev.h5"));
  if (fs::is_directory(folder / "frames"))
    for (const auto& entry : fs::directory_iterator(folder / "frames"))
      if (is_frame(entry.path())) refuse(entry.path());
}

// The lock falls with the process, however it ends; the file itself stays, since removing it would let two processes
// lock two different files of one name.
UniqueFd lock(const fs::path& folder) {
  const fs::path file = folder / lock_name;
  UniqueFd fd(::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666));
  if (fd.get() < 0) throw system_error(file, "cannot open", errno);
  // `info` holds it for a moment to see whether anybody does.
  bool held = ::flock(fd.get(), LOCK_EX | LOCK_NB) == 0;
  for (int k = 0; !held && errno == EWOULDBLOCK && k < 20; ++k) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    held = ::flock(fd.get(), LOCK_EX | LOCK_NB) == 0;
  }
  if (!held) {
    if (errno != EWOULDBLOCK) throw system_error(file, "cannot lock", errno);
    char holder[32] = "";
    const ssize_t n = ::pread(fd.get(), holder, sizeof holder - 1, 0);
    std::string process = n > 0 ? holder : "";
    if (const auto end = process.find('\n'); end != std::string::npos) process.resize(end);
    throw OutputError(folder.string() + ": another process" + (process.empty() ? "" : " (" + process + ")") +
                      " works in this folder");
  }
  // The number only helps people to find the holder; the lock works without it.
  const std::string process = "process " + std::to_string(::getpid()) + "\n";
  if (::ftruncate(fd.get(), 0) != 0 || ::pwrite(fd.get(), process.data(), process.size(), 0) < 0) errno = 0;
  return fd;
}

void remove_file(const fs::path& file) {
  fs::remove(temporary_name(file));
  fs::remove(file);
}

// What `platen export` writes there, and the folder where nothing else is in it.
void remove_exports(const fs::path& folder) {
  if (!fs::is_directory(fs::symlink_status(folder))) return;
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string(), end = entry.path().extension().string();
    const bool of_stage = std::isdigit(static_cast<unsigned char>(name.front())) && name.find('-') != std::string::npos && (end == ".csv" || end == ".vtu");
    if (of_stage || name == "contacts.csv" || name == "stages.pvd" || name == "stages.dump" || name == "last.data" || name == "stages.h5md") files.push_back(entry.path());
  }
  for (const fs::path& file : files) fs::remove(file);
  if (fs::is_empty(folder)) fs::remove(folder);
}

// Removes what a former run left.
void remove_own_files(const fs::path& folder, bool former_run) {
  if (!former_run) return;
  for (const char* name : main_files) remove_file(folder / name);
  remove_checkpoints(folder);  // `resume` must not take those of a former run for its own
  for (const char* name : other_files) remove_file(folder / name);
  remove_exports(folder / "export");
  const fs::path frames = folder / "frames";
  if (!fs::is_directory(fs::symlink_status(frames))) return;
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(frames)) {
    if (is_frame(entry.path())) files.push_back(entry.path());
  }
  for (const fs::path& file : files) fs::remove(file);
  if (fs::is_empty(frames)) fs::remove(frames);
}

// Relative to the folder.
std::string frame_name(std::size_t index) {
  std::string number = std::to_string(index);
  number.insert(0, number.size() < 6 ? 6 - number.size() : 0, '0');
  return "frames/" + number + ".hdf";
}

const char* to_text(LogLevel level) {
  switch (level) {
    case LogLevel::warning: return "warning";
    case LogLevel::error: return "error";
    default: return "info";
  }
}

}  // namespace

RunFolder::RunFolder(fs::path path, UniqueFd lock, std::string case_text, SeriesFile series, AppendFile log)
    : path_(std::move(path)),
      lock_(std::move(lock)),
      case_text_(std::move(case_text)),
      series_(std::move(series)),
      log_(std::move(log)),
      start_time_(now_iso8601()) {}

bool RunFolder::in_use(const fs::path& folder) {
  const UniqueFd fd(::open((folder / lock_name).c_str(), O_RDONLY | O_CLOEXEC));
  return fd.get() >= 0 && ::flock(fd.get(), LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK;
}

UniqueFd RunFolder::read_lock(const fs::path& folder) {
  UniqueFd fd(::open((folder / lock_name).c_str(), O_RDONLY | O_CLOEXEC));
  if (fd.get() >= 0 && ::flock(fd.get(), LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK) throw OutputError(folder.string() + ": another process works in this folder");
  return fd;
}

RunFolder RunFolder::create(const fs::path& folder, const std::string& case_text, bool force) try {
  fs::create_directories(folder);
  if (force) refuse_to_replace_foreign(folder, case_text);
  else refuse_if_used(folder);
  const bool former_run = written_by_platen(folder);
  UniqueFd held = lock(folder);
  if (force) remove_own_files(folder, former_run);
  else refuse_if_used(folder);  // another process may have been quicker and be done already
  write_whole_file(folder / "case.toml", case_text);
  SeriesFile series = SeriesFile::create(folder / "series.csv");
  AppendFile log = AppendFile::create(folder / "log.jsonl");
  sync_folder(folder);
  return RunFolder(folder, std::move(held), case_text, std::move(series), std::move(log));
} catch (const fs::filesystem_error& error) {
  throw OutputError(folder.string() + ": cannot write: " + error.code().message());
}

UniqueFd RunFolder::hold(const fs::path& folder) {
  // Without one of these there was no run, and the lock that is left behind would say that there was.
  if (!fs::exists(folder / "case.toml") || !(written_by_platen(folder) || has_checkpoint(folder) || fs::exists(folder / "summary.json"))) throw OutputError(folder.string() + ": holds no run");
  return lock(folder);
}

RunFolder RunFolder::reopen(UniqueFd held, const fs::path& folder, std::optional<std::size_t> rows,
                            std::vector<StageResult> closed, const std::vector<double>& frames, const std::string& start_time) try {
  std::string case_text = read_whole_file(folder / "case.toml");
  SeriesFile series = SeriesFile::reopen(folder / "series.csv", rows);
  // A torn last line of the log goes too.
  const fs::path log_path = folder / "log.jsonl";
  const std::string old_log = fs::exists(log_path) ? read_whole_file(log_path) : "";
  AppendFile log = AppendFile::reopen(log_path, old_log.rfind('\n') == std::string::npos ? 0 : old_log.rfind('\n') + 1);
  RunFolder run(folder, std::move(held), std::move(case_text), std::move(series), std::move(log));
  run.closed_ = std::move(closed);
  // Frames behind the checkpoint go, as rows do.
  for (const double time : frames) run.frames_.push_back({frame_name(run.frames_.size()), time});
  for (std::size_t k = frames.size(); fs::exists(folder / frame_name(k)); ++k) fs::remove(folder / frame_name(k));
  if (!frames.empty()) write_frame_series(folder / "frames.hdf.series", run.frames_);
  else fs::remove(folder / "frames.hdf.series");
  if (const std::string start = start_time.empty() ? start_time_of(folder / "results.h5") : start_time; !start.empty()) run.start_time_ = start;
  // Until this run finishes, the summary of an earlier end is not true any more.
  fs::remove(folder / "summary.json");
  return run;
} catch (const fs::filesystem_error& error) {
  throw OutputError(folder.string() + ": cannot read: " + error.code().message());
}

void RunFolder::close_stage(const StageResult& stage, const Snapshot& snapshot, const Profile& profile) {
  series_.sync();
  closed_.push_back(stage);
  try {
    write_results(path_ / "results.h5", {series_.table(), closed_, snapshot, profile, info_, case_text_, start_time_});
  } catch (...) {
    closed_.pop_back();  // the file still holds the stages before this one
    throw;
  }
}

void RunFolder::add_frame(const Snapshot& snapshot, double width, double depth) {
  const Frame frame{frame_name(frames_.size()), snapshot.time};
  fs::create_directories(path_ / "frames");
  write_frame(path_ / frame.name, snapshot, info_.contacts, width, depth);
  frames_.push_back(frame);
  write_frame_series(path_ / "frames.hdf.series", frames_);
}

std::vector<double> RunFolder::frame_times() const {
  std::vector<double> times;
  for (const Frame& frame : frames_) times.push_back(frame.time);
  return times;
}

void RunFolder::finish(int exit_code, std::optional<std::uint64_t> state_hash, const Performance& performance,
                       const std::vector<StageResult>& stages) {
  series_.sync();
  log_.sync();
  write_whole_file(path_ / "summary.json", summary_json(exit_code, state_hash, performance, stages));
}

void RunFolder::log(std::string_view event, std::initializer_list<LogField> fields, LogLevel level) {
  nlohmann::ordered_json line = {{"timestamp", now_iso8601()}, {"level", to_text(level)}, {"event", event}};
  for (const LogField& field : fields)
    std::visit([&](const auto& value) { line[std::string(field.name)] = value; }, field.value.value());
  log_.append(line.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + '\n');
}

}  // namespace platen
