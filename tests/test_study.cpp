// Studies: their files, plans, collapse errors, and whole tiny ones, also killed, failing and stopped.
#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <random>
#include <thread>
#include <vector>

#include "protocol/output/hdf5_file.h"
#include "protocol/study/collapse.h"
#include "protocol/study/runner.h"
#include "tests/case_texts.h"
#include "tests/program.h"
#include "tests/study_folder.h"

namespace platen::test {
namespace {

namespace fs = std::filesystem;

// A bed of 60 spheres, compressed, freed and crushed: half a second.
const std::string base_text = R"([case]
title = "tiny"
[particles]
radius = "2.5 mm"
density = "2000 kg/m3"
count = 60
[particles.law]
k1 = "5 kN/m"
k2 = "25 kN/m"
k_adh = "5 kN/m"
f0 = "-0.01 N"
friction = 0.5
[box]
width = "18 mm"
depth = "18 mm"
height = "60 mm"
[time]
step = "10 us"
[output]
series = "1 ms"
frames = "off"
[[stage]]
kind = "fill"
[[stage]]
kind = "settle"
until = { kinetic_to_potential = 1e-3, coordination_change = 0.05, window = "10 ms" }
[[stage]]
kind = "compress"
speed = "100 mm/s"
until = { stress = "10 kPa" }
strain_zero = "2 kPa"
start_gap = "0.1 mm"
[[stage]]
kind = "unload"
speed = "100 mm/s"
[[stage]]
kind = "release"
until = { kinetic_to_potential = 1e-3, coordination_change = 0.05, window = "10 ms" }
[[stage]]
kind = "crush"
speed = "100 mm/s"
until = { strain = 0.05 }
start_gap = "0.1 mm"
)";

const std::string study_text = R"([study]
title = "tiny"
base = "tiny.toml"
statements = ["figures-4-7", "figures-12-14", "similarity-2", "cross-checks"]

[[curve]]
name = "reference"

[[curve]]
name = "coarse"
radius = "3 mm"
stiffness = [0, 1, 2]

[[figure]]
name = "fig"
observables = ["stress_strain", "stress_strain_unloading"]

[[scan]]
power = "stiffness"
observables = "porosity"
)";

const std::string without_scan = replaced("[[scan]]\npower = \"stiffness\"\nobservables = \"porosity\"\n", "", study_text);

// -------------------------------------------------------------------------------------------------------- study files

TEST(StudyFile, MisspeltKeysNameTheNearest) {
  const std::string text =
      complaint(replaced("title = \"tiny\"", "tilte = \"tiny\"", replaced("stiffness =", "stifness =", study_text)), base_text);
  EXPECT_NE(text.find("study.toml:2:1: study.tilte: unknown key"), std::string::npos) << text;
  EXPECT_NE(text.find("nearest known key: title"), std::string::npos) << text;
  EXPECT_NE(text.find("study.toml:12:1: curve.stifness: unknown key"), std::string::npos) << text;
  EXPECT_NE(text.find("nearest known key: stiffness"), std::string::npos) << text;
}

TEST(StudyFile, WrongValues) {
  struct {
    const char *what, *by, *expected;
  } cases[] = {
      {"base = \"tiny.toml\"", "base = \"none.toml\"",
       "study.toml:3:8: study.base: the base case \"none.toml\" does not exist"},
      {"[\"figures-4-7\"", "[\"figures-4-8\"", "nearest known word: figures-4-7"},
      {"observables = \"porosity\"", "observables = \"porositi\"", "nearest known word: porosity"},
      {"radius = \"3 mm\"", "radius = \"3 kg\"", "curve.radius: "},
      {"radius = \"3 mm\"", "radius = \"3 mm\"\nradii = [0.003]", "is given beside radius"},
      {"name = \"coarse\"", "name = \"reference\"", "\"reference\" is there already"},
      {"name = \"coarse\"", "name = \"../coarse\"", "is not a usable name"},
      {"stiffness = [0, 1, 2]", "against = \"referense\"", "there is no curve \"referense\""},
      {"title = \"tiny\"", "seeds = [1, 1]", "is not a list of different seeds"},
      {"title = \"tiny\"", "repeats = 3", "only timed runs are repeated"},
      {"[\"stress_strain\", \"stress_strain_unloading\"]", "[\"stress_strain\", \"unconfined\"]",
       "have different axes"},
      {"power = \"stiffness\"", "power = \"density\"", "\"density\" is unknown"},
      {"power = \"stiffness\"", "power = \"adhesion\"", "has 1 values of the adhesion power at one size; allowed: at least three"},
      {"stiffness = [0, 1, 2]", "stiffness = [0, 1, 1.0000001]", "there are two curves \"coarse a=1\""},
  };
  for (const auto& c : cases) {
    const std::string text = complaint(replaced(c.what, c.by, study_text), base_text);
    EXPECT_NE(text.find(c.expected), std::string::npos) << c.by << "\n" << text;
  }
}

