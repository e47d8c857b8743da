// The program as a user meets it: help, exit codes, run folders, signals, what goes to which stream.
#include "program.h"

#include "protocol/stop_signals.h"

#include <chrono>
#include <nlohmann/json.hpp>
#include <thread>

namespace platen::test {
namespace {

namespace fs = std::filesystem;

// Four spheres that fall on a plate, in three short stages.
const std::string small_case = R"([case]
title = "four spheres"
[particles]
file = "four.csv"
radius = "2.5 mm"
density = 2000
[particles.law]
k1 = 5e3
k2 = 2.5e4
[box]
width = "20 mm"
depth = "20 mm"
height = "30 mm"
[output]
frames = "off"
[[stage]]
kind = "run"
name = "fall"
duration = "5 ms"
[[stage]]
kind = "run"
name = "rest"
duration = "5 ms"
)";
const char* const four_spheres = "x,y,z\n0.005,0.005,0.0026\n0.005,0.005,0.0077\n0.015,0.015,0.0026\n0.015,0.015,0.0077\n";

// A folder with the case above as case.toml, and one that does not end by itself as long.toml.
class ProgramFolder : public TemporaryFolder {
 public:
  ProgramFolder() {
    write_file(*this / "four.csv", four_spheres);
    write_file(*this / "case.toml", small_case);
    write_file(*this / "long.toml",
               small_case + "[[stage]]\nkind = \"run\"\nname = \"endless\"\nduration = 1e5\nmax_duration = 1e6\n");
  }
  ProgramResult run(const std::vector<std::string>& arguments, const std::map<std::string, std::string>& environment = {}) const {
    return run_program(arguments, {.folder = path(), .environment = environment, .timeout = 60.0});
  }
  // Names of everything in the folder.
  std::vector<std::string> listing() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::recursive_directory_iterator(path())) names.push_back(entry.path().string());
    std::sort(names.begin(), names.end());
    return names;
  }
};

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

// ------------------------------------------------------------------------------------------------- help and usage

TEST(Program, HelpEverywhere) {
  const ProgramFolder folder;
  const ProgramResult all = folder.run({"--help"});
  EXPECT_EQ(all.exit_code, 0);
  EXPECT_EQ(all.err, "");
  for (const std::string command : {"run", "check", "law", "info"}) {
    EXPECT_TRUE(contains(all.out, "  " + command + " ")) << all.out;
    const ProgramResult help = folder.run({command, "--help"});
    EXPECT_EQ(help.exit_code, 0) << command;
    EXPECT_TRUE(contains(help.out, "Usage: platen " + command)) << help.report();
    EXPECT_TRUE(contains(help.out, "Example:\n  platen " + command)) << help.out;
  }
}

TEST(Program, Version) {
  const ProgramFolder folder;
  const ProgramResult result = folder.run({"--version"});
  EXPECT_EQ(result.exit_code, 0);
  ASSERT_FALSE(result.out.empty());
  EXPECT_EQ(result.out.find_first_not_of("0123456789.\n"), std::string::npos) << result.out;
}

TEST(Program, CommandsWithoutArgumentsExplainThemselves) {
  const ProgramFolder folder;
  const ProgramResult nothing = folder.run({});
  EXPECT_EQ(nothing.exit_code, 2);
  EXPECT_TRUE(contains(nothing.err, "Usage: platen")) << nothing.report();
  for (const std::string command : {"run", "check", "law", "info"}) {
    const ProgramResult result = folder.run({command});
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_TRUE(contains(result.err, "Usage: platen " + command)) << result.report();
    EXPECT_TRUE(contains(result.err, "Example:")) << result.report();
    EXPECT_EQ(result.out, "");
  }
}

struct Mistake {
  std::vector<std::string> arguments;
  int exit_code;
  std::string said;
  std::map<std::string, std::string> environment{};
};

