// What studies say of themselves: verdicts need data, and an uncertainty that means something.
#include <gtest/gtest.h>

#include <filesystem>
#include <map>

#include "protocol/study/analysis.h"
#include "protocol/study/judge.h"
#include "protocol/study/statements.h"
#include "tests/case_texts.h"
#include "tests/program.h"
#include "tests/study_folder.h"

namespace platen::test {
namespace {

namespace fs = std::filesystem;

const char* const study_text = R"([study]
title = "tiny"
base = "tiny.toml"
statements = ["figures-8-10", "figures-12-14", "like-reference", "cross-checks"]

[[curve]]
name = "reference"

[[curve]]
name = "coarse"
radius = "3 mm"
adhesion = [1, 2, 3]
)";

// What the scan of a power of adhesion with this minimum is said to show.
Statement verdict_of(std::optional<Minimum> minimum) {
  PlannedPart planned;
  Study study;
  planned.study = &study;
  PartResults part;
  part.plan = &planned;
  ScanResult scan;
  scan.power = ScanSpec::Power::adhesion;
  scan.powers = {1.0, 1.5, 2.0, 2.5, 3.0}, scan.best_tried = 2.0;
  scan.minimum = minimum;
  part.scans = {scan};
  std::vector<Statement> said;
  Judge judge(part, said);
  judge_scans(judge);
  EXPECT_EQ(said.size(), 2u);
  EXPECT_EQ(said.front().holds, true) << "2 is the best tried";
  return said.back();
}

TEST(Judge, AScanNeedsAnUncertaintyThatMeansSomething) {
  const auto holds = [](double power, double uncertainty, int degrees, bool inside = true) {
    return verdict_of(Minimum{power, uncertainty, 0.0, inside, degrees}).holds;
  };
  EXPECT_EQ(holds(2.1, 0.05, 2), true) << "4.3 standard errors at two degrees of freedom";
  EXPECT_EQ(holds(2.3, 0.05, 2), false);
  EXPECT_EQ(holds(2.1, 0.05, 0), std::nullopt) << "one seed";
  EXPECT_EQ(holds(2.1, std::nan(""), 2), std::nullopt);
  EXPECT_EQ(holds(2.1, 0.3, 2), std::nullopt) << "2.6 powers wide, where 2 were tried";
  EXPECT_EQ(holds(3.4, 0.05, 2, false), false) << "no minimum inside";
  EXPECT_EQ(verdict_of(std::nullopt).holds, false);
}

// S2 with beds whose porosity falls in a straight line with stress, the unscaled ones 1.5 times as steeply. `special`: the
// unscaled bed has keys of its own, as a gravity that is scaled too; `plain`: there is one without.
std::vector<Statement> similarity_of(bool special, bool plain, double steepness) {
  Study study;
  study.strain_zero = 5e3;
  PlannedPart planned;
  planned.study = &study, planned.reference_radius = 2e-3;
  std::vector<double> slopes;
  const auto add = [&](const std::string& name, double stiffness, double slope, const std::vector<std::string>& set) {
    CurveSpec spec;
    spec.name = name, spec.set = set;
    study.curves.push_back(spec);
    PlannedCurve curve;
    curve.label = curve.block = name, curve.radius = 3e-3, curve.powers.stiffness = stiffness;
    planned.curves.push_back(curve);
    slopes.push_back(slope);
  };
  add("scaled", 1.0, 1.0, {});
  if (special) add("unscaled, gravity scaled", 0.0, steepness, {"environment.gravity=6.54"});
  if (plain) add("unscaled", 0.0, 2.0, {});
  PartResults part;
  part.plan = &planned;
  for (std::size_t k = 0; k < slopes.size(); ++k) {
    MeasuredCurve curve;
    curve.planned = &planned.curves[k];
    for (const double scatter : {-1e-3, 1e-3}) {
      RunMeasures run;
      for (double stress = 0.0; stress <= 60e3; stress += 1e3) {
        run.curves["porosity"].x.push_back(stress);
        run.curves["porosity"].y.push_back(0.4 - (slopes[k] + scatter) * 1e-6 * stress);
      }
      curve.runs.push_back(run);
    }
    part.curves.push_back(curve);
  }
  std::vector<Statement> said;
  Judge judge(part, said);
  judge_similarity_2(judge);
  return said;
}

TEST(Judge, TakesAnUnscaledBedWithKeysOfItsOwnWhereThereIsNoPlainOne) {
  const auto holds = [](bool special, bool plain, double steepness) {
    const auto said = similarity_of(special, plain, steepness);
    EXPECT_EQ(said.size(), 1u);
    return said.empty() ? std::nullopt : said.front().holds;
  };
  EXPECT_EQ(holds(true, false, 1.5), true) << "1.5 times as steep over stresses 1.5 times smaller";
  EXPECT_EQ(holds(true, false, 1.6), false);
  EXPECT_EQ(holds(true, true, 1.5), false) << "the plain one counts, twice as steep";
  EXPECT_EQ(holds(false, true, 1.5), false);
  EXPECT_EQ(holds(false, false, 1.5), std::nullopt) << "none at all";
}

// A curve all of whose runs found the same.
MeasuredCurve alike(const PlannedCurve& curve, const std::vector<std::uint64_t>& seeds, const std::map<std::string, double>& scalars) {
  MeasuredCurve measured;
  measured.planned = &curve, measured.seeds = seeds;
  RunMeasures run;
  run.scalars = scalars;
  measured.runs.assign(seeds.size(), run);
  return measured;
}

// One curve of three lost a seed: that is said beside what it is in, and nowhere else.
TEST(Judge, SeedsAreThoseOfTheCurvesThatAStatementIsOn) {
  Study study;
  PlannedPart planned;
  planned.study = &study, planned.reference_radius = 2e-3;
  PartResults part;
  part.plan = &planned;
  const std::map<std::string, std::vector<std::uint64_t>> seeds{{"a reference", {1, 2, 3}}, {"b whole", {1, 2, 3}}, {"c lost one", {2, 3}}, {"d lost all", {}}};
  for (const auto& [name, own] : seeds) {
    CurveSpec spec;
    spec.name = name, spec.set = {"particles.law.friction=0.3"};
    study.curves.push_back(spec);
    PlannedCurve curve;
    curve.label = curve.block = name, curve.radius = 2e-3;
    planned.curves.push_back(curve);
  }
  for (const PlannedCurve& curve : planned.curves) part.curves.push_back(alike(curve, seeds.at(curve.label), {{"strain_peak", 0.1}, {"strength", 1e4}}));
  std::vector<Statement> said;
  Judge judge(part, said);
  judge_like_reference(judge);
  ASSERT_EQ(said.size(), 6u);
  for (const Statement& s : said) EXPECT_EQ(s.seeds, s.text.starts_with("b") ? 3 : s.text.starts_with("c") ? 2 : 0) << s.text;
}

// The same of the figures: 3 mm lost a seed, 5 mm all, and what is said of 4 mm has three.
TEST(Judge, SeedsOfFiguresAreThoseOfTheirCurves) {
  Study study;
  PlannedPart planned;
  planned.study = &study, planned.reference_radius = 2e-3;
  PartResults part;
  part.plan = &planned;
  const std::map<double, std::vector<std::uint64_t>> seeds{{2e-3, {1, 2, 3}}, {3e-3, {2, 3}}, {4e-3, {1, 2, 3}}, {5e-3, {}}};
  for (const auto& [radius, own] : seeds) {
    CurveSpec spec;
    spec.name = size_text(radius);
    study.curves.push_back(spec);
    PlannedCurve curve;
    curve.label = curve.block = spec.name, curve.radius = radius, curve.powers.stiffness = 1.0, curve.powers.adhesion = 2.0;
    planned.curves.push_back(curve);
  }
  for (const PlannedCurve& curve : planned.curves)
    part.curves.push_back(alike(curve, seeds.at(curve.radius),
                                {{"strain_peak", 0.1}, {"strength", 1e4}, {"initial_stiffness", 1e5}, {"porosity_start", 0.4}, {"porosity_peak", 0.39}, {"porosity_at_zero", 0.4},
                                 {"coordination_peak", 6.0}, {"coordination_unloaded", 6.0}, {"coordination_released", 5.0}}));
  std::vector<Statement> said;
  Judge judge(part, said);
  judge_figures_12_14(judge);
  judge_figures_8_10(judge);
  ASSERT_EQ(said.size(), 3u * 10 + 3 + 3 * 4 + 1);
  for (const Statement& s : said) {
    const int expected = s.text.starts_with("R = 3 mm") ? 2 : s.text.starts_with("R = 4 mm") ? 3 : s.text.starts_with("Rumpf") ? 2 : 0;
    EXPECT_EQ(s.seeds, expected) << s.text;
  }
}

// What changes of a bed of half the plate speed, with three seeds each: by how much, with its standard error, against the scatter.
TEST(Judge, ChangesStandBesideTheirOwnErrorAndTheScatter) {
  Study study;
  PlannedPart planned;
  planned.study = &study, planned.reference_radius = 2e-3;
  StudyPlan plan;
  PartResults part;
  part.plan = &planned;
  const std::vector<std::pair<std::string, double>> beds{{"as published", 0.01}, {"half the plate speed", 0.005}};
  for (const auto& [name, speed] : beds) {
    CurveSpec spec;
    spec.name = name;
    if (speed < 0.01) spec.set = {"stage.compress.speed=0.005"};
    study.curves.push_back(spec);
    PlannedCurve curve;
    curve.label = curve.block = name, curve.radius = 2e-3, curve.jobs = {plan.jobs.size()};
    planned.curves.push_back(curve);
    Job job;
    job.c.stages.emplace_back();
    job.c.stages.back().kind = StageKind::compress, job.c.stages.back().speed = speed;
    plan.jobs.push_back(job);
  }
  for (std::size_t k = 0; k < beds.size(); ++k) {
    MeasuredCurve curve;
    curve.planned = &planned.curves[k], curve.jobs = {k};
    for (const double seed : {-1.0, 0.0, 1.0}) {
      RunMeasures run;
      run.scalars = {{"strain_rate", 0.04}, {"strain_peak", 0.100 + 0.003 * seed + 0.001 * static_cast<double>(k)},
                     {"strength", 1e4 + 300.0 * seed + 900.0 * static_cast<double>(k)},
                     {"inertial_start", 4e-4}, {"inertial_peak", 7e-5}, {"quasi_static_stress", 15e3}};
      curve.runs.push_back(run);
    }
    part.curves.push_back(curve);
  }
  std::vector<Statement> said;
  Judge judge(part, said);
  judge_quasi_static(judge, plan);
  std::map<std::string, Statement> by_text;
  for (const Statement& s : said) by_text.emplace(s.text, s);
  const auto expect = [&](const std::string& text, const std::string& number, bool holds) {
    ASSERT_TRUE(by_text.contains(text)) << text;
    EXPECT_EQ(by_text.at(text).number, number);
    EXPECT_EQ(by_text.at(text).holds, holds);
  };
  expect("as published: inertial number below 1e-4 at the end of loading", "7e-05 (0.0004 at the start), below 1e-4 from 15.00 kPa on", true);
  // Standard errors of two means of three with deviations of 0.3 %, 300 Pa: times sqrt(2/3).
  expect("half the plate speed: change of the strain at the end of loading below the scatter over seeds", "+0.1 ± 0.24 %, scatter 0.3 %", true);
  expect("half the plate speed: change of the strength below the scatter over seeds", "+0.9 ± 0.24 kPa, scatter 0.3 kPa", false);
  expect("half the plate speed: change of the strain at the end of loading, of it: at most 2 %", "1.00 %", true);
}

// A curve without a single run must leave what needs it open, and nothing else changed.
TEST(Judge, WhatHasNoRunsIsNotJudged) {
  const StudyFolder study(study_text, read_file(std::string(PLATEN_SOURCE_DIR) + "/protocol/cases/quick.toml"));
  // The quick case at a tenth of its spheres and five times its speed.
  const std::vector<std::string> small{"--set", "study.set=[\"particles.count=60\", \"particles.law.f0=-0.01\", \"stage.compress.speed=0.1\", "
                                                "\"stage.unload.speed=0.1\", \"stage.crush.speed=0.1\", \"stage.settle.max_duration=5\"]"};
  const ProgramResult whole = run_program(study.words("whole", small));
  ASSERT_EQ(whole.exit_code, 0) << whole.report();
  const Study read = read_study(study.file(), {small[1]});
  const StudyPlan plan = make_plan(read);
  const auto judged = [&](const fs::path& folder) {
    std::set<std::string> damaged;
    std::map<std::string, Statement> out;
    for (const Statement& s : judge(plan, analyse(plan, folder, damaged))) out.emplace(s.part + s.figure + s.text, s);
    EXPECT_TRUE(damaged.empty());
    return out;
  };
  const auto all = judged(study.folder / "whole");
  std::size_t lost = 0;
  for (const Job& job : plan.jobs) {
    const fs::path folder = study.folder / ("without-" + job.name);
    fs::copy(study.folder / "whole", folder, fs::copy_options::recursive);
    fs::remove_all(folder / "runs" / job.name);
    const auto some = judged(folder);
    for (const auto& [what, s] : some) {
      if (!s.holds) continue;
      const auto before = all.find(what);
      ASSERT_NE(before, all.end()) << what;
      EXPECT_EQ(s.number, before->second.number) << job.name << " is missing: " << what;
      EXPECT_EQ(s.holds, before->second.holds) << what;
    }
    for (const auto& [what, s] : all) lost += s.holds && (some.find(what) == some.end() || !some.at(what).holds);
  }
  EXPECT_GT(lost, 20u) << "nothing was lost: the test shows nothing";
}

}  // namespace
}  // namespace platen::test
