// `platen law`: closed forms of the law, the cycle, the reading of overlap files, and the program around them.
#include "program.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "core/law_constants.h"
#include "protocol/case_file.h"
#include "protocol/law_command.h"

namespace platen::test {
namespace {

// Results of one or two rounded operations on numbers of this size.
constexpr double few_ulps = 1e-14;

PairLaw sample_law(double n = 1.0) {
  PairLaw law;
  law.k1 = 5e3, law.k2 = 2.5e4, law.k_adh = 4e3, law.f0 = -0.3, law.exponent = n, law.friction = 0.5;
  return law;
}

const char* const law_case = R"([particles.law]
k1 = 5e3
k2 = 2.5e4
k_adh = 4e3
f0 = -0.3
friction = 0.5
)";

TEST(LawCommand, SlopesAndIntercept) {
  const PairLaw law = sample_law();
  // Loading to 1e-4, unloading on k2 to just above zero overlap of the spring, then the adhesive branch.
  const auto rows = drive_pair(law, {1e-9, 0.5e-4, 1e-4, 0.95e-4, 0.9e-4, 0.4e-4, 0.2e-4});
  EXPECT_NEAR(rows[0].f_hys, law.f0, 1e-5) << "f0 is there from the first touch on";
  EXPECT_NEAR((rows[2].f_hys - rows[1].f_hys) / 0.5e-4, law.k1, law.k1 * 1e-12);
  EXPECT_NEAR((rows[3].f_hys - rows[4].f_hys) / 0.05e-4, law.k2, law.k2 * 1e-12);
  EXPECT_NEAR((rows[5].f_hys - rows[6].f_hys) / 0.2e-4, -law.k_adh, law.k_adh * 1e-12);
  EXPECT_NEAR(rows[5].f_hys, law.f0 - law.k_adh * 0.4e-4, few_ulps);
  const Branch expected[] = {Branch::loading, Branch::loading, Branch::loading, Branch::elastic,
                             Branch::elastic, Branch::adhesive, Branch::adhesive};
  for (std::size_t k = 0; k < rows.size(); ++k) EXPECT_EQ(rows[k].branch, expected[k]) << k;
}

TEST(LawCommand, PlasticOverlapAndPullOff) {
  for (const double n : {0.8, 1.0, 1.5, 2.0}) {
    const PairLaw law = sample_law(n);
    const double delta_max = 1e-4, s_max = std::pow(delta_max, n);
    const double share = (law.k2 - law.k1) / (law.k2 + law.k_adh), delta_min = delta_max * std::pow(share, 1.0 / n);
    const auto rows = drive_pair(law, {delta_max, delta_min, 0.99 * delta_min});
    EXPECT_NEAR(rows[0].f_hys, law.f0 + law.k1 * s_max, few_ulps) << n;
    EXPECT_NEAR(rows[0].plastic_overlap, delta_max * std::pow(1.0 - law.k1 / law.k2, 1.0 / n), 1e-12 * delta_max);
    const double f_min = law.f0 - law.k_adh * share * s_max;  // the largest pull
    EXPECT_NEAR(rows[1].f_hys, f_min, 1e-13) << n;
    EXPECT_GT(rows[2].f_hys, f_min);
  }
}

TEST(LawCommand, FrictionLimitIsTheHeightAboveTheAdhesiveBranch) {
  const PairLaw law = sample_law(1.5);
  for (const LawRow& row : drive_pair(law, cycle_overlaps(law, 1e-4))) {
    const double s = row.overlap > 0.0 ? std::pow(row.overlap, 1.5) : 0.0;
    const double expected = row.overlap > 0.0 ? law.friction * std::fabs(row.f_hys + law.k_adh * s - law.f0) : 0.0;
    EXPECT_NEAR(row.friction_limit, expected, 1e-15) << row.overlap;
    if (row.branch == Branch::adhesive) {
      EXPECT_NEAR(row.friction_limit, 0.0, 1e-15);
    }
  }
}

TEST(LawCommand, FrictionLimitOfTheSpringForceAlone) {
  PairLaw law = sample_law(1.5);
  law.friction_limit = FrictionLimit::normal;
  for (const LawRow& row : drive_pair(law, cycle_overlaps(law, 1e-4)))
    EXPECT_NEAR(row.friction_limit, row.overlap > 0.0 ? law.friction * std::fabs(row.f_hys) : 0.0, 1e-15) << row.overlap;
}

TEST(LawCommand, BranchIsJudgedBeforeTheHistoryMoves) {
  // From the adhesive branch back up: elastic at once, because the history has followed the way down.
  const auto rows = drive_pair(sample_law(), {1e-4, 0.3e-4, 0.31e-4});
  EXPECT_EQ(rows[1].branch, Branch::adhesive);
  EXPECT_EQ(rows[2].branch, Branch::elastic);
  EXPECT_NEAR(rows[2].f_hys - rows[1].f_hys, 2.5e4 * 0.01e-4, 1e-12);
}

TEST(LawCommand, SeparationClearsTheHistory) {
  for (const double apart : {0.0, -1e-6}) {
    const auto rows = drive_pair(sample_law(), {1e-4, apart, 0.5e-4});
    EXPECT_EQ(rows[1].f_hys, 0.0);
    EXPECT_EQ(rows[1].plastic_overlap, 0.0);
    EXPECT_EQ(rows[1].friction_limit, 0.0);
    EXPECT_EQ(rows[1].branch, Branch::none);
    EXPECT_EQ(rows[2].branch, Branch::loading);
    EXPECT_EQ(rows[2].f_hys, drive_pair(sample_law(), {0.5e-4})[0].f_hys) << "like new";
  }
}

TEST(LawCommand, ElasticLawHasOneLineOnly) {
  PairLaw law = sample_law();
  law.k2 = law.k1, law.k_adh = 0.0, law.f0 = 0.0;
  for (const LawRow& row : drive_pair(law, {1e-4, 0.2e-4, 0.7e-4})) {
    EXPECT_EQ(row.f_hys, law.k1 * row.overlap);
    EXPECT_EQ(row.plastic_overlap, 0.0);
    EXPECT_EQ(row.branch, Branch::loading);
  }
}

TEST(LawCommand, CycleShowsTheWholeLaw) {
  for (const double n : {0.8, 1.0, 1.5}) {
    const PairLaw law = sample_law(n);
    const auto path = cycle_overlaps(law, 1e-4);
    EXPECT_GE(path.size(), 150u);
    EXPECT_LE(path.size(), 300u);
    EXPECT_EQ(path.front(), 0.0);
    EXPECT_LT(path.back(), 0.0);
    EXPECT_DOUBLE_EQ(*std::max_element(path.begin(), path.end()), 1.5e-4);
    std::set<Branch> seen;
    bool pulls = false, elastic_before_second_peak = false;
    for (const LawRow& row : drive_pair(law, path)) {
      seen.insert(row.branch);
      pulls = pulls || row.f_hys < law.f0;
      elastic_before_second_peak = elastic_before_second_peak || (row.branch == Branch::elastic && !seen.contains(Branch::adhesive));
    }
    EXPECT_EQ(seen.size(), 4u) << "n = " << n;
    EXPECT_TRUE(pulls);
    EXPECT_TRUE(elastic_before_second_peak) << "the first unloading stays on k2";
    // Half of the loading force above f0 is left where the first unloading turns.
    const auto first_peak = std::find(path.begin(), path.end(), 1e-4);
    ASSERT_NE(first_peak, path.end());
    auto turn = first_peak + 1;
    while (turn + 1 != path.end() && turn[1] < turn[0]) ++turn;
    const auto rows = drive_pair(law, {1e-4, *turn});
    EXPECT_NEAR(rows[1].f_hys - law.f0, 0.5 * (rows[0].f_hys - law.f0), 1e-12);
  }
}

TEST(LawCommand, PlateIsHertz) {
  PlateLaw law;
  const double R = 2.5e-3, delta = 1e-6;
  const double E_star = 1.0 / ((1.0 - 0.09) / 2.6e8 + (1.0 - 0.0625) / 2.5e10);
  const auto rows = drive_plate(law, R, {delta, -delta, 4.0 * delta});
  EXPECT_NEAR(rows[0].f_hys / (4.0 / 3.0 * E_star * std::sqrt(R * delta) * delta), 1.0, few_ulps);
  EXPECT_NEAR(rows[2].f_hys / rows[0].f_hys, 8.0, 8.0 * few_ulps);
  EXPECT_EQ(rows[0].friction_limit, 0.3 * rows[0].f_hys);
  EXPECT_EQ(rows[0].plastic_overlap, 0.0);
  EXPECT_EQ(rows[0].branch, Branch::loading);
  EXPECT_EQ(rows[1].f_hys, 0.0);
  EXPECT_EQ(rows[1].branch, Branch::none);
}

TEST(LawCommand, OverlapsInAnyForm) {
  const auto overlaps = parse_overlaps("# a path\n1e-5\r\n  +2e-5 # up\n\n30 um\n-1e-6\n0", "path.txt");
  EXPECT_EQ(overlaps, (std::vector<double>{1e-5, 2e-5, 3e-5, -1e-6, 0.0}));
}

std::string errors_of_overlaps(const std::string& text) {
  try {
    parse_overlaps(text, "path.txt");
    return "accepted";
  } catch (const CaseError& error) {
    return error.what();
  }
}

TEST(LawCommand, EveryBadLineIsNamed) {
  const std::string said = errors_of_overlaps("1e-5\nabc\n2e-5\n3 s\n1e-5,2e-5\nnan\n1e-5 2e-5\n");
  for (const char* const place : {"path.txt:2: ", "path.txt:4: ", "path.txt:5: ", "path.txt:6: ", "path.txt:7: "})
    EXPECT_NE(said.find(place), std::string::npos) << place << said;
  for (const char* const place : {"path.txt:1:", "path.txt:3:"}) EXPECT_EQ(said.find(place), std::string::npos) << said;
  EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 4);
  EXPECT_NE(said.find("allowed: one overlap a line"), std::string::npos) << said;
}

