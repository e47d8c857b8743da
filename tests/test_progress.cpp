// What a run prints while it goes, and how many cores it thinks it has.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <limits>

#include "program.h"
#include "protocol/progress.h"
#include "protocol/run_command.h"
#include "protocol/usable_cores.h"
#include "protocol/usage_error.h"

namespace platen::test {
namespace {

Progress sample_progress(double wall_seconds = 0.0) {
  Progress p;
  p.stage = "compress", p.stage_number = 3, p.stages = 6;
  p.time = 3.2144, p.fraction = 0.62, p.seconds_left = 200.0, p.wall_seconds = wall_seconds;
  p.particle_steps_per_second = 37.24e6;
  p.row.strain = 0.0321;
  p.row.measures.stress_top = 12345.0, p.row.measures.porosity = 0.3821, p.row.measures.coordination_number = 5.913;
  return p;
}

// Everything that a printer writes to a stream that is no terminal.
class Stream {
 public:
  Stream() : file_(std::tmpfile()) {}
  ~Stream() { std::fclose(file_); }
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;
  std::FILE* file() { return file_; }
  std::string text() {
    std::string all(static_cast<std::size_t>(std::ftell(file_)), '\0');
    std::rewind(file_);
    all.resize(std::fread(all.data(), 1, all.size(), file_));
    return all;
  }