TEST(StudyFile, ImpossibleCasesAreFoundBeforeAnyRun) {
  const std::string weak =
      complaint(replaced("stiffness = [0, 1, 2]", "vary = { \"particles.law.k2\" = [25000.0, 4000.0] }", study_text), base_text);
  EXPECT_NE(weak.find("study.toml:9:1: curve: \"coarse k2=4000.0\" is not a possible case:"), std::string::npos)
      << weak;
  EXPECT_NE(weak.find("allowed: k2 >= k1"), std::string::npos) << weak;
  const std::string key = complaint(replaced("stiffness = [0, 1, 2]", "set = \"particles.law.k3=1\"", study_text), base_text);
  EXPECT_NE(key.find("particles.law.k3: unknown key"), std::string::npos) << key;
  const std::string step = complaint(replaced("stiffness = [0, 1, 2]", "set = \"time.step=1e-3\"", study_text), base_text);
  EXPECT_NE(step.find("\"coarse\" is not a possible case"), std::string::npos) << step;
  const std::string dashpots =
      complaint(replaced("radius = \"3 mm\"\nstiffness = [0, 1, 2]", "radius = 0.004\ndashpots = 9", study_text), base_text);
  EXPECT_NE(dashpots.find("critical damping"), std::string::npos) << dashpots;
  const std::string base = complaint(study_text, replaced("count = 60", "cuont = 60", base_text));
  EXPECT_NE(base.find("nearest known key: count"), std::string::npos) << base;
}

TEST(StudyFile, AVariedReferenceNeedsTheSameValues) {
  const std::string both = replaced("name = \"reference\"", "name = \"reference\"\nvary = { \"particles.law.friction\" = [0.3, 0.5] }", without_scan);
  const std::string text = complaint(replaced("stiffness = [0, 1, 2]", "vary = { \"particles.law.friction\" = [0.3, 0.7] }", both), base_text);
  EXPECT_NE(text.find("study.toml:10:1: curve.against: \"reference\" has no member with the varied values of \"coarse friction=0.7\""), std::string::npos) << text;
  EXPECT_EQ(text.find("friction=0.3\""), std::string::npos) << text;
  const std::string plain = complaint(both, base_text);
  EXPECT_NE(plain.find("\"reference\" varies keys that \"coarse a=0\" does not"), std::string::npos) << plain;
}

TEST(StudyFile, ShippedOnesAreRight) {
  int count = 0;
  for (const auto& entry : fs::directory_iterator(fs::path(PLATEN_SOURCE_DIR) / "protocol/studies")) {
    const Study study = read_study(entry.path(), {"study.seeds=[7]"});
    for (const Study& part : study.parts)
      EXPECT_TRUE(part.timed || part.seeds == std::vector<std::uint64_t>{7}) << part.name;
    const StudyPlan plan = make_plan(study);
    EXPECT_GT(plan.jobs.size(), 1u) << entry.path();
    for (const Job& job : plan.jobs) EXPECT_LE(job.name.size(), 220u) << job.name;  // folders and files are named after it
    ++count;
  }
  EXPECT_GE(count, 10);
}