TEST(LawCommand, FilesWithoutOverlapsAndFilesFullOfRubbish) {
  for (const char* const text : {"", "\n\n", "# nothing\n"})
    EXPECT_NE(errors_of_overlaps(text).find("path.txt: holds no overlap"), std::string::npos) << text;
  std::string rubbish;
  for (int k = 0; k < 5000; ++k) rubbish += "x\n";
  const std::string said = errors_of_overlaps(rubbish);
  EXPECT_LT(std::count(said.begin(), said.end(), '\n'), 30) << "one bad file must not fill the screen";
  EXPECT_NE(said.find("more bad lines follow"), std::string::npos);
}

TEST(LawCommand, ConstantsMatchTheirFormulas) {
  const LawConstants c = pair_constants(sample_law(1.5));
  EXPECT_DOUBLE_EQ(c.sp_lower, 0.8);
  EXPECT_DOUBLE_EQ(c.sp_upper, 1.16);
  EXPECT_EQ(damping_share(1.0), 0.0);
  const double log_e = std::log(0.4), pi = 3.14159265358979323846;
  EXPECT_NEAR(damping_share(0.4), log_e * log_e / (pi * pi + log_e * log_e), 1e-15);
  EXPECT_NEAR(c.damping, 4.0 * damping_share(0.4) * 2.5 / 3.0, 1e-15);
}