TEST(Program, MistakesAreNamedAndNothingIsWritten) {
  const ProgramFolder folder;
  std::string changed = small_case;
  changed.replace(changed.find("k2 = 2.5e4"), 10, "k2 = 1");
  write_file(folder / "bad.toml", changed);
  write_file(folder / "fast.toml", small_case + "[time]\nstep = 1e-3\n");
  const auto before = folder.listing();
  const std::vector<Mistake> mistakes{
      {{"rum", "case.toml"}, 2, "did you mean run?"},
      {{"fly", "case.toml"}, 2, "no command \"fly\"; allowed: run, resume, check, law, study, report, export, info"},
      {{"run", "case.toml", "--colour"}, 2, "--colour"},
      {{"run", "case.toml", "other.toml"}, 2, "other.toml"},
      {{"run", "case.toml", "--threads", "0"}, 2, "--threads"},
      {{"run", "case.toml", "--threads", "two"}, 2, "--threads"},
      {{"run", "case.toml", "--max-walltime", "10 m"}, 2, "--max-walltime"},
      {{"run", "case.toml", "--max-walltime", "0"}, 2, "--max-walltime"},
      {{"run", "case.toml", "--stop-after", "crush"}, 2, "fall, rest"},
      {{"run", "case.toml", "--stop-after", "3"}, 2, "fall, rest"},
      {{"run", "case.toml"}, 2, "scalar", {{"PLATEN_ISA", "abacus"}}},
      {{"check", "case.toml"}, 2, "scalar", {{"PLATEN_ISA", "abacus"}}},
      {{"run", "none.toml"}, 3, "none.toml: does not exist"},
      {{"run", "bad.toml", "-o", "out"}, 3, "bad.toml:9:6: particles.law.k2: "},
      {{"run", "case.toml", "--set", "particles.law.k3=1", "-o", "out"}, 3, "particles.law.k3"},
      {{"run", "fast.toml", "-o", "out"}, 3, "dt_limit"},
      {{"check", "fast.toml"}, 3, "dt_limit"},
      {{"run", "case.toml", "-o", "four.csv/out"}, 5, "four.csv"},
      {{"info", "nowhere"}, 5, "nowhere"},
  };
  for (const Mistake& mistake : mistakes) {
    const ProgramResult result = folder.run(mistake.arguments, mistake.environment);
    EXPECT_EQ(result.exit_code, mistake.exit_code) << result.report();
    EXPECT_TRUE(contains(result.err, mistake.said)) << result.report();
    EXPECT_EQ(result.out, "");
  }
  EXPECT_EQ(folder.listing(), before) << "a request that is refused leaves no trace";
}

// ----------------------------------------------------------------------------------------------------- run folders

TEST(Program, DefaultFolderIsTheNextFreeOne) {
  const ProgramFolder folder;
  for (const std::string name : {"runs/case", "runs/case-2", "runs/case-3"}) {
    const ProgramResult result = folder.run({"run", "case.toml", "--threads", "1"});
    ASSERT_EQ(result.exit_code, 0) << result.report();
    EXPECT_TRUE(contains(result.out, "results: " + name + " ")) << result.out;
    for (const char* const file : {"case.toml", "series.csv", "results.h5", "summary.json", "log.jsonl"})
      EXPECT_TRUE(fs::exists(folder / (name + "/" + file))) << name << "/" << file;
  }
}

TEST(Program, AnExistingRunIsOnlyReplacedByForce) {
  const ProgramFolder folder;
  ASSERT_EQ(folder.run({"run", "case.toml", "-o", "out"}).exit_code, 0);
  const std::string series = read_file(folder / "out/series.csv");
  const std::vector<std::string> again{"run", "case.toml", "-o", "out", "--stop-after", "fall"};
  const ProgramResult refused = folder.run(again);
  EXPECT_EQ(refused.exit_code, 5) << refused.report();
  EXPECT_TRUE(contains(refused.err, "out")) << refused.report();
  EXPECT_EQ(read_file(folder / "out/series.csv"), series);
  auto forced = again;
  forced.push_back("--force");
  EXPECT_EQ(folder.run(forced).exit_code, 0);
  EXPECT_LT(read_file(folder / "out/series.csv").size(), series.size());
}

TEST(Program, StopAfterEndsTheRunWell) {
  const ProgramFolder folder;
  for (const std::string stage : {"fall", "1"}) {
    ASSERT_EQ(folder.run({"run", "case.toml", "-o", "out-" + stage, "--stop-after", stage}).exit_code, 0);
    const auto summary = nlohmann::json::parse(read_file(folder / ("out-" + stage + "/summary.json")));
    EXPECT_EQ(summary.at("stages").size(), 1u);
    EXPECT_EQ(summary.at("stages").at(0).at("name"), "fall");
    EXPECT_EQ(summary.at("exit_code"), 0);
  }
}