 private:
  std::FILE* file_;
};

TEST(Progress, DurationsReadWell) {
  EXPECT_EQ(duration_text(0.42), "0.4 s");
  EXPECT_EQ(duration_text(9.96), "10 s");
  EXPECT_EQ(duration_text(59.4), "59 s");
  EXPECT_EQ(duration_text(59.6), "1 min 00 s");
  EXPECT_EQ(duration_text(200.0), "3 min 20 s");
  EXPECT_EQ(duration_text(3599.7), "1 h 00 min");
  EXPECT_EQ(duration_text(7500.0), "2 h 05 min");
  EXPECT_EQ(duration_text(76.0 * 3600.0), "3 d 4 h");
  EXPECT_EQ(duration_text(std::numeric_limits<double>::quiet_NaN()), "-");
  EXPECT_EQ(duration_text(std::numeric_limits<double>::infinity()), "-");
}

TEST(Progress, LineHoldsEverythingWhereThereIsRoom) {
  EXPECT_EQ(progress_line(sample_progress(), 200),
            "3/6 compress  [######----]  62 %  t 3.214 s  12.35 kPa  strain 3.21 %  porosity 0.382  CN 5.91  "
            "37.2 M particle-steps/s  3 min 20 s left");
}

TEST(Progress, LineLeavesOutWhatIsNotKnown) {
  Progress p;
  p.stage = "fill", p.stages = 2;
  p.row.measures.porosity = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(progress_line(p, 200), "1/2 fill  t 0.000 s  0.00 kPa  CN 0.00");
}

TEST(Progress, LineFitsAnyTerminal) {
  for (std::size_t columns = 1; columns < 150; ++columns) EXPECT_LE(progress_line(sample_progress(), columns).size(), columns);
  const std::string narrow = progress_line(sample_progress(), 60);
  for (const char* const wanted : {"3/6 compress", "62 %", "3 min 20 s left"})
    EXPECT_NE(narrow.find(wanted), std::string::npos) << narrow;
}

TEST(Progress, LinesEveryTenSecondsWithoutATerminal) {
  Stream stream;
  ProgressPrinter printer(stream.file(), ProgressPrinter::Style::lines, {"fill", "compress"});
  for (int k = 0; k <= 250; ++k) printer.update(sample_progress(0.1 * k));
  const std::string text = stream.text();
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 2);
  EXPECT_EQ(text.find('\r'), std::string::npos);
}

TEST(Progress, InPlaceOneLineIsRewritten) {
  Stream stream;
  {
    ProgressPrinter printer(stream.file(), ProgressPrinter::Style::in_place, {"fill", "compress"});
    printer.update(sample_progress(0.0));
    printer.update(sample_progress(0.01));  // too soon
    printer.update(sample_progress(0.5));
    StageResult stage;
    stage.name = "compress", stage.end_reason = "stress 40 kPa reached", stage.time_end = 2.0, stage.wall_seconds = 75.0;
    stage.warnings = {"too fast"};
    printer.stage_closed(stage);
  }
  const std::string text = stream.text(), begin = "\r3/6 compress";
  std::size_t times = 0;
  for (auto at = text.find(begin); at != std::string::npos; at = text.find(begin, at + 1)) ++times;
  EXPECT_EQ(times, 2u) << text;
  // The line in place is gone before the one that stays; nothing is cleared twice.
  const auto closed = text.find("\r\x1b[K2/2 compress: stress 40 kPa reached; 2.000 s simulated in 1 min 15 s");
  EXPECT_NE(closed, std::string::npos) << text;
  EXPECT_EQ(text.substr(text.size() - std::string("warning: compress: too fast\n").size()), "warning: compress: too fast\n");
}

TEST(Progress, QuietIsQuiet) {
  Stream stream;
  ProgressPrinter printer(stream.file(), ProgressPrinter::Style::quiet, {"compress"});
  printer.update(sample_progress(0.0));
  printer.update(sample_progress(100.0));
  printer.stage_closed(StageResult{});
  EXPECT_EQ(stream.text(), "");
  EXPECT_EQ(progress_style(stream.file(), false), ProgressPrinter::Style::lines) << "a file is no terminal";
  EXPECT_FALSE(may_colour(stream.file()));
}

TEST(WallTime, UnitsAndPlainSeconds) {
  EXPECT_EQ(parse_walltime("90 s"), 90.0);
  EXPECT_EQ(parse_walltime("10 min"), 600.0);
  EXPECT_EQ(parse_walltime("2 h"), 7200.0);
  EXPECT_EQ(parse_walltime("1.5"), 1.5);
  for (const char* const text : {"", "-1", "0", "0 s", "nan", "inf", "10 mm", "soon", "10 min 5 s"})
    EXPECT_THROW(parse_walltime(text), UsageError) << text;
}

// A tree of /proc and /sys with the given cgroup line and limits.
class FakeSystem : public TemporaryFolder {
 public:
  explicit FakeSystem(const std::string& groups) { put("proc/self/cgroup", groups); }
  void put(const std::string& file, const std::string& text) {
    std::filesystem::create_directories((*this / file).parent_path());
    write_file(*this / file, text);
  }
};

class UsableCores : public ::testing::Test {
 protected:
  void SetUp() override { unsetenv("SLURM_CPUS_PER_TASK"); }
  void TearDown() override { unsetenv("SLURM_CPUS_PER_TASK"); }
  const FakeSystem free_{""};
  const int all_ = usable_cores(free_.path());  // of the affinity mask alone
};

TEST_F(UsableCores, SecondVersionOfControlGroups) {
  FakeSystem system("0::/a/b\n");
  EXPECT_EQ(usable_cores(system.path()), all_) << "no limit is written anywhere";
  system.put("sys/fs/cgroup/a/b/cpu.max", "max 100000\n");
  EXPECT_EQ(usable_cores(system.path()), all_);
  system.put("sys/fs/cgroup/a/cpu.max", "150000 100000\n");
  EXPECT_EQ(usable_cores(system.path()), 1) << "of a core and a half one can be kept busy";
  system.put("sys/fs/cgroup/a/cpu.max", "50000 100000\n");
  EXPECT_EQ(usable_cores(system.path()), 1) << "never none";
  system.put("sys/fs/cgroup/a/cpu.max", "99900000 100000\n");
  EXPECT_EQ(usable_cores(system.path()), all_) << "more than there are";
}

TEST_F(UsableCores, LimitOfAContainerStandsAtTheMountPoint) {
  FakeSystem system("0::/../elsewhere\n");
  system.put("sys/fs/cgroup/cpu.max", "100000 100000\n");
  EXPECT_EQ(usable_cores(system.path()), 1);
}

TEST_F(UsableCores, FirstVersionOfControlGroups) {
  FakeSystem system("3:memory:/x\n4:cpu,cpuacct:/job\n");
  system.put("sys/fs/cgroup/cpu,cpuacct/job/cpu.cfs_quota_us", "-1\n");
  system.put("sys/fs/cgroup/cpu,cpuacct/job/cpu.cfs_period_us", "100000\n");
  EXPECT_EQ(usable_cores(system.path()), all_);
  system.put("sys/fs/cgroup/cpu,cpuacct/job/cpu.cfs_quota_us", "100000\n");
  EXPECT_EQ(usable_cores(system.path()), 1);
}

TEST_F(UsableCores, Slurm) {
  setenv("SLURM_CPUS_PER_TASK", "1", 1);
  EXPECT_EQ(usable_cores(free_.path()), 1);
  for (const char* const text : {"100000", "", "many"}) {
    setenv("SLURM_CPUS_PER_TASK", text, 1);
    EXPECT_EQ(usable_cores(free_.path()), all_) << text;
  }
}

}  // namespace
}  // namespace platen::test