TEST(LawProgram, CsvToStandardOutputAndToAFile) {
  const TemporaryFolder folder;
  write_file(folder / "case.toml", law_case);
  write_file(folder / "path.txt", "1e-5\n20 um\n-1e-6\n");
  const ProgramOptions here{.folder = folder.path()};
  const ProgramResult shown = run_program({"law", "case.toml", "--overlap", "path.txt"}, here);
  ASSERT_EQ(shown.exit_code, 0) << shown.report();
  EXPECT_EQ(shown.err, "");
  EXPECT_EQ(shown.out.substr(0, shown.out.find('\n')), "overlap,f_hys,plastic_overlap,friction_limit,branch");
  const CsvTable table = parse_csv(shown.out);
  ASSERT_EQ(table.rows.size(), 3u);
  const auto rows = drive_pair(sample_law(), {1e-5, 2e-5, -1e-6});
  for (std::size_t k = 0; k < rows.size(); ++k) {
    EXPECT_EQ(table.number(k, "overlap"), rows[k].overlap);
    EXPECT_EQ(table.number(k, "f_hys"), rows[k].f_hys) << "17 digits read back to the same bits";
    EXPECT_EQ(table.number(k, "plastic_overlap"), rows[k].plastic_overlap);
    EXPECT_EQ(table.number(k, "friction_limit"), rows[k].friction_limit);
  }
  EXPECT_EQ(table.cell(2, "branch"), "none");
  const ProgramResult written = run_program({"law", "case.toml", "--overlap", "path.txt", "-o", "out.csv"}, here);
  EXPECT_EQ(written.exit_code, 0) << written.report();
  EXPECT_EQ(written.out, "");
  EXPECT_EQ(read_file(folder / "out.csv"), shown.out);
  EXPECT_EQ(run_program({"law", "case.toml", "--overlap", "path.txt", "-o", "no/such/out.csv"}, here).exit_code, 5);
}