TEST(Program, OverridesReachTheRun) {
  const ProgramFolder folder;
  ASSERT_EQ(folder.run({"run", "--set", "stage.fall.duration=\"2 ms\"", "--set", "stage.2.duration=1e-3", "case.toml", "-o", "out"}).exit_code, 0);
  const CsvTable series = read_csv(folder / "out/series.csv");
  EXPECT_NEAR(series.number(series.rows.size() - 1, "time"), 3e-3, 1e-4);
  EXPECT_TRUE(contains(read_file(folder / "out/case.toml"), "stage.fall.duration"));
}

TEST(Program, JsonIsTheSummary) {
  const ProgramFolder folder;
  const ProgramResult result = folder.run({"run", "case.toml", "-o", "out", "--json", "-q"});
  ASSERT_EQ(result.exit_code, 0) << result.report();
  EXPECT_EQ(result.out, read_file(folder / "out/summary.json"));
  EXPECT_EQ(result.err, "");
  EXPECT_EQ(nlohmann::json::parse(result.out).at("stages").size(), 2u);
  const auto info = nlohmann::json::parse(folder.run({"info", "out", "--json"}).out);
  EXPECT_EQ(info.at("kind"), "run");
}

TEST(Program, ResultsAndProgressGoToDifferentStreams) {
  const ProgramFolder folder;
  const ProgramResult result = folder.run({"run", "case.toml", "-o", "out"});
  ASSERT_EQ(result.exit_code, 0) << result.report();
  EXPECT_TRUE(contains(result.out, "stage")) << "the table";
  EXPECT_TRUE(contains(result.err, "1/2 fall: ")) << result.err;
  EXPECT_TRUE(contains(result.err, "2/2 rest: ")) << result.err;
  for (const std::string* text : {&result.out, &result.err})
    for (const char control : {'\r', '\x1b'}) EXPECT_EQ(text->find(control), std::string::npos) << "no terminal here";
  const ProgramResult quiet = folder.run({"run", "case.toml", "-o", "quiet", "-q"});
  EXPECT_EQ(quiet.out + quiet.err, "");
}

// On a terminal of script(1) the progress is rewritten in place; errors are coloured unless NO_COLOR says otherwise.
TEST(Program, OnATerminal) {
  if (!fs::exists("/usr/bin/script")) GTEST_SKIP() << "script(1) is not installed";
  const ProgramFolder folder;
  const auto on_terminal = [&](const std::string& arguments, const std::string& no_colour) {
    ProgramOptions options{.folder = folder.path(), .environment = {{"TERM", "xterm"}, {"NO_COLOR", no_colour}}};
    options.program = "/usr/bin/script";
    return run_program({"-qec", std::string(PLATEN_PROGRAM) + " " + arguments, "/dev/null"}, options);
  };
  const ProgramResult run = on_terminal("run long.toml -o out --max-walltime 1", "");
  EXPECT_EQ(run.exit_code, 75) << run.report();
  EXPECT_TRUE(contains(run.out, "\r3/3 endless")) << run.report();
  EXPECT_TRUE(contains(run.out, "\x1b[K")) << run.report();
  const ProgramResult coloured = on_terminal("run none.toml", ""), plain = on_terminal("run none.toml", "1");
  EXPECT_EQ(coloured.exit_code, 3);
  EXPECT_TRUE(contains(coloured.out, "\x1b[")) << coloured.report();
  EXPECT_FALSE(contains(plain.out, "\x1b[")) << plain.report();
}

TEST(Program, AFullStandardOutputIsAnError) {
  const ProgramFolder folder;
  ProgramOptions options{.folder = folder.path()};
  options.program = "/bin/sh";
  const ProgramResult result = run_program({"-c", std::string(PLATEN_PROGRAM) + " info case.toml > /dev/full"}, options);
  EXPECT_EQ(result.exit_code, 5) << result.report();
  EXPECT_TRUE(contains(result.err, "standard output")) << result.report();
}

// ------------------------------------------------------------------------------------------- ends that are not done

