// Checkpoints and `platen resume`: whatever interrupts a run, and wherever, what it leaves in the end is what an
// uninterrupted one leaves, bit for bit.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <random>

#include "protocol/output/checkpoint_file.h"
#include "protocol/output/hdf5_file.h"
#include "tests/experiment_case.h"

namespace platen::test {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

std::string replaced(const std::string& from, const std::string& to, std::string text) {
  const std::size_t at = text.find(from);
  if (at == std::string::npos) throw std::logic_error("no " + from);
  return text.replace(at, from.size(), to);
}

// What a summary says of the experiment, without what the clock or the lists say.
Json facts(const fs::path& folder) {
  Json summary = Json::parse(read_file(folder / "summary.json"));
  summary.erase("performance");
  for (Json& stage : summary.at("stages")) stage.erase("particle_steps_per_second");
  return summary;
}

void expect_same_group(const Hdf5Group& a, const Hdf5Group& b, const std::string& path) {
  ASSERT_EQ(a.names(), b.names()) << path;
  for (const std::string& name : a.names()) {
    const std::string here = path + name;
    ASSERT_EQ(a.is_group(name), b.is_group(name)) << here;
    for (const char* fact : {"end_reason", "kind", "warnings"}) ASSERT_EQ(a.text_attribute(name, fact), b.text_attribute(name, fact)) << here;
    for (const char* fact : {"first_step", "last_step", "number"}) ASSERT_EQ(a.integer_attribute(name, fact, -1), b.integer_attribute(name, fact, -1)) << here;
    if (a.is_group(name)) {
      expect_same_group(a.group(name), b.group(name), here + "/");
      continue;
    }
    const Hdf5Shape shape = a.shape(name);
    ASSERT_EQ(shape.size, b.shape(name).size) << here;
    ASSERT_EQ(shape.type, b.shape(name).type) << here;
    if (shape.type == "float64") {
      const auto x = a.read<double>(name), y = b.read<double>(name);
      for (std::size_t k = 0; k < x.size(); ++k) ASSERT_TRUE(x[k] == y[k] || (std::isnan(x[k]) && std::isnan(y[k]))) << here << ", number " << k << ": " << x[k] << ", " << y[k];
    } else if (shape.type == "string") {
      ASSERT_EQ(a.read_text(name), b.read_text(name)) << here;
    } else if (shape.type == "enum") {
      const bool small = name == "branch" || name == "plate";
      if (small) {
        ASSERT_EQ(a.read<std::int8_t>(name), b.read<std::int8_t>(name)) << here;
      } else {
        ASSERT_EQ(a.read<std::int32_t>(name), b.read<std::int32_t>(name)) << here;
      }
    } else {
      ASSERT_EQ(a.read<std::int64_t>(name), b.read<std::int64_t>(name)) << here;
    }
  }
}

void expect_same_run(const fs::path& whole, const fs::path& broken) {
  EXPECT_EQ(read_file(whole / "series.csv"), read_file(broken / "series.csv"));
  EXPECT_EQ(facts(whole), facts(broken));
  const Hdf5File a = Hdf5File::open(whole / "results.h5"), b = Hdf5File::open(broken / "results.h5");
  expect_same_group(a.root(), b.root(), "/");
  ASSERT_EQ(fs::exists(whole / "frames.hdf.series"), fs::exists(broken / "frames.hdf.series"));
  if (!fs::exists(whole / "frames.hdf.series")) return;
  EXPECT_EQ(read_file(whole / "frames.hdf.series"), read_file(broken / "frames.hdf.series"));
  const auto count = [](const fs::path& folder) { return std::distance(fs::directory_iterator(folder), fs::directory_iterator{}); };
  EXPECT_EQ(count(whole / "frames"), count(broken / "frames"));
  for (const auto& entry : fs::directory_iterator(whole / "frames"))
    EXPECT_EQ(read_file(entry.path()), read_file(broken / "frames" / entry.path().filename())) << entry.path();
}

// Stopped, killed, or told to keep a checkpoint and killed, at random, on one thread and on two, until it is done: at the
// first look at the clock to begin with, so that the fastest machine does not finish before, then within `most` [ms].
// Returns how often it went on from a checkpoint.
int run_with_interruptions(const fs::path& folder, const std::vector<std::string>& first, unsigned most, const ProgramOptions& options, unsigned seed) {
  std::mt19937 random(seed);
  int resumed = 0;
  bool going = false;
  for (int attempt = 0; attempt < 200; ++attempt) {
    std::vector<std::string> words = going ? std::vector<std::string>{"resume", folder.string(), "-q", "--no-report"} : first;
    words.insert(words.end(), {"--threads", random() % 2 ? "1" : "2"});
    if (attempt == 0) words.insert(words.end(), {"--max-walltime", "1e-9"});
    RunningProgram program(words, options);
    if (attempt > 0) {
      const auto wait = [&](unsigned longest) { std::this_thread::sleep_for(std::chrono::milliseconds(random() % longest + 5)); };
      wait(most);
      const unsigned how = random() % 3;
      if (how == 0) {
        program.send(SIGUSR1);
        wait(most / 2 + 1);
      }
      program.send(how == 2 ? SIGTERM : SIGKILL);
    }
    const ProgramResult result = program.wait(120.0);
    EXPECT_TRUE(attempt > 0 || result.exit_code == 75) << result.report();
    if (result.exit_code == 0) return resumed + going;
    if (result.exit_code == 5) {
      EXPECT_TRUE(has(result.err, "holds no checkpoint")) << result.report();
      going = false;
      continue;
    }
    if (result.exit_code != 75) {
      EXPECT_NE(result.signal, 0) << result.report();  // also one that came before the program could catch any
    }
    resumed += going;
    if (going) {
      EXPECT_TRUE(fs::exists(folder / "checkpoint.h5") || fs::exists(folder / "checkpoint.prev.h5") || fs::exists(folder / "summary.json")) << "nothing to go on from any more";
    }
    going = fs::exists(folder / "checkpoint.h5") || fs::exists(folder / "checkpoint.prev.h5");
  }
  ADD_FAILURE() << "never done";
  return resumed;
}

struct ResumeCase {
  const char* name;
  std::string text;
};

void PrintTo(const ResumeCase& c, std::ostream* out) { *out << c.name; }

// The whole protocol, automatic step.
const std::string every_stage = replaced("step = \"10 us\"", "step = \"auto\"", small_bed) + "frames = \"10 ms\"\n" + fill + "[[stage]]\nkind = \"vibrate\"\nfrequency = 60.0\namplitude = 1e-3\nduration = 0.1\n" + quick_settle + press +
                                "[[stage]]\nkind = \"hold\"\nstress = \"20 kPa\"\nduration = \"80 ms\"\n" + unload +
                                "[[stage]]\nkind = \"release\"\nuntil = { kinetic_to_potential = 1e-4, window = \"20 ms\" }\n"
                                "[[stage]]\nkind = \"crush\"\nspeed = \"50 mm/s\"\nstart_gap = \"0.1 mm\"\nuntil = { strain = 0.1, drop = 0.2 }\n";

// Unequal spheres between walls, exponent 3/2, a fixed step.
const std::string walls = replaced("count = 100", "count = 300", replaced("sides = \"periodic\"", "sides = \"walls\"",
                                   replaced("height = \"80 mm\"\n", "height = \"80 mm\"\nsides = \"periodic\"\n",
                                            replaced("radius = \"2.5 mm\"", "sizes = { kind = \"uniform\", min = \"1.8 mm\", max = \"2.5 mm\" }",
                                                     replaced("k1 = \"5 kN/m\"\nk2 = \"25 kN/m\"\nk_adh = \"5 kN/m\"", "k1 = 2e5\nk2 = 4e5\nexponent = 1.5", small_bed))))) +
                          fill + quick_settle + press + unload;

// Cohesive spheres through an outlet.
const std::string slow_rain = small_bed + "[[stage]]\nkind = \"fill\"\nduration = \"0.5 s\"\noutlet = \"40 mm\"\n" + quick_settle;

class Resume : public ::testing::TestWithParam<ResumeCase> {};

TEST_P(Resume, InterruptedAtRandomItLeavesTheSame) {
  TemporaryFolder root;
  write_file(root / "case.toml", GetParam().text);
  const auto begin = std::chrono::steady_clock::now();
  const ProgramResult whole = run_program({"run", (root / "case.toml").string(), "-o", (root / "whole").string(), "--threads", "1", "-q", "--no-report"});
  ASSERT_EQ(whole.exit_code, 0) << whole.report();
  EXPECT_FALSE(fs::exists(root / "whole/checkpoint.h5"));
  // Several interruptions on the way, on a fast machine and on a slow one.
  const auto took = std::chrono::duration_cast<std::chrono::milliseconds>(std::chrono::steady_clock::now() - begin).count();
  const auto most = static_cast<unsigned>(std::max<std::int64_t>(took / 2, 10));
  int resumed = 0;
  for (int repeat = 0; repeat < 2; ++repeat) {
    const unsigned seed = std::random_device{}();
    SCOPED_TRACE("seed " + std::to_string(seed));
    const fs::path folder = root / ("broken" + std::to_string(repeat));
    resumed += run_with_interruptions(folder, {"run", (root / "case.toml").string(), "-o", folder.string(), "-q", "--no-report", "--force"}, most, {}, seed);
    expect_same_run(root / "whole", folder);
    EXPECT_FALSE(fs::exists(folder / "checkpoint.h5")) << "nothing is left to do";
    if (HasFailure()) return;
  }
  EXPECT_GT(resumed, 0) << "it was never interrupted: the test shows nothing";
}

INSTANTIATE_TEST_SUITE_P(Cases, Resume, ::testing::Values(ResumeCase{"EveryStage", every_stage}, ResumeCase{"WallsUnequalExponent", walls}, ResumeCase{"SlowRain", slow_rain}),
                         [](const auto& chosen) { return std::string(chosen.param.name); });

TEST(ResumeCommand, AfterEachStageWithoutTheParticleFile) {
  TemporaryFolder root;
  // 4 x 4 x 4 spheres of two sizes, their densities unequal; the file is gone when the run goes on.
  std::string table = "id,x,y,z,radius,density\n";
  for (int k = 0; k < 64; ++k)
    table += std::to_string(200 - 3 * k) + "," + exact(0.003 + 0.005 * (k % 4)) + "," + exact(0.003 + 0.005 * (k / 4 % 4) + 1e-5 * k) + "," + exact(0.003 + 0.0052 * (k / 16)) + "," + (k % 2 ? "0.0025" : "0.002") + "," +
             (k % 3 ? "2000" : "1500") + "\n";
  write_file(root / "spheres.csv", table);
  write_file(root / "case.toml", table_case(quick_settle + press + unload, "[box]\nwidth = \"20 mm\"\ndepth = \"20 mm\"\nheight = \"30 mm\"\n", "9.81"));
  const std::string file = (root / "case.toml").string();
  ProgramResult result = run_program({"run", file, "-o", (root / "whole").string(), "-q", "--no-report", "--reproducible"});
  ASSERT_EQ(result.exit_code, 0) << result.report();
  result = run_program({"run", file, "-o", (root / "steps").string(), "-q", "--no-report", "--reproducible", "--stop-after", "settle"});
  ASSERT_EQ(result.exit_code, 0) << result.report();
  EXPECT_TRUE(fs::exists(root / "steps/checkpoint.h5"));
  fs::remove(root / "spheres.csv");
  result = run_program({"resume", (root / "steps").string(), "-q", "--no-report", "--stop-after", "2"});
  ASSERT_EQ(result.exit_code, 0) << result.report();
  ProgramOptions scalar;  // --reproducible was kept, so other kernels do
  scalar.environment = {{"PLATEN_ISA", "scalar"}};
  result = run_program({"resume", (root / "steps").string()}, scalar);
  ASSERT_EQ(result.exit_code, 0) << result.report();
  EXPECT_TRUE(has(result.out, "report: ")) << result.out;
  expect_same_run(root / "whole", root / "steps");
  result = run_program({"resume", (root / "steps").string()});
  EXPECT_EQ(result.exit_code, 0) << result.report();
  EXPECT_TRUE(has(result.err, "nothing is left to do")) << result.err;
}

TEST(ResumeCommand, SaysWhatIsWrong) {
  TemporaryFolder root;
  write_file(root / "case.toml", small_bed + fill + quick_settle + press);
  const fs::path run = root / "run";
  const std::vector<std::string> start = {"run", (root / "case.toml").string(), "-o", run.string(), "-q", "--no-report", "--force", "--stop-after", "settle"};
  const auto fails = [&](int code, const std::string& said) {
    const ProgramResult result = run_program({"resume", run.string(), "--no-report", "-q"});
    EXPECT_EQ(result.exit_code, code) << result.report();
    EXPECT_TRUE(has(result.err, said)) << said << "\n" << result.err;
  };
  fails(5, "is not a run folder");
  ASSERT_EQ(run_program(start).exit_code, 0);
  fs::remove(run / "checkpoint.h5");
  fs::remove(run / "summary.json");
  fails(5, "holds no checkpoint to go on from");
  ASSERT_EQ(run_program(start).exit_code, 0);
  const std::string series = read_file(run / "series.csv");
  // The case was changed meanwhile.
  write_file(run / "case.toml", replaced("friction = 0.5", "friction = 0.4", small_bed + fill + quick_settle + press));
  fails(3, "is not the case that the run was begun with");
  write_file(run / "case.toml", small_bed + "[[stage]]\n");
  fails(3, "kind");
  EXPECT_EQ(read_file(run / "series.csv"), series) << "nothing was touched";
  write_file(run / "case.toml", small_bed + fill + quick_settle + press);
  // Other kernels would round differently.
  ProgramOptions options;
  const std::string whole = read_file(run / "checkpoint.h5");
  Checkpoint other = read_checkpoint(run / "checkpoint.h5");
  other.instruction_set = "avx9000";
  write_checkpoint(run, other);
  fails(5, "avx9000 kernels, which this processor does not have");
  // The newest is damaged: the one before serves, and it is said. Both damaged: an error.
  write_file(run / "checkpoint.h5", whole.substr(0, whole.size() - 1));
  write_file(run / "checkpoint.prev.h5", whole);
  ProgramResult result = run_program({"resume", run.string(), "--no-report"});
  EXPECT_EQ(result.exit_code, 0) << result.report();
  EXPECT_TRUE(has(result.err, "checkpoint.h5: is damaged, or no checkpoint; going on from the checkpoint before it")) << result.err;
  // A damaged one does not become the one before.
  ASSERT_EQ(run_program(start).exit_code, 0);
  const std::string good = read_file(run / "checkpoint.h5");
  write_file(run / "checkpoint.prev.h5", good);
  write_file(run / "checkpoint.h5", "x");
  write_checkpoint(run, read_checkpoint(run / "checkpoint.prev.h5"));
  EXPECT_EQ(read_file(run / "checkpoint.prev.h5"), good);
  EXPECT_EQ(read_file(run / "checkpoint.h5"), good);
  // Written whole and not yet named: it is the newest.
  fs::rename(run / "checkpoint.h5", run / "checkpoint.new");
  std::string none;
  EXPECT_EQ(newest_checkpoint(run, none).bed.step, read_checkpoint(run / "checkpoint.prev.h5").bed.step);
  EXPECT_EQ(none, "");
  fs::remove(run / "checkpoint.new");
  ASSERT_EQ(run_program(start).exit_code, 0);
  write_file(run / "checkpoint.h5", "x");
  write_file(run / "checkpoint.prev.h5", whole.substr(1));
  fails(5, "checkpoint.prev.h5: is damaged, or no checkpoint");
}

// A run whose last words could not be written still has its checkpoint.
TEST(ResumeCommand, CheckpointsOutliveTheSummary) {
  TemporaryFolder root;
  write_file(root / "case.toml", small_bed + fill + quick_settle);
  const fs::path run = root / "run";
  ASSERT_EQ(run_program({"run", (root / "case.toml").string(), "-o", (root / "whole").string(), "-q", "--no-report"}).exit_code, 0);
  ASSERT_EQ(run_program({"run", (root / "case.toml").string(), "-o", run.string(), "-q", "--no-report", "--stop-after", "fill"}).exit_code, 0);
  fs::create_directories(run / "summary.json.tmp/in the way");
  EXPECT_EQ(run_program({"resume", run.string(), "-q", "--no-report"}).exit_code, 5);
  fs::remove_all(run / "summary.json.tmp");
  const ProgramResult result = run_program({"resume", run.string(), "-q", "--no-report"});
  EXPECT_EQ(result.exit_code, 0) << result.report();
  expect_same_run(root / "whole", run);
}

// Right after the last step of a stage: what is written of its end is found from the checkpoint alone.
TEST(ResumeCommand, FromTheLastStepOfAStage) {
  TemporaryFolder root;
  const std::string text = small_bed + fill + "[[stage]]\nkind = \"run\"\nname = \"short\"\nduration = \"0.32 ms\"\n" + time_passes("0.64 ms");
  write_file(root / "case.toml", text);
  const std::string file = (root / "case.toml").string();
  const fs::path run = root / "run";
  ASSERT_EQ(run_program({"run", file, "-o", (root / "whole").string(), "-q", "--no-report"}).exit_code, 0);
  ASSERT_EQ(run_program({"run", file, "-o", run.string(), "-q", "--no-report", "--stop-after", "fill"}).exit_code, 0);
  int stops = 0;
  for (int code = 75; code == 75 && stops < 20; ++stops) {  // one advance each
    code = run_program({"resume", run.string(), "-q", "--no-report", "--max-walltime", "1e-9"}).exit_code;
    ASSERT_TRUE(code == 75 || code == 0) << code;
  }
  EXPECT_GE(stops, 3);
  expect_same_run(root / "whole", run);
}

// A checkpoint, more frames, kill -9: frames behind the checkpoint are gone until the run comes by there again, also where the
// list is lost.
TEST(ResumeCommand, FramesBehindTheCheckpoint) {
  TemporaryFolder root;
  write_file(root / "case.toml", small_bed + "frames = \"5 ms\"\n" + fill + quick_settle + press);
  const std::string file = (root / "case.toml").string();
  const fs::path run = root / "run";
  ASSERT_EQ(run_program({"run", file, "-o", (root / "whole").string(), "-q", "--no-report"}).exit_code, 0);
  ASSERT_EQ(run_program({"run", file, "-o", run.string(), "-q", "--no-report", "--stop-after", "fill"}).exit_code, 0);
  fs::copy_file(run / "checkpoint.h5", root / "kept.h5");
  ASSERT_EQ(run_program({"resume", run.string(), "-q", "--no-report", "--stop-after", "settle"}).exit_code, 0);
  const auto listed = [&] { return Json::parse(read_file(run / "frames.hdf.series")).at("files").size(); };
  const std::size_t later = listed();
  fs::copy_file(root / "kept.h5", run / "checkpoint.h5", fs::copy_options::overwrite_existing);
  fs::remove(run / "checkpoint.prev.h5");
  fs::remove(run / "frames.hdf.series");
  ASSERT_EQ(run_program({"resume", run.string(), "-q", "--no-report", "--max-walltime", "1e-9"}).exit_code, 75);
  EXPECT_LT(listed(), later);
  EXPECT_EQ(listed(), static_cast<std::size_t>(std::distance(fs::directory_iterator(run / "frames"), fs::directory_iterator{})));
  ASSERT_EQ(run_program({"resume", run.string(), "-q", "--no-report"}).exit_code, 0);
  expect_same_run(root / "whole", run);
}

TEST(ResumeCommand, StopAfter) {
  TemporaryFolder root;
  write_file(root / "case.toml", small_bed + fill + quick_settle + time_passes("1 ms"));
  const fs::path run = root / "run";
  ASSERT_EQ(run_program({"run", (root / "case.toml").string(), "-o", run.string(), "-q", "--no-report", "--stop-after", "settle"}).exit_code, 0);
  ProgramResult result = run_program({"resume", run.string(), "--stop-after", "fill", "--no-report"});
  EXPECT_EQ(result.exit_code, 2) << result.report();
  EXPECT_TRUE(has(result.err, "has left stage \"fill\" behind; it goes on with \"run\"")) << result.err;
  result = run_program({"resume", run.string(), "--json", "--no-report", "-q"});
  EXPECT_EQ(result.exit_code, 0) << result.report();
  const std::string summary = result.out;
  result = run_program({"resume", run.string(), "--json", "--no-report"});
  EXPECT_EQ(result.out, summary) << "also of a run that is done";
  // Without the checkpoint a run that ended early is not taken for one that is done.
  ASSERT_EQ(run_program({"run", (root / "case.toml").string(), "-o", run.string(), "-q", "--no-report", "--force", "--stop-after", "settle"}).exit_code, 0);
  remove_checkpoints(run);
  result = run_program({"resume", run.string()});
  EXPECT_EQ(result.exit_code, 5) << result.report();
}

// A stage that misses its goal keeps all that it takes to go on: given more time, the run ends as if it had had that from the start.
TEST(ResumeCommand, AMissedGoalGoesOnWithMoreTime) {
  TemporaryFolder root;
  write_file(root / "case.toml", small_bed + "frames = \"5 ms\"\n" + fill + quick_settle + press + unload);
  const fs::path run = root / "run";
  const auto from_start = [&](const fs::path& folder, const std::string& longest) {
    return run_program({"run", (root / "case.toml").string(), "-o", folder.string(), "--no-report", "--set", "stage.compress.max_duration=" + longest});
  };
  ASSERT_EQ(from_start(root / "whole", "60.5").exit_code, 0);
  // Between two looks, at none that is on the grid.
  ProgramResult result = from_start(run, "0.02007");
  EXPECT_EQ(result.exit_code, 6) << result.report();
  EXPECT_TRUE(has(result.err, "`platen resume " + run.string() + " --set stage.compress.max_duration=...` goes on with a longer one")) << result.err;
  EXPECT_EQ(run_program({"resume", run.string(), "--no-report"}).exit_code, 6) << "as it is, it misses the goal again";
  const auto with = [&](const std::string& change) { return run_program({"resume", run.string(), "--no-report", "--set", change}); };
  result = with("stage.compress.speed=0.1");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_TRUE(has(result.err, "--set: stage.compress.speed stays as it is in a run that goes on; allowed: stage.NAME.max_duration, or a new run")) << result.err;
  result = with("stage.settle.max_duration=70");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_TRUE(has(result.err, "--set: stage \"settle\" is over; allowed: stages from \"compress\" on")) << result.err;
  EXPECT_EQ(with("stage.compress.max_duration=-1").exit_code, 3);
  result = with("stage.compress.max_duration = 0.001");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_TRUE(has(result.err, "stage.compress.max_duration = 0.001 s is less than it was; allowed: more than 0.02007 s")) << result.err;
  const std::string before = read_file(run / "case.toml");
  EXPECT_EQ(with("stage.compress.max_duration=0.03").exit_code, 6) << "once more, since it was not enough";
  // As if killed before the case was written.
  write_file(run / "case.toml", before);
  EXPECT_EQ(run_program({"resume", run.string(), "--no-report"}).exit_code, 3);
  EXPECT_EQ(with("stage.compress.max_duration=0.03").exit_code, 6);
  result = with("stage.compress.max_duration=60.5");
  EXPECT_EQ(result.exit_code, 0) << result.report();
  expect_same_run(root / "whole", run);
  EXPECT_EQ(read_file(root / "whole/case.toml"), read_file(run / "case.toml"));
}

TEST(ResumeCommand, ACheckpointThatCannotBeWrittenIsAWarning) {
  TemporaryFolder root;
  write_file(root / "case.toml", small_bed + fill + quick_settle);
  const fs::path run = root / "run";
  fs::create_directories(run);
  RunningProgram program({"run", (root / "case.toml").string(), "-o", run.string(), "--no-report", "--force"}, {});
  const auto log = [&] { return fs::exists(run / "log.jsonl") ? read_file(run / "log.jsonl") : std::string(); };
  for (int k = 0; k < 10000 && !has(log(), "\"start\""); ++k) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  fs::create_directories(run / "checkpoint.body/in the way");
  for (int k = 0; k < 10000 && !has(log(), "checkpoint failed") && !has(log(), "\"end\""); ++k) {
    program.send(SIGUSR1);
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  const ProgramResult result = program.wait(120.0);
  EXPECT_EQ(result.exit_code, 0) << result.report();
  EXPECT_TRUE(has(result.out, "a checkpoint could not be written")) << result.report();
}

// ---- `platen run --from`: a bed that is made once and then goes different ways

const std::string bed_and_more = small_bed + "frames = \"10 ms\"\n" + fill + quick_settle + press + unload;

TEST(RunFrom, LeavesWhatAWholeRunLeaves) {
  TemporaryFolder root;
  write_file(root / "case.toml", bed_and_more);
  const std::string file = (root / "case.toml").string(), bed = (root / "bed").string();
  ASSERT_EQ(run_program({"run", file, "-o", (root / "whole").string(), "-q", "--no-report"}).exit_code, 0);
  ASSERT_EQ(run_program({"run", file, "-o", bed, "-q", "--no-report", "--stop-after", "settle"}).exit_code, 0);
  const std::string series = read_file(root / "bed/series.csv"), checkpoint = read_file(root / "bed/checkpoint.h5");
  ProgramResult result = run_program({"run", file, "--from", bed, "-o", (root / "again").string(), "--no-report"});
  ASSERT_EQ(result.exit_code, 0) << result.report();
  EXPECT_TRUE(has(result.err, "after stage settle, 2 of 4 stages are left")) << result.err;
  expect_same_run(root / "whole", root / "again");
  // Stopped at once and resumed, in a folder that held another run.
  result = run_program({"run", file, "--from", bed, "-o", (root / "again").string(), "--force", "-q", "--no-report", "--max-walltime", "1e-9"});
  ASSERT_EQ(result.exit_code, 75) << result.report();
  ASSERT_EQ(run_program({"resume", (root / "again").string(), "-q", "--no-report"}).exit_code, 0);
  expect_same_run(root / "whole", root / "again");
  EXPECT_EQ(read_file(root / "bed/series.csv"), series) << "the bed is only read";
  EXPECT_EQ(read_file(root / "bed/checkpoint.h5"), checkpoint);
}

TEST(RunFrom, LaterStagesMayBeOthers) {
  TemporaryFolder root;
  write_file(root / "case.toml", bed_and_more);
  const std::string file = (root / "case.toml").string(), bed = (root / "bed").string();
  ASSERT_EQ(run_program({"run", file, "-o", bed, "-q", "--no-report", "--stop-after", "settle"}).exit_code, 0);
  // Another end, other names and fewer stages, another output.
  write_file(root / "soft.toml", small_bed + fill + quick_settle + "[[stage]]\nkind = \"compress\"\nname = \"gently\"\nspeed = \"50 mm/s\"\nuntil = { stress = \"5 kPa\" }\n");
  const std::vector<std::string> soft{"run", (root / "soft.toml").string(), "-q", "--no-report"};
  const auto with = [&](std::vector<std::string> words, const std::vector<std::string>& more) {
    words.insert(words.end(), more.begin(), more.end());
    return words;
  };
  ProgramResult result = run_program(with(soft, {"--from", bed, "-o", (root / "branch").string()}));
  ASSERT_EQ(result.exit_code, 0) << result.report();
  ASSERT_EQ(run_program(with(soft, {"-o", (root / "whole").string()})).exit_code, 0);
  EXPECT_EQ(read_file(root / "branch/series.csv"), read_file(root / "whole/series.csv"));
  EXPECT_EQ(Json::parse(read_file(root / "branch/summary.json")).at("state_hash"), Json::parse(read_file(root / "whole/summary.json")).at("state_hash"));
  EXPECT_EQ(read_file(root / "branch/case.toml"), read_file(root / "whole/case.toml"));
}

// The bed's own case may end where it does; a run of it is done and stays so.
TEST(RunFrom, ABedThatIsAllOfItsCase) {
  TemporaryFolder root;
  write_file(root / "bed.toml", small_bed + fill + quick_settle);
  write_file(root / "case.toml", small_bed + fill + quick_settle + press);
  const std::string bed = (root / "bed").string(), file = (root / "case.toml").string();
  ASSERT_EQ(run_program({"run", (root / "bed.toml").string(), "-o", bed, "-q", "--no-report", "--stop-after", "settle"}).exit_code, 0);
  const ProgramResult again = run_program({"resume", bed, "--no-report"});
  EXPECT_EQ(again.exit_code, 0) << again.report();
  EXPECT_TRUE(has(again.err, "nothing is left to do")) << again.err;
  ASSERT_EQ(run_program({"run", file, "--from", bed, "-o", (root / "branch").string(), "-q", "--no-report"}).exit_code, 0);
  ASSERT_EQ(run_program({"run", file, "-o", (root / "whole").string(), "-q", "--no-report"}).exit_code, 0);
  expect_same_run(root / "whole", root / "branch");
}

// A bed from a particle file, which is not read again, and somebody's own page where the new run goes.
TEST(RunFrom, NeedsNoParticleFileAndLeavesAForeignReport) {
  TemporaryFolder root;
  const std::string spheres = "id,x,y,z,radius,density\n0,0.01,0.01,0.0030,0.0025,2000\n1,0.01,0.01,0.0082,0.0025,2000\n";
  fs::create_directories(root / "there");
  write_file(root / "there/spheres.csv", spheres);
  write_file(root / "there/case.toml", replaced("radius = \"2.5 mm\"\n", "", replaced("density = \"2000 kg/m3\"\n", "", replaced("count = 100\n", "file = \"spheres.csv\"\n", small_bed))) + quick_settle + press);
  const std::string file = (root / "there/case.toml").string(), bed = (root / "bed").string();
  const ProgramResult made = run_program({"run", file, "-o", bed, "-q", "--no-report", "--stop-after", "settle"});
  ASSERT_EQ(made.exit_code, 0) << made.report();
  ASSERT_EQ(run_program({"run", file, "-o", (root / "whole").string(), "-q", "--no-report"}).exit_code, 0);
  fs::remove(root / "there/spheres.csv");
  fs::create_directories(root / "mine");
  write_file(root / "mine/report.html", "mine");
  const ProgramResult result = run_program({"run", file, "--from", bed, "-o", (root / "mine").string(), "--force"});
  ASSERT_EQ(result.exit_code, 0) << result.report();
  EXPECT_EQ(read_file(root / "mine/report.html"), "mine");
  EXPECT_EQ(read_file(root / "mine/series.csv"), read_file(root / "whole/series.csv"));
}

TEST(RunFrom, WhatDoesNotFitIsSaidAndNothingWritten) {
  TemporaryFolder root;
  write_file(root / "case.toml", bed_and_more);
  const std::string file = (root / "case.toml").string(), bed = (root / "bed").string(), done = (root / "done").string(), out = (root / "out").string();
  ASSERT_EQ(run_program({"run", file, "-o", bed, "-q", "--no-report", "--stop-after", "settle"}).exit_code, 0);
  ASSERT_EQ(run_program({"run", file, "-o", done, "-q", "--no-report"}).exit_code, 0);
  ASSERT_EQ(run_program({"run", file, "-o", (root / "within").string(), "-q", "--no-report", "--max-walltime", "1e-9"}).exit_code, 75);
  struct {
    std::vector<std::string> words;
    int code;
    const char* expected;
  } wrong[] = {
      {{"--from", ""}, 2, "the name of a run folder is missing"},
      {{"--from", bed, "--set", "case.seed=7"}, 3, "seed is not as in"},
      {{"--from", bed, "--set", "particles.law.friction=0.1"}, 3, "particles.law is not as in"},
      {{"--from", bed, "--set", "particles.count=90"}, 3, "particles is not as in"},
      {{"--from", bed, "--set", "plates.friction=0.1"}, 3, "plates is not as in"},
      {{"--from", bed, "--set", "box.height=0.09"}, 3, "box is not as in"},
      {{"--from", bed, "--set", "environment.gravity=5"}, 3, "environment is not as in"},
      {{"--from", bed, "--set", "time.step=\"9 us\""}, 3, "time is not as in"},
      {{"--from", bed, "--set", "output.energy=false"}, 3, "output.energy is not as in"},
      {{"--from", bed, "--set", "engine.check_every=16"}, 3, "engine is not as in"},
      {{"--from", bed, "--set", "stage.settle.until.window=\"30 ms\""}, 3, "stage 2 (settle) is not as in"},
      {{"--from", bed, "--stop-after", "fill"}, 2, "has left stage \"fill\" behind"},
      {{"--from", bed, "--reproducible"}, 2, "was run without it"},
      {{"--from", done}, 2, "has no checkpoint"},
      {{"--from", (root / "within").string()}, 2, "in the middle of a stage"},
      {{"--from", (root / "nowhere").string()}, 5, "is not a run folder"},
  };
  for (const auto& w : wrong) {
    std::vector<std::string> words{"run", file, "-o", out};
    words.insert(words.end(), w.words.begin(), w.words.end());
    const ProgramResult result = run_program(words);
    EXPECT_EQ(result.exit_code, w.code) << w.expected << result.report();
    EXPECT_TRUE(has(result.err, w.expected)) << result.report();
    EXPECT_FALSE(fs::exists(out)) << w.expected;
  }
  fs::rename(root / "bed/results.h5", root / "elsewhere.h5");
  const ProgramResult torn = run_program({"run", file, "--from", bed, "-o", out});
  EXPECT_EQ(torn.exit_code, 5) << torn.report();
  EXPECT_TRUE(has(torn.err, "there is no results.h5")) << torn.report();
  EXPECT_FALSE(fs::exists(out));
  fs::rename(root / "elsewhere.h5", root / "bed/results.h5");
  const ProgramResult same = run_program({"run", file, "--from", bed, "-o", bed, "--force"});
  EXPECT_EQ(same.exit_code, 2) << same.report();
  EXPECT_TRUE(fs::exists(root / "bed/checkpoint.h5"));
}

}  // namespace
}  // namespace platen::test