TEST(StudyPlan, ProductOfRadiiPowersAndKeys) {
  const StudyFolder folder(replaced(
      "radius = \"3 mm\"\nstiffness = [0, 1, 2]",
      "radii = [\"2.5 mm\", \"3 mm\"]\nadhesion = [1, 2, 3]\nvary = { \"particles.law.friction\" = [0.3, 0.5] }", without_scan), base_text);
  const Study study = read_study(folder.file(), {"study.seeds=[4, 5]"});
  const StudyPlan plan = make_plan(study);
  const PlannedPart& part = plan.parts.at(0);
  ASSERT_EQ(part.curves.size(), 1u + 2u * 3u * 2u);
  // At the reference radius powers mean nothing, and friction 0.5 is the base case: three curves share the reference's
  // runs, three each other's; 3 mm needs six of its own. Two seeds each.
  EXPECT_EQ(plan.jobs.size(), 2u * (1u + 1u + 6u));
  for (const PlannedCurve& curve : part.curves) {
    const Case& c = plan.jobs.at(curve.jobs.at(1)).c;
    EXPECT_EQ(c.seed, 5u);
    EXPECT_EQ(c.particles.sizes.radius, curve.radius);
    const double lambda = curve.radius / 2.5e-3;
    EXPECT_DOUBLE_EQ(c.particles.law.f0, -0.01 * std::pow(lambda, curve.powers.adhesion)) << curve.label;
    EXPECT_DOUBLE_EQ(c.particles.law.k1, 5e3 * lambda);
    EXPECT_EQ(c.particles.count, lambda == 1.0 ? 60 : 35);
    EXPECT_EQ(curve.reference, 0u);
  }
  EXPECT_EQ(part.curves.back().label, "coarse R=3 mm b=3 friction=0.5");
}

TEST(StudyPlan, ACurveNamedAfterItsKeySaysItOnce) {
  const StudyFolder folder(replaced("name = \"coarse\"\nradius = \"3 mm\"\nstiffness = [0, 1, 2]",
                                    "name = \"friction\"\nvary = { \"particles.law.friction\" = [0.3, 0.4] }", without_scan), base_text);
  const StudyPlan plan = make_plan(read_study(folder.file(), {}));
  EXPECT_EQ(plan.parts.at(0).curves.back().label, "friction=0.4");
}

TEST(StudyPlan, LongNamesAreCutAndStayTheirCases) {
  const auto names = [](const std::string& keys) {
    const StudyFolder folder(replaced("radius = \"3 mm\"\nstiffness = [0, 1, 2]", "radius = \"3 mm\"\n" + keys, without_scan), base_text);
    std::vector<std::string> all;
    for (const Job& job : make_plan(read_study(folder.file())).jobs) all.push_back(job.name);
    return all;
  };
  std::string set = "set = [";
  for (const char* key : {"plates.young_modulus", "plates.particle_young_modulus", "particles.law.friction", "particles.law.restitution", "plates.particle_poisson_ratio",
                          "plates.friction", "plates.restitution", "plates.poisson_ratio"})
    set += "\"" + std::string(key) + "=0.123456789012345678\", ";
  const std::vector<std::string> first = names(set + "\"plates.rolling_friction=0.2\"]"), second = names(set + "\"plates.rolling_friction=0.25\"]");
  EXPECT_LE(first.back().size(), 220u);
  EXPECT_NE(first.back(), second.back());
  EXPECT_EQ(first, names(set + "\"plates.rolling_friction=0.2\"]"));
}

// ---------------------------------------------------------------------------------------------------- collapse errors

Curve line(double slope, double shift, double low = 0.0, double high = 1.0, int points = 17) {
  Curve out;
  for (const double x : grid({low, high}, points)) {
    out.x.push_back(x);
    out.y.push_back(slope * x + shift);
  }
  return out;
}

TEST(Collapse, DistancesOfStraightLinesAreExact) {
  constexpr double tolerance = 1e-14;  // rounding of a mean of 201 numbers of order 1
  // A constant shift is its own RMS; curves are compared where both are, on points of their own.
  const auto shifted = collapse_error({line(1.0, 0.0)}, {line(1.0, 0.1, 0.5, 2.0, 9)});
  ASSERT_TRUE(shifted);
  EXPECT_NEAR(shifted->error, 0.1, tolerance);
  EXPECT_NEAR(shifted->relative, 0.1 / 0.5, tolerance);
  EXPECT_FALSE(shifted->scatter);
  EXPECT_FALSE(shifted->in_scatter);
  // y = 2 x against y = x: RMS of k/200, k = 0 ... 200, by the sum of squares.
  const auto turned = collapse_error({line(1.0, 0.0)}, {line(2.0, 0.0)});
  ASSERT_TRUE(turned);
  EXPECT_NEAR(turned->error, std::sqrt(200.0 * 201.0 * 401.0 / 6.0 / (200.0 * 200.0) / 201.0), tolerance);
  // Seeds: reference 0 and 0.2 (mean 0.1, deviation 0.2/sqrt 2); curves 0.4 and 0.6 are 0.3 and 0.5 away.
  const auto seeds = collapse_error({line(1.0, 0.0), line(1.0, 0.2)}, {line(1.0, 0.4), line(1.0, 0.6)});
  ASSERT_TRUE(seeds);
  EXPECT_NEAR(seeds->error, 0.4, tolerance);
  EXPECT_NEAR(*seeds->scatter, 0.2 / std::sqrt(2.0), tolerance);
  EXPECT_NEAR(seeds->of_means, 0.4, tolerance);
  EXPECT_NEAR(*seeds->in_scatter, 0.4 / (0.2 / std::sqrt(2.0)), 10.0 * tolerance);
  // Nothing shared, nothing there.
  EXPECT_FALSE(collapse_error({line(1.0, 0.0)}, {line(1.0, 0.0, 2.0, 3.0)}));
  EXPECT_FALSE(collapse_error({line(1.0, 0.0)}, {}));
  EXPECT_FALSE(collapse_error({line(1.0, 0.0)}, {Curve{}}));
}

