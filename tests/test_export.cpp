// `platen export`: other programs' readers find the numbers of results.h5, to the bit; a case reads the CSV again.
#include <gtest/gtest.h>

#include "tests/experiment_case.h"

namespace platen::test {
namespace {

namespace fs = std::filesystem;

TEST(Export, OtherReadersFindTheSameNumbers) {
  TemporaryFolder root;
  write_file(root / "case.toml", small_bed + fill + quick_settle + press + unload + "[[stage]]\nkind = \"release\"\nuntil = { kinetic_to_potential = 1e-3, window = \"5 ms\" }\n");
  const std::string run = (root / "run").string(), out = (root / "out").string();
  ProgramResult result = run_program({"run", (root / "case.toml").string(), "-o", run, "-q", "--no-report"});
  ASSERT_EQ(result.exit_code, 0) << result.report();
  for (const char* format : {"csv", "vtu", "lammps", "h5md"}) {
    result = run_program({"export", run, "--to", format, "-o", out});
    ASSERT_EQ(result.exit_code, 0) << result.report();
    std::istringstream names(result.out);
    for (std::string name; std::getline(names, name);) EXPECT_TRUE(fs::exists(name)) << name;
  }
  const std::string check = PLATEN_PYTHON " " PLATEN_SOURCE_DIR "/tests/check_export.py " + run + " " + out;
  EXPECT_EQ(std::system(check.c_str()), 0);
  // The settled bed as the start of another case: the same places to the bit.
  write_file(root / "out/again.toml", table_case(time_passes("10 us"), "[box]\nwidth = \"20 mm\"\ndepth = \"20 mm\"\nheight = \"80 mm\"\n"));
  result = run_program({"run", (root / "out/again.toml").string(), "-o", (root / "again").string(), "-q", "--no-report", "--set", "particles.file=\"2-settle.csv\"", "--set", "environment.gravity=9.81"});
  ASSERT_EQ(result.exit_code, 0) << result.report();
  const CsvTable settled = read_csv(root / "out/2-settle.csv");
  const Dataset<double> first = ResultsFile(root / "again/results.h5").doubles("/stages/run/particles/position");
  for (std::size_t k = 0; k < settled.rows.size(); ++k) {
    EXPECT_EQ(settled.number(k, "density"), 2000.0);
    for (std::size_t axis = 0; axis < 3; ++axis)  // one step later
      EXPECT_NEAR(first.at(k, axis), settled.number(k, axis == 0 ? "x" : axis == 1 ? "y" : "z") + 1e-5 * settled.number(k, axis == 0 ? "vx" : axis == 1 ? "vy" : "vz"), 1e-6);
  }
  // A former run's files do not outlive it; what is not platen's does.
  ASSERT_EQ(run_program({"export", run, "--to", "csv", "-q"}).exit_code, 0);
  write_file(root / "run/export/notes.txt", "mine");
  ASSERT_EQ(run_program({"run", (root / "case.toml").string(), "-o", run + "2", "-q", "--no-report"}).exit_code, 0);
  fs::copy(root / "run/export", root / "run2/export");
  ASSERT_EQ(run_program({"run", (root / "case.toml").string(), "-o", run + "2", "-q", "--no-report", "--force", "--stop-after", "fill"}).exit_code, 0);
  EXPECT_EQ(std::distance(fs::directory_iterator(root / "run2/export"), fs::directory_iterator{}), 1);
  // The script notices a difference.
  fs::copy_file(root / "out/2-settle.vtu", root / "out/3-compress.vtu", fs::copy_options::overwrite_existing);
  EXPECT_NE(std::system((check + " 2>/dev/null").c_str()), 0);
}

TEST(Export, SaysWhatIsWrong) {
  TemporaryFolder root;
  const auto fails = [&](const std::vector<std::string>& words, int code, const std::string& said) {
    const ProgramResult result = run_program(words);
    EXPECT_EQ(result.exit_code, code) << result.report();
    EXPECT_NE(result.err.find(said), std::string::npos) << said << "\n" << result.err;
  };
  const std::string run = (root / "run").string();
  fails({"export", run, "--to", "csv"}, 5, "is not a run folder");
  fails({"export", run, "--to", "xls"}, 2, "csv");
  fails({"export", run}, 2, "--to");
  fs::create_directories(root / "run");
  write_file(root / "run/case.toml", small_bed + fill);
  fails({"export", run, "--to", "csv"}, 5, "no stage has ended");
}

}  // namespace
}  // namespace platen::test
