// The run folder: everything that a run leaves behind, and the promise that no file in it is ever half written.
// Files and their contents: docs/output.md.
#pragma once

#include <concepts>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <variant>
#include <vector>

#include "core/measures.h"
#include "core/snapshot.h"
#include "protocol/output/files.h"
#include "protocol/output/frames.h"
#include "protocol/output/output_error.h"
#include "protocol/output/series_csv.h"
#include "protocol/records.h"

namespace platen {

// What the files say about the run itself.
struct RunInfo {
  std::string title;
  std::uint64_t seed = 0;
  int threads = 1;
  std::string instruction_set;
  bool reproducible = false;
  std::string scene;      // kernel variant
  bool contacts = true;   // output.contacts of the case: /contacts and /plate_contacts in results.h5
};

enum class LogLevel { info, warning, error };

// A value of a log entry: text, truth, whole or real number.
class LogValue {
 public:
  template <class T>
    requires std::convertible_to<T, std::string_view>
  LogValue(const T& text) : value_(std::string(std::string_view(text))) {}
  template <class T>
    requires std::is_arithmetic_v<T>
  LogValue(T number) {
    if constexpr (std::is_same_v<T, bool>) value_ = number;
    else if constexpr (std::is_floating_point_v<T>) value_ = static_cast<double>(number);
    else value_ = static_cast<std::int64_t>(number);
  }
  const std::variant<std::string, bool, std::int64_t, double>& value() const { return value_; }

 private:
  std::variant<std::string, bool, std::int64_t, double> value_;
};

struct LogField {
  std::string_view name;
  LogValue value;
};

// Every member throws OutputError with the path and the system's reason when something cannot be written; files under
// their final names are whole then, the old ones where there were any. A process that writes big runs should ignore
// SIGXFSZ, so that a file size limit is such an error too. Not for use from several threads at once.
class RunFolder {
 public:
  // Makes the folder (and its parents), locks it for this process and writes case.toml. A folder that holds anything is
  // refused and left untouched unless `force`, which removes the files that platen wrote and nothing else; a case.toml
  // that platen did not write is never overwritten by another text.
  static RunFolder create(const std::filesystem::path& folder, const std::string& case_text, bool force);

  // Takes up the folder of an interrupted run: keeps the first `rows` rows of series.csv (empty: all whole rows), the stages
  // closed so far and the frames of these times, all as noted by the checkpoint.
  static RunFolder reopen(const std::filesystem::path& folder, std::optional<std::size_t> rows,
                          std::vector<StageResult> closed, const std::vector<double>& frames = {}) {
    return reopen(hold(folder), folder, rows, std::move(closed), frames);
  }
  // The same with the lock in hand, for those who must look at the folder before.
  static UniqueFd hold(const std::filesystem::path& folder);
  static RunFolder reopen(UniqueFd held, const std::filesystem::path& folder, std::optional<std::size_t> rows,
                          std::vector<StageResult> closed, const std::vector<double>& frames, const std::string& start_time = {});

  // Whether a process works in the folder at this moment.
  static bool in_use(const std::filesystem::path& folder);

  // Keeps writers out of a run's folder while it is read, other readers not. Throws OutputError where one is at work.
  static UniqueFd read_lock(const std::filesystem::path& folder);

  UniqueFd close() && { return std::move(lock_); }  // the lock stays, for `reopen`

  const std::filesystem::path& path() const { return path_; }
  const std::string& start_time() const { return start_time_; }  // of the run, ISO 8601
  void set_info(RunInfo info) { info_ = std::move(info); }  // before the first close_stage

  void append(const SeriesRow& row, int stage) { series_.append(row, stage); }  // one row of series.csv; stages from 0
  const SeriesTable& series() const { return series_.table(); }
  std::size_t rows() const { return series_.table().rows(); }
  void sync() { series_.sync(); }  // rows are on disk before it returns; call it before a checkpoint counts on them

  // One more frame: frames/NUMBER.hdf, and frames.hdf.series with it.
  void add_frame(const Snapshot& snapshot, double width, double depth);
  std::vector<double> frame_times() const;  // [s]

  // Rewrites results.h5 with this stage added. `snapshot` and `profile` are those of the stage's end.
  void close_stage(const StageResult& stage, const Snapshot& snapshot, const Profile& profile);

  // Writes summary.json. Without a state hash (the run failed) the key is left out.
  void finish(int exit_code, std::optional<std::uint64_t> state_hash, const Performance& performance,
              const std::vector<StageResult>& stages);

  // One line of log.jsonl: timestamp, level, event, fields.
  void log(std::string_view event, std::initializer_list<LogField> fields = {}, LogLevel level = LogLevel::info);

 private:
  RunFolder(std::filesystem::path path, UniqueFd lock, std::string case_text, SeriesFile series, AppendFile log);

  std::filesystem::path path_;
  UniqueFd lock_;
  std::string case_text_;
  SeriesFile series_;
  AppendFile log_;
  RunInfo info_;
  std::string start_time_;  // ISO 8601
  std::vector<StageResult> closed_;
  std::vector<Frame> frames_;
};

// The table at the end of a run, at most 100 columns wide, ends with a newline: one line per stage, then strength and
// warnings where there are any.
std::string summary_table(const std::vector<StageResult>& stages);

}  // namespace platen