// What is off by a power of R, by more or by less: E = |ratio^(p - best) - 1|. On the powers of the shipped scans.
TEST(Collapse, ScanFindsTheMinimum) {
  const auto squares = [](const std::vector<double>& powers, double ratio, double best, double sign) {
    std::vector<double> out;
    for (const double p : powers) out.push_back(std::pow(0.3 * (std::pow(ratio, sign * (p - best)) - 1.0), 2));
    return out;
  };
  for (const double sign : {1.0, -1.0})
    for (const auto& [powers, best] : {std::pair(std::vector{1.0, 1.5, 1.75, 2.0, 2.25, 2.5, 3.0}, 2.0), std::pair(std::vector{0.0, 0.25, 0.5, 0.75, 1.0}, 0.5),
                                       std::pair(std::vector{0.0, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0}, 1.13)}) {
      const auto one = least_error(powers, squares(powers, 1.5, best, sign), 1.5);
      ASSERT_TRUE(one);
      EXPECT_NEAR(one->power, best, 1e-9);
      EXPECT_NEAR(one->uncertainty, 0.0, 1e-7);
      EXPECT_NEAR(one->error, 0.0, 1e-6);
      EXPECT_TRUE(one->inside);
    }
  // Three points cannot tell the two forms apart, and say so.
  const std::vector<double> three{1.0, 2.0, 3.0};
  const auto coarse = least_error(three, squares(three, 1.5, 2.0, 1.0), 1.5);
  ASSERT_TRUE(coarse);
  EXPECT_GT(coarse->uncertainty, 0.01);
  EXPECT_NEAR(std::abs(coarse->power - 2.0), coarse->uncertainty, 1e-9);
  EXPECT_FALSE(least_error(three, squares(three, 1.5, 0.5, 1.0), 1.5).value_or(Minimum{}).inside);
  EXPECT_FALSE(least_error({1.0, 2.0}, std::vector{0.1, 0.2}, 1.5));
  EXPECT_FALSE(least_error({0.0, 1.0, 2.0}, std::vector{0.01, 0.09, 0.01}, 1.5));  // opens downwards
}

// The scatter of the reference shifts the minimum as that of the curves does; both must show.
TEST(Collapse, ScanUncertaintyCountsBothScatters) {
  const auto straight = [](double slope) { return Curve{{0.0, 1.0}, {0.0, slope}}; };
  const double ratio = 1.5, off = 0.05;
  for (const bool of_reference : {true, false}) {
    ScanData data;
    data.ratio = ratio;
    data.powers = {1.0, 1.5, 2.0, 2.5, 3.0};
    ScanObservable one;
    one.name = "stress_strain";
    one.x = grid({0.0, 1.0});
    for (const double e : {-off, 0.0, off}) one.reference.push_back(straight(of_reference ? 1.0 + e : 1.0));
    for (const double p : data.powers) {
      std::vector<Curve>& curves = one.of_power.emplace_back();
      for (const double e : {-off, 0.0, off}) curves.push_back(straight(std::pow(ratio, p - 2.0) * (of_reference ? 1.0 : 1.0 + e)));
    }
    data.observables.push_back(one);
    const auto minimum = data.minimum({0});
    ASSERT_TRUE(minimum);
    EXPECT_EQ(minimum->degrees, 2);
    EXPECT_NEAR(minimum->power, 2.0, 0.01);
    // d power = d ln(slope) / ln(ratio); the standard error of a mean of three.
    EXPECT_NEAR(minimum->uncertainty, off / std::sqrt(3.0) / std::log(ratio), 0.05 * 0.07) << of_reference;
  }
  EXPECT_NEAR(student_975(2), 4.303, 1e-3);
  EXPECT_NEAR(student_975(60), 2.0, 0.05);
}