TEST(Program, AStageWithoutItsGoalEndsWithSix) {
  const ProgramFolder folder;
  write_file(folder / "goal.toml", small_case + "[[stage]]\nkind = \"settle\"\nmax_duration = \"2 ms\"\nuntil = { window = \"1 s\" }\n");
  const ProgramResult result = folder.run({"run", "goal.toml", "-o", "out"});
  EXPECT_EQ(result.exit_code, 6) << result.report();
  EXPECT_TRUE(contains(result.err, "settle")) << result.err;
  EXPECT_EQ(nlohmann::json::parse(read_file(folder / "out/summary.json")).at("exit_code"), 6);
  EXPECT_TRUE(fs::exists(folder / "out/results.h5")) << "the data so far";
}

TEST(Program, ANumericalFailureEndsWithFour) {
  const ProgramFolder folder;
  // So fast that the spheres would run through each other.
  write_file(folder / "four.csv", "x,y,z,vx,vy,vz\n0.005,0.01,0.01,1000,0,0\n0.0105,0.01,0.01,0,0,0\n");
  const ProgramResult result = folder.run({"run", "case.toml", "-o", "out"});
  EXPECT_EQ(result.exit_code, 4) << result.report();
  EXPECT_TRUE(contains(result.err, "step")) << result.err;
  EXPECT_EQ(nlohmann::json::parse(read_file(folder / "out/summary.json")).at("exit_code"), 4);
}

// --------------------------------------------------------------------------------------------------- stop requests

// A run in its endless stage, ready for signals.
class EndlessRun {
 public:
  explicit EndlessRun(const ProgramFolder& folder)
      : folder_(folder), program_({"run", "long.toml", "-o", "out"}, {.folder = folder.path()}) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (!contains(program_.err(), "2/3 rest: ") && std::chrono::steady_clock::now() < end)
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  RunningProgram& program() { return program_; }
  nlohmann::json summary() const { return nlohmann::json::parse(read_file(folder_ / "out/summary.json")); }

 private:
  const ProgramFolder& folder_;
  RunningProgram program_;
};

TEST(Program, SignalsStopTheRunWithItsData) {
  for (const int number : {SIGTERM, SIGINT, SIGHUP, SIGXCPU}) {
    SCOPED_TRACE(strsignal(number));
    const ProgramFolder folder;
    EndlessRun run(folder);
    run.program().send(number);
    const ProgramResult result = run.program().wait(60.0);
    EXPECT_EQ(result.exit_code, 75) << result.report();
    EXPECT_TRUE(contains(result.err, "stopping")) << result.err;
    EXPECT_EQ(run.summary().at("exit_code"), 75);
    EXPECT_EQ(run.summary().at("stages").size(), 3u);
    EXPECT_GE(read_csv(folder / "out/series.csv").rows.size(), 10u);
  }
}

TEST(Program, SomeSignalsAreNoReasonToStop) {
  const ProgramFolder folder;
  EndlessRun run(folder);
  for (const int number : {SIGUSR1, SIGXFSZ, SIGPIPE}) run.program().send(number);
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  run.program().send(SIGTERM);
  const ProgramResult result = run.program().wait(60.0);
  EXPECT_EQ(result.exit_code, 75) << result.report();
  EXPECT_EQ(result.signal, 0);
}

TEST(Program, TheSecondInterruptLeavesAtOnce) {
  // In a process of its own, because a whole run may be over before the second signal comes.
  const auto interrupted = [](int times) {
    const std::atomic<int>& stop = catch_stop_signals(true);
    for (int k = 0; k < times; ++k) raise(SIGINT);
    _exit(stop.load() == SIGINT ? 21 : 22);
  };
  EXPECT_EXIT(interrupted(1), ::testing::ExitedWithCode(21), "");
  EXPECT_EXIT(interrupted(2), ::testing::KilledBySignal(SIGINT), "");
}

TEST(Program, WallTimeIsRespected) {
  const ProgramFolder folder;
  const auto begin = std::chrono::steady_clock::now();
  const ProgramResult result = folder.run({"run", "long.toml", "-o", "out", "--max-walltime", "500 ms"});
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  EXPECT_EQ(result.exit_code, 75) << result.report();
  EXPECT_GT(took.count(), 0.5);
  EXPECT_LT(took.count(), 20.0);
}

}  // namespace
}  // namespace platen::test
