// What can go wrong with files: every case ends in an OutputError that names the path and the reason, and no file under
// its final name is ever half written.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <csignal>

#include "tests/sample_run.h"

namespace platen {
namespace {

using namespace sample;

class OutputFaults : public OutputTest {};

// No file of this process may grow beyond `bytes`: writes behave as on a full disk.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(std::size_t bytes) {
    old_handler_ = std::signal(SIGXFSZ, SIG_IGN);
    ::getrlimit(RLIMIT_FSIZE, &old_);
    const rlimit limit{bytes, old_.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() {
    ::setrlimit(RLIMIT_FSIZE, &old_);
    std::signal(SIGXFSZ, old_handler_);
  }

 private:
  rlimit old_{};
  void (*old_handler_)(int) = nullptr;
};

// The message of the OutputError that `action` must throw.
template <class Action>
std::string error_of(Action action) {
  try {
    action();
  } catch (const OutputError& error) {
    return error.what();
  }
  ADD_FAILURE() << "no OutputError";
  return {};
}

template <class Action>
std::string limited_error_of(std::size_t bytes, Action action) {
  return error_of([&] {
    const FileSizeLimit limit(bytes);
    action();
  });
}

bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

TEST_F(OutputFaults, ResultsStayAsTheyWereWhereverTheDiskFillsUp) {
  RunFolder run = RunFolder::create(root / "run", case_text, false);
  run.set_info(info());
  write_stage(run, 0);
  append_stage(run, 1);
  const auto before = all_files(root / "run");
  // A complete file tells how many bytes there are to fail at; same contents, so same size.
  fs::copy(root / "run", root / "whole", fs::copy_options::recursive);
  {
    RunFolder whole = RunFolder::reopen(root / "whole", {}, results(1));
    whole.set_info(info());
    whole.close_stage(result(1), snapshot(1), profile(1));
  }
  const std::size_t size = fs::file_size(root / "whole/results.h5");
  ASSERT_GT(size, 20000u);
  int tried = 0;
  for (std::size_t bytes = 0; bytes < size; bytes += bytes < 4096 ? 64 : 997, ++tried) {
    const std::string error =
        limited_error_of(bytes, [&] { run.close_stage(result(1), snapshot(1), profile(1)); });
    ASSERT_TRUE(has(error, "results.h5")) << error;
    ASSERT_TRUE(has(error, "File too large")) << error;
    ASSERT_EQ(all_files(root / "run"), before) << "limit " << bytes;
  }
  EXPECT_GT(limited_error_of(size - 1, [&] { run.close_stage(result(1), snapshot(1), profile(1)); }).size(), 0u);
  EXPECT_GT(tried, 80);
  // The run can go on once there is room again.
  run.close_stage(result(1), snapshot(1), profile(1));
  EXPECT_EQ(contents(root / "run/results.h5"), contents(root / "whole/results.h5"));
}

TEST_F(OutputFaults, ARowThatDoesNotFitLeavesWholeRowsOnly) {
  RunFolder run = RunFolder::create(root / "run", case_text, false);
  run.append(row(0, 0), 0);
  const std::string before = contents(root / "run/series.csv");
  for (const std::size_t extra : {0u, 1u, 50u}) {
    const std::string error = limited_error_of(before.size() + extra, [&] { run.append(row(0, 1), 0); });
    EXPECT_TRUE(has(error, "series.csv: cannot write: File too large")) << error;
    EXPECT_EQ(contents(root / "run/series.csv"), before);
    EXPECT_EQ(run.rows(), 1u);
  }
  run.append(row(0, 1), 0);
  EXPECT_EQ(read_series(root / "run/series.csv").rows(), 2u);
}

TEST_F(OutputFaults, SummaryAndCaseAreWholeOrAbsent) {
  RunFolder run = RunFolder::create(root / "run", case_text, false);
  const std::string error = limited_error_of(10, [&] { run.finish(0, 1, performance(), results(2)); });
  EXPECT_TRUE(has(error, "summary.json: cannot write: File too large")) << error;
  EXPECT_FALSE(fs::exists(root / "run/summary.json"));
  EXPECT_FALSE(fs::exists(root / "run/summary.json.tmp"));
  EXPECT_TRUE(has(limited_error_of(10, [&] { RunFolder::create(root / "other", case_text, false); }), "case.toml"));
  EXPECT_FALSE(fs::exists(root / "other/case.toml"));
}

TEST_F(OutputFaults, NamesThatCannotBeReplacedAreReported) {
  RunFolder run = RunFolder::create(root / "run", case_text, false);
  run.set_info(info());
  append_stage(run, 0);
  fs::create_directories(root / "run/results.h5/occupied");  // as root, permissions would stop nothing
  const std::string error = error_of([&] { run.close_stage(result(0), snapshot(0), profile(0)); });
  EXPECT_TRUE(has(error, "results.h5: cannot write: Is a directory")) << error;
  EXPECT_FALSE(fs::exists(root / "run/results.h5.tmp"));
  fs::create_directories(root / "run/summary.json.tmp");
  EXPECT_TRUE(has(error_of([&] { run.finish(0, 1, performance(), {}); }), "summary.json: cannot write: Is a directory"));
}

TEST_F(OutputFaults, ResultsThatVanishedAreReported) {
  RunFolder run = RunFolder::create(root / "run", case_text, false);
  run.set_info(info());
  write_stage(run, 0);
  fs::remove(root / "run/results.h5");  // holds the states of earlier stages
  EXPECT_TRUE(has(error_of([&] { write_stage(run, 1); }), "results.h5: cannot read"));
  EXPECT_FALSE(fs::exists(root / "run/results.h5"));
  EXPECT_FALSE(fs::exists(root / "run/results.h5.tmp"));
}

TEST_F(OutputFaults, FolderThatCannotBeMade) {
  put(root / "file", "text");
  EXPECT_TRUE(has(error_of([&] { RunFolder::create(root / "file/run", case_text, false); }), "Not a directory"));
  const std::string error = error_of([&] { RunFolder::create(root / "file", case_text, true); });
  EXPECT_TRUE(has(error, (root / "file").string())) << error;
  EXPECT_EQ(contents(root / "file"), "text");
}

TEST_F(OutputFaults, ExistingRunIsRefusedAndUntouched) {
  write_run(root / "run", 2);
  const auto before = all_files(root / "run");
  EXPECT_TRUE(has(error_of([&] { RunFolder::create(root / "run", "other", false); }), "holds a run already"));
  EXPECT_EQ(all_files(root / "run"), before);
  // Not even a lock is left in a folder that was never ours.
  fs::create_directory(root / "foreign");
  put(root / "foreign/letter.txt", "dear");
  const auto foreign = all_files(root / "foreign");
  EXPECT_TRUE(has(error_of([&] { RunFolder::create(root / "foreign", "other", false); }), "is not empty"));
  EXPECT_EQ(all_files(root / "foreign"), foreign);
}

TEST_F(OutputFaults, ForceRemovesOnlyWhatPlatenWrote) {
  write_run(root / "run", 2);
  fs::create_directories(root / "run/frames");
  for (const char* name : {"frames/0001.hdf", "frames.hdf.series", "checkpoint.h5", "checkpoint.prev.h5", "report.html",
                           "results.h5.tmp"})
    put(root / "run" / name, "old");
  for (const char* name : {"notes.txt", "frames/mine.png"}) put(root / "run" / name, "mine");
  const RunFolder run = RunFolder::create(root / "run", "[case]\n", true);
  auto files = all_files(root / "run");
  files.erase(".lock");
  files.erase("series.csv");
  EXPECT_EQ(files, (std::map<std::string, std::string>{{"case.toml", "[case]\n"},
                                                       {"frames", "folder"},
                                                       {"frames/mine.png", "mine"},
                                                       {"log.jsonl", ""},
                                                       {"notes.txt", "mine"}}));
  EXPECT_EQ(run.rows(), 0u);
}

TEST_F(OutputFaults, ForceDoesNotReplaceTheUsersOwnCase) {
  put(root / "case.toml", "# my own, with comments\n");
  put(root / "report.html", "my report");
  EXPECT_TRUE(has(error_of([&] { RunFolder::create(root, "[case]\n", true); }), "was not written by platen"));
  EXPECT_EQ(all_files(root), (std::map<std::string, std::string>{{"case.toml", "# my own, with comments\n"},
                                                                 {"report.html", "my report"}}));
  // The same text is no loss, and other files of a folder without a run stay.
  RunFolder::create(root, "# my own, with comments\n", true);
  EXPECT_EQ(contents(root / "report.html"), "my report");
}

// A child that holds the lock of a folder until it is killed.
pid_t start_holder(const fs::path& folder) {
  int ready[2];
  if (::pipe(ready) != 0) return -1;
  const pid_t child = ::fork();
  if (child == 0) {
    try {
      const RunFolder run = RunFolder::create(folder, case_text, false);
      if (::write(ready[1], "x", 1) == 1) ::pause();
    } catch (...) {
    }
    ::_exit(1);
  }
  char byte = 0;
  ::close(ready[1]);
  const bool held = ::read(ready[0], &byte, 1) == 1;
  ::close(ready[0]);
  return held ? child : -1;
}

TEST_F(OutputFaults, LockKeepsASecondProcessOutUntilTheFirstIsGone) {
  const pid_t child = start_holder(root / "run");
  ASSERT_GT(child, 0);
  const auto before = all_files(root / "run");
  const std::string error = error_of([&] { RunFolder::create(root / "run", "other", true); });
  EXPECT_TRUE(has(error, "another process (process " + std::to_string(child) + ") works in this folder")) << error;
  EXPECT_TRUE(has(error_of([&] { RunFolder::reopen(root / "run", {}, {}); }), "another process"));
  EXPECT_EQ(all_files(root / "run"), before);
  ::kill(child, SIGKILL);
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  const RunFolder run = RunFolder::create(root / "run", "other", true);
  EXPECT_EQ(contents(root / "run/case.toml"), "other");
}

TEST_F(OutputFaults, InterruptedRunGoesOnToTheSameFiles) {
  RunFolder first = RunFolder::create(root / "run", case_text, false);
  first.set_info(info());
  for (int stage = 0; stage < 2; ++stage) write_stage(first, stage);
  const std::size_t rows = first.rows();
  fs::copy(root / "run", root / "killed", fs::copy_options::recursive);
  for (int stage = 2; stage < 4; ++stage) write_stage(first, stage);
  first.finish(0, 5, performance(), results(4));

  // Killed two rows after the checkpoint, in the middle of the next one.
  const std::string series = contents(root / "run/series.csv");
  std::size_t end = 0;
  for (std::size_t line = 0; line < rows + 3; ++line) end = series.find('\n', end) + 1;
  put(root / "killed/series.csv", series.substr(0, end + 17));
  put(root / "killed/log.jsonl", contents(root / "killed/log.jsonl") + "{\"torn\":");
  EXPECT_EQ(read_series(root / "killed/series.csv").rows(), rows + 2);
  RunFolder second = RunFolder::reopen(root / "killed", rows, results(2));
  second.set_info(info());
  EXPECT_EQ(second.rows(), rows);
  for (int stage = 2; stage < 4; ++stage) write_stage(second, stage);
  second.finish(0, 5, performance(), results(4));
  second.log("end");
  EXPECT_EQ(contents(root / "killed/series.csv"), series);
  EXPECT_EQ(contents(root / "killed/results.h5"), contents(root / "run/results.h5"));
  EXPECT_EQ(contents(root / "killed/summary.json"), contents(root / "run/summary.json"));
  EXPECT_FALSE(has(contents(root / "killed/log.jsonl"), "torn"));
}

TEST_F(OutputFaults, DamagedSeriesIsRefusedOnResume) {
  write_run(root / "run", 2);
  const std::string series = contents(root / "run/series.csv");
  EXPECT_TRUE(has(error_of([&] { RunFolder::reopen(root / "run", 11, {}); }), "10 whole rows where 11 are expected"));
  std::string damaged = series;
  damaged[damaged.find('\n') + 1] = 'x';
  put(root / "run/series.csv", damaged);
  EXPECT_TRUE(has(error_of([&] { RunFolder::reopen(root / "run", 2, {}); }), "series.csv:2: damaged row"));
  put(root / "run/series.csv", "time,step\n");
  EXPECT_TRUE(has(error_of([&] { RunFolder::reopen(root / "run", 0, {}); }), "series.csv:1"));
  EXPECT_TRUE(has(error_of([&] { RunFolder::reopen(root / "nowhere", 0, {}); }), "holds no run"));
}

}  // namespace
}  // namespace platen