// -------------------------------------------------------------------------------------------------------- whole studies

// Every table of a study that is not about time, and study.h5 byte for byte, as one text.
std::string tables_of(const fs::path& folder) {
  std::vector<fs::path> files{folder / "runs.csv", folder / "statements.csv", folder / "statements.md", folder / "study.h5",
                              folder / "figures/fig.dat"};
  for (const auto& entry : fs::directory_iterator(folder / "tables")) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  std::string out;
  for (const fs::path& file : files) out += file.filename().string() + "\n" + read_file(file);
  return out;
}

TEST(Study, EndToEndAndKilledAtRandomPoints) {
  const StudyFolder study(study_text, base_text);
  const ProgramResult whole = run_program(study.words("whole"));
  ASSERT_EQ(whole.exit_code, 0) << whole.report();
  const fs::path folder = study.folder / "whole";
  const std::string expected = tables_of(folder);
  const CsvTable collapse = read_csv(folder / "tables/collapse.csv");
  // Three coarse curves, each with every observable: compression, unloading, profile, crushing.
  EXPECT_EQ(collapse.rows.size(), 3u * 8u);
  for (std::size_t k = 0; k < collapse.rows.size(); ++k) EXPECT_GT(collapse.number(k, "error"), 0.0);
  const CsvTable scans = read_csv(folder / "tables/scans.csv");
  ASSERT_EQ(scans.rows.size(), 1u);
  EXPECT_EQ(scans.cell(0, "powers"), "0;1;2");
  EXPECT_NE(read_file(folder / "statements.md").find("| 4 | reference: strain at the end of loading"),
            std::string::npos);
  for (const char* name : {"fig.svg", "fig.png", "fig.gp", "fig.dat", "scan-stiffness.svg"})
    EXPECT_GT(fs::file_size(folder / "figures" / name), 100u) << name << whole.err;
  const Hdf5File h5 = Hdf5File::open(folder / "study.h5");
  const Hdf5Group curve = h5.root().group("part").group("curves").group("coarse a=1");
  EXPECT_EQ(curve.group("stress_strain").read<double>("x").size(), std::size_t(common_points));
  const Hdf5Group of_scans = h5.root().group("part").group("scans");
  ASSERT_EQ(of_scans.names().size(), 1u);
  EXPECT_EQ(of_scans.group(of_scans.names().front()).read<double>("powers"), (std::vector<double>{0, 1, 2}));
  const Hdf5Group judged = h5.root().group("statements");
  const std::string lines = read_file(folder / "statements.csv");
  EXPECT_EQ(static_cast<std::ptrdiff_t>(judged.names().size()) + 1, std::count(lines.begin(), lines.end(), '\n'));
  for (const std::string& name : judged.names()) {
    EXPECT_NE(lines.find(judged.group(name).text_attribute(".", "statement")), std::string::npos) << name;
    EXPECT_NE(lines.find(judged.group(name).text_attribute(".", "verdict")), std::string::npos) << name;
  }

  // The same again makes no run again.
  const auto before = fs::last_write_time(folder / "runs/tiny-R2.5mm-s1/summary.json");
  const ProgramResult again = run_program(study.words("whole"));
  EXPECT_EQ(again.exit_code, 0) << again.report();
  EXPECT_EQ(fs::last_write_time(folder / "runs/tiny-R2.5mm-s1/summary.json"), before);
  EXPECT_EQ(tables_of(folder), expected);

  // Killed four times at random, then left alone.
  std::mt19937 random(std::random_device{}());
  for (int k = 0; k < 4; ++k) {
    RunningProgram victim(study.words("killed"), {});
    const int wait = static_cast<int>(random() % 900) + 20;
    SCOPED_TRACE("killed after " + std::to_string(wait) + " ms");
    std::this_thread::sleep_for(std::chrono::milliseconds(wait));
    victim.send(SIGKILL);
    victim.wait(60.0);
  }
  const ProgramResult last = run_program(study.words("killed"));
  ASSERT_EQ(last.exit_code, 0) << last.report();
  EXPECT_EQ(tables_of(study.folder / "killed"), expected);
}