TEST(LawProgram, CycleUsesTheRadiusOfTheCase) {
  const TemporaryFolder folder;
  write_file(folder / "bare.toml", law_case);
  write_file(folder / "sized.toml", std::string("[particles]\nradius = \"4 mm\"\n") + law_case);
  const auto largest = [&](const std::vector<std::string>& arguments) {
    const ProgramResult result = run_program(arguments, {.folder = folder.path()});
    EXPECT_EQ(result.exit_code, 0) << result.report();
    const auto overlaps = parse_csv(result.out).column("overlap");
    return overlaps.empty() ? 0.0 : *std::max_element(overlaps.begin(), overlaps.end());
  };
  EXPECT_DOUBLE_EQ(largest({"law", "bare.toml", "--cycle"}), 1.5e-4);
  EXPECT_DOUBLE_EQ(largest({"law", "sized.toml", "--cycle"}), 1.5 * 0.05 * 4e-3);
  EXPECT_DOUBLE_EQ(largest({"law", "bare.toml", "--cycle", "--contact", "plate", "--radius", "2 mm"}), 1.5 * 0.05 * 2e-3);
  EXPECT_DOUBLE_EQ(largest({"law", "bare.toml", "--cycle", "--contact", "plate", "--radius", "0.002"}), 1.5 * 0.05 * 2e-3) << "metres";
}

TEST(LawProgram, WhatIsWrongDecidesTheExitCode) {
  const TemporaryFolder folder;
  write_file(folder / "case.toml", law_case);
  write_file(folder / "bad.txt", "1e-5\nabc\n");
  struct Mistake {
    std::vector<std::string> arguments;
    int exit_code;
    std::string said;
  };
  const std::vector<Mistake> mistakes{
      {{"law", "case.toml"}, 2, "--overlap"},
      {{"law", "case.toml", "--cycle", "--overlap", "bad.txt"}, 2, "--overlap"},
      {{"law", "case.toml", "--cycle", "--contact", "wall"}, 2, "wall"},
      {{"law", "case.toml", "--cycle", "--radius", "2 s"}, 2, "--radius"},
      {{"law", "case.toml", "--overlap", "bad.txt"}, 3, "bad.txt:2: "},
      {{"law", "case.toml", "--overlap", "none.txt"}, 3, "none.txt: does not exist"},
      {{"law", "none.toml", "--cycle"}, 3, "none.toml: does not exist"},
      {{"law", "case.toml", "--cycle", "--set", "particles.law.k2=1"}, 3, "particles.law.k2"},
      {{"law", "case.toml", "--cycle", "--contact", "plate"}, 3, "particles.radius"},
  };
  for (const Mistake& mistake : mistakes) {
    const ProgramResult result = run_program(mistake.arguments, {.folder = folder.path()});
    EXPECT_EQ(result.exit_code, mistake.exit_code) << result.report();
    EXPECT_NE(result.err.find(mistake.said), std::string::npos) << result.report();
    EXPECT_EQ(result.out, "") << "nothing half done on standard output";
  }
}

}  // namespace
}  // namespace platen::test
