// Frames for ParaView: what VTK's own reader finds in them is the bed at that time; they change nothing and survive an interruption.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/experiment_case.h"

namespace platen::test {
namespace {

namespace fs = std::filesystem;

int check(const fs::path& folder) { return std::system((PLATEN_PYTHON " " PLATEN_SOURCE_DIR "/tests/check_frames.py " + folder.string() + " >/dev/null 2>&1").c_str()); }

TEST(Frames, VtkReadsTheBed) {
  TemporaryFolder root;
  write_file(root / "case.toml", small_bed + "frames = \"20 ms\"\n" + fill + quick_settle + press + unload);
  const std::string file = (root / "case.toml").string(), run = (root / "run").string();
  ProgramResult result = run_program({"run", file, "-o", run, "-q", "--no-report"});
  ASSERT_EQ(result.exit_code, 0) << result.report();
  EXPECT_EQ(std::system((PLATEN_PYTHON " " PLATEN_SOURCE_DIR "/tests/check_frames.py " + run).c_str()), 0);
  // The same bits without frames.
  result = run_program({"run", file, "-o", (root / "without").string(), "-q", "--no-report", "--set", "output.frames=\"off\""});
  ASSERT_EQ(result.exit_code, 0) << result.report();
  EXPECT_EQ(read_file(root / "run/series.csv"), read_file(root / "without/series.csv"));
  EXPECT_FALSE(fs::exists(root / "without/frames.hdf.series"));
  // In one stage alone, and a run that was stopped and goes on: the same files, byte by byte.
  result = run_program({"run", file, "-o", (root / "one").string(), "-q", "--no-report", "--set", "output.frames=\"off\"", "--set", "stage.compress.frames=\"10 ms\""});
  ASSERT_EQ(result.exit_code, 0) << result.report();
  const CsvTable series = read_csv(root / "one/series.csv");
  double begin = 1e9, end = 0.0;
  for (std::size_t k = 0; k < series.rows.size(); ++k)
    if (series.cell(k, "stage") == "compress") begin = std::min(begin, series.number(k, "time")), end = std::max(end, series.number(k, "time"));
  const auto frames = nlohmann::json::parse(read_file(root / "one/frames.hdf.series")).at("files");
  EXPECT_EQ(frames.front().at("time"), begin);
  EXPECT_EQ(frames.back().at("time"), end);
  EXPECT_GT(frames.size(), 3u);
  result = run_program({"run", file, "-o", (root / "broken").string(), "-q", "--no-report", "--stop-after", "settle"});
  ASSERT_EQ(result.exit_code, 0) << result.report();
  result = run_program({"resume", (root / "broken").string(), "-q", "--no-report", "--max-walltime", "1e-9"});
  ASSERT_EQ(result.exit_code, 75) << result.report();
  result = run_program({"resume", (root / "broken").string(), "-q", "--no-report"});
  ASSERT_EQ(result.exit_code, 0) << result.report();
  EXPECT_EQ(read_file(root / "run/frames.hdf.series"), read_file(root / "broken/frames.hdf.series"));
  for (const auto& entry : fs::directory_iterator(root / "run/frames")) EXPECT_EQ(read_file(entry.path()), read_file(root / "broken/frames" / entry.path().filename())) << entry.path();
  // The script notices a difference, or it proves nothing.
  fs::copy_file(root / "run/frames/000002.hdf", root / "run/frames/000001.hdf", fs::copy_options::overwrite_existing);
  const std::string last = (root / "run/frames").string() + "/" + [&] {
    std::string name;
    for (const auto& entry : fs::directory_iterator(root / "run/frames")) name = std::max(name, entry.path().filename().string());
    return name;
  }();
  fs::copy_file(root / "run/frames/000002.hdf", last, fs::copy_options::overwrite_existing);
  EXPECT_NE(check(root / "run"), 0);
}

}  // namespace
}  // namespace platen::test