TEST(Study, ReproducibleOnesTakeNoOtherRuns) {
  const StudyFolder study(study_text, base_text);
  const fs::path folder = study.folder / "out", run = folder / "runs/tiny-R2.5mm-s1";
  const auto reproducible = [&] { return nlohmann::json::parse(read_file(run / "summary.json"))["performance"]["reproducible"].get<bool>(); };
  const auto of_results = [&] { return Hdf5File::open(run / "results.h5").root().integer_attribute("provenance", "reproducible", -1); };
  ASSERT_EQ(run_program(study.words("out")).exit_code, 0);
  EXPECT_FALSE(reproducible());
  EXPECT_EQ(of_results(), 0);
  const auto done = [&](const std::vector<std::string>& more) { return run_program(study.words("out", more)).out.find(", done") != std::string::npos; };
  EXPECT_TRUE(done({"--dry-run"}));
  EXPECT_FALSE(done({"--dry-run", "--reproducible"}));
  const ProgramResult exact = run_program(study.words("out", {"--reproducible"}));
  ASSERT_EQ(exact.exit_code, 0) << exact.report();
  EXPECT_TRUE(reproducible());
  EXPECT_EQ(of_results(), 1);
  // With and without the option these are taken as they are, and another instruction set makes the same.
  const auto before = fs::last_write_time(run / "summary.json");
  const std::string tables = tables_of(folder);
  EXPECT_EQ(run_program(study.words("out", {"--reproducible"})).exit_code, 0);
  EXPECT_EQ(run_program(study.words("out")).exit_code, 0);
  EXPECT_EQ(fs::last_write_time(run / "summary.json"), before);
  ProgramOptions scalar;
  scalar.environment = {{"PLATEN_ISA", "scalar"}};
  const ProgramResult other = run_program(study.words("scalar", {"--reproducible"}), scalar);
  ASSERT_EQ(other.exit_code, 0) << other.report();
  EXPECT_EQ(tables_of(study.folder / "scalar"), tables);

  // Interrupted, one that was made without it begins anew; one that was made with it goes on, and stays what it is.
  for (const bool with : {false, true}) {
    fs::remove_all(run);
    std::vector<std::string> words{"run", (folder / "cases/tiny-R2.5mm-s1.toml").string(), "-o", run.string(), "--stop-after", "settle", "--threads", "1"};
    if (with) words.push_back("--reproducible");
    ASSERT_EQ(run_program(words).exit_code, 0);
    EXPECT_EQ(run_program(study.words("out", with ? std::vector<std::string>{} : std::vector<std::string>{"--reproducible"})).exit_code, 0);
    EXPECT_TRUE(reproducible()) << with;
    EXPECT_EQ(read_file(run / "log.jsonl").find("\"resume\"") != std::string::npos, with);
    EXPECT_EQ(tables_of(folder), tables);
  }
}

TEST(Study, KilledInItsFirstMomentItGoesOn) {
  const StudyFolder study(study_text, base_text);
  fs::create_directory(study.folder / "out");
  write_file(study.folder / "out/.lock", "");
  write_file(study.folder / "out/study.toml.tmp", "[stu");
  const ProgramResult result = run_program(study.words("out"));
  EXPECT_EQ(result.exit_code, 0) << result.report();
  EXPECT_FALSE(fs::exists(study.folder / "out/study.toml.tmp"));
}

// A finished run that was damaged later: the tables of the others are written, and the message says what helps.
TEST(Study, ADamagedRunIsLeftOut) {
  const StudyFolder study(study_text, base_text);
  ASSERT_EQ(run_program(study.words("out")).exit_code, 0);
  const CsvTable runs = read_csv(study.folder / "out/runs.csv");
  const fs::path run = study.folder / "out/runs" / runs.cell(1, "run");
  fs::resize_file(run / "results.h5", 1000);
  fs::remove(study.folder / "out/statements.md");
  const ProgramResult broken = run_program(study.words("out"));
  EXPECT_EQ(broken.exit_code, 5) << broken.report();
  EXPECT_NE(broken.err.find(run.filename().string()), std::string::npos) << broken.report();
  EXPECT_NE(broken.err.find("remove this folder"), std::string::npos) << broken.report();
  EXPECT_TRUE(fs::exists(study.folder / "out/statements.md"));
  EXPECT_EQ(read_csv(study.folder / "out/tables/scans.csv").rows.size(), 0u);  // two powers are left
  fs::remove_all(run);
  const ProgramResult again = run_program(study.words("out"));
  EXPECT_EQ(again.exit_code, 0) << again.report();
  EXPECT_GT(read_csv(study.folder / "out/tables/scans.csv").rows.size(), 0u);
}

TEST(Study, AFailingRunIsMarkedAndTheRestFinishes) {
  const StudyFolder study(
      replaced("stiffness = [0, 1, 2]", "vary = { \"stage.settle.max_duration\" = [60.0, 0.001] }", without_scan), base_text);
  const ProgramResult result = run_program(study.words("out"));
  EXPECT_EQ(result.exit_code, 6) << result.report();
  EXPECT_NE(result.err.find("1 of 3 runs failed"), std::string::npos) << result.report();
  const CsvTable runs = read_csv(study.folder / "out/runs.csv");
  ASSERT_EQ(runs.rows.size(), 3u);
  EXPECT_EQ(runs.cell(0, "state"), "done");
  EXPECT_EQ(runs.cell(1, "state"), "done");
  EXPECT_EQ(runs.cell(2, "state"), "failed");
  EXPECT_EQ(runs.cell(2, "exit code"), "6");
  EXPECT_NE(runs.cell(2, "message").find("settle"), std::string::npos) << runs.cell(2, "message");
  const CsvTable collapse = read_csv(study.folder / "out/tables/collapse.csv");
  EXPECT_EQ(collapse.rows.size(), 8u);  // of the one coarse curve that is there
}

TEST(Study, StopsWhenToldAndGoesOn) {
  const StudyFolder study(study_text, base_text);
  RunningProgram running(study.words("out"), {});
  for (int k = 0; k < 2000 && !fs::exists(study.folder / "out/logs"); ++k)
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  running.send(SIGTERM);
  const ProgramResult stopped = running.wait(60.0);
  EXPECT_EQ(stopped.exit_code, 75) << stopped.report();
  EXPECT_FALSE(fs::exists(study.folder / "out/statements.md"));
  const ProgramResult rest = run_program(study.words("out"));
  EXPECT_EQ(rest.exit_code, 0) << rest.report();
  EXPECT_TRUE(fs::exists(study.folder / "out/statements.md"));
}

TEST(Study, CommandLine) {
  const StudyFolder study(study_text, base_text);
  EXPECT_EQ(run_program({"study", study.file().string()}).exit_code, 2);  // no -o
  EXPECT_EQ(
      run_program({"study", (study.folder / "none.toml").string(), "-o", (study.folder / "a").string()}).exit_code, 3);
  EXPECT_EQ(run_program(study.words("a", {"--set", "study.seds=[1]"})).exit_code, 3);
  EXPECT_FALSE(fs::exists(study.folder / "a"));
  const ProgramResult dry = run_program(study.words("a", {"--dry-run"}));
  EXPECT_EQ(dry.exit_code, 0);
  EXPECT_NE(dry.out.find("tiny-R3mm-a2-b2-s1"), std::string::npos) << dry.report();
  EXPECT_FALSE(fs::exists(study.folder / "a"));
  fs::create_directories(study.folder / "of-a-study/runs");
  write_file(study.folder / "of-a-study/study.toml", study_text);
  const ProgramResult over_it = run_program({"run", (study.folder / "tiny.toml").string(), "-o", (study.folder / "of-a-study").string(), "--force"});
  EXPECT_EQ(over_it.exit_code, 5);
  EXPECT_NE(over_it.err.find("is the folder of a study; choose another folder"), std::string::npos) << over_it.report();
  fs::create_directories(study.folder / "mine");
  write_file(study.folder / "mine" / "thesis.txt", "years of work");
  const ProgramResult foreign = run_program(study.words("mine"));
  EXPECT_EQ(foreign.exit_code, 5) << foreign.report();
  EXPECT_EQ(std::distance(fs::directory_iterator(study.folder / "mine"), fs::directory_iterator{}), 1);
}

}  // namespace
}  // namespace platen::test
