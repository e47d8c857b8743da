// Runs as a whole: rows of the series, what may not change a bit, exit codes, the time step.
#include <algorithm>
#include <atomic>
#include <map>

#include <nlohmann/json.hpp>

#include "tests/experiment_case.h"
#include "tests/scenes.h"

namespace platen::test {
namespace {

const std::string short_protocol = small_bed + fill + press + unload + time_passes("10 ms");

nlohmann::json summary(const Trial& run) { return nlohmann::json::parse(read_file(run.path() / "summary.json")); }

// ------------------------------------------------------------------------------------------------------------ series

TEST(Series, RowsStandWhereTheyMust) {
  for (const char* interval : {"1 ms", "0.33 ms", "7 us"}) {
    const Trial run =
        run_case(small_bed + fill + press, {"particles.count=30", std::string("output.series=\"") + interval + "\""});
    ASSERT_EQ(run.outcome.exit_code, exit_done) << run.outcome.message;
    const double every = run.c.output.series, dt = 1e-5;
    for (const StageResult& stage : run.outcome.stages) {
      const auto rows = run.rows(stage.name);
      std::vector<std::int64_t> expected{stage.first_step};
      // First steps at or after multiples of the interval; a multiple is met when it is missed by rounding alone.
      for (auto k = static_cast<std::int64_t>(static_cast<double>(stage.first_step) * dt / every);; ++k) {
        const auto step = static_cast<std::int64_t>(std::ceil(static_cast<double>(k) * every / dt - 1e-6));
        if (step >= stage.last_step) break;
        if (step > expected.back()) expected.push_back(step);
      }
      expected.push_back(stage.last_step);
      ASSERT_EQ(rows.size(), expected.size()) << stage.name << " " << interval;
      for (std::size_t k = 0; k < rows.size(); ++k)
        EXPECT_EQ(static_cast<std::int64_t>(run.at(rows[k], "step")), expected[k]);
    }
  }
}

// ------------------------------------------------------------------------------------------------- what may not matter

TEST(Bits, NeitherOutputsNorListsChangeThem) {
  const std::vector<std::vector<std::string>> settings = {
      {},
      {"output.series=\"30 us\""},
      {"output.series=\"1 s\"", "output.contacts=false", "output.slabs=3"},
      {"output.energy=false"},
      {"engine.skin=\"1.2 mm\""},
      {"engine.skin=\"0.3 mm\"", "engine.inner_gap=\"0.2 mm\""},
      {"engine.batch=8"},
      {"output.frames=\"1 ms\"", "output.checkpoint=\"off\""}};
  for (const std::string step : {"\"10 us\"", "\"auto\""}) {
    std::vector<std::uint64_t> hashes;
    std::vector<std::int64_t> steps;
    for (std::vector<std::string> overrides : settings) {
      overrides.insert(overrides.end(), {"particles.count=40", "time.step=" + step});
      const Trial run = run_case(short_protocol, overrides);
      ASSERT_EQ(run.outcome.exit_code, exit_done) << run.outcome.message;
      hashes.push_back(run.outcome.state_hash);
      steps.push_back(run.outcome.stages.back().last_step);
    }
    for (std::size_t k = 1; k < hashes.size(); ++k) {
      EXPECT_EQ(hashes[k], hashes[0]) << settings[k].front();
      EXPECT_EQ(steps[k], steps[0]) << settings[k].front();
    }
  }
  // The hash is not blind.
  EXPECT_NE(run_case(short_protocol, {"particles.count=40", "case.seed=4"}).outcome.state_hash,
            run_case(short_protocol, {"particles.count=40"}).outcome.state_hash);
}

TEST(Bits, CommonRowsOfDenseAndSparseSeriesAreTheSame) {
  const Trial sparse = run_case(small_bed + fill, {"particles.count=30", "output.series=\"5 ms\""});
  const Trial dense = run_case(small_bed + fill, {"particles.count=30", "output.series=\"0.1 ms\"", "engine.batch=8"});
  std::map<std::string, std::vector<std::string>> by_step;
  for (const auto& row : dense.series.rows) by_step[row[dense.series.index("step")]] = row;
  for (const auto& row : sparse.series.rows) EXPECT_EQ(by_step.at(row[sparse.series.index("step")]), row);
}

TEST(Bits, ThreadsDoNotChangeThem) {
  // Enough spheres for three threads to be of use.
  std::string table = "x,y,z,vx,vy,vz\n";
  scenes::Sequence random(5);
  const double a = 1.95 * 0.0025;
  for (int k = 0; k < 20; ++k)
    for (int j = 0; j < 13; ++j)
      for (int i = 0; i < 13; ++i) {
        for (const int cell : {i, j, k}) table += std::to_string((cell + 0.5 + random.between(-0.02, 0.02)) * a) + ",";
        table += std::to_string(random.between(-0.2, 0.2)) + "," + std::to_string(random.between(-0.2, 0.2)) + ",0\n";
      }
  const std::string box = "[box]\nwidth = " + std::to_string(13 * a) + "\ndepth = " + std::to_string(13 * a) +
                          "\nheight = " + std::to_string(20 * a) + "\n";
  const std::string stages = "[[stage]]\nkind = \"compress\"\nspeed = 0.05\nuntil = { duration = \"3 ms\" }\n" +
                             std::string("[[stage]]\nkind = \"release\"\nmax_duration = \"2 ms\"\n");
  std::vector<std::uint64_t> hashes;
  std::vector<std::string> series;
  for (const int threads : {1, 2, 3}) {
    RunOptions options;
    options.threads = threads;
    const Trial run = run_case(table_case(box + stages, "[plates]\ntop = true\n", "9.81"), {}, options, table);
    ASSERT_EQ(run.outcome.exit_code, exit_goal) << run.outcome.message;
    hashes.push_back(run.outcome.state_hash);
    series.push_back(read_file(run.path() / "series.csv"));
  }
  for (std::size_t k : {1u, 2u}) {
    EXPECT_EQ(hashes[k], hashes[0]);
    EXPECT_EQ(series[k], series[0]);
  }
}

// -------------------------------------------------------------------------------------------------------- exit codes

TEST(Exit, StopAfterEndsWell) {
  RunOptions options;
  options.stop_after = "compress";
  const Trial run = run_case(short_protocol, {"particles.count=30"}, options);
  EXPECT_EQ(run.outcome.exit_code, exit_done);
  ASSERT_EQ(run.outcome.stages.size(), 2u);
  const auto json = summary(run);
  ASSERT_EQ(json["stages"].size(), 2u);
  EXPECT_EQ(json["stages"][1]["end_reason"], "stress 20 kPa reached");
  EXPECT_EQ(json["stages"][0]["end_reason"], "all spheres have landed");
  EXPECT_TRUE(json.contains("state_hash"));
}

// What a user reads: the stress of the contacts is that of the plates at rest, in both files, also without contacts written.
TEST(Bed, StressAndFabricAreWritten) {
  const std::string rest = "[[stage]]\nkind = \"settle\"\nuntil = { kinetic_to_potential = 1e-6, window = \"20 ms\" }\n";
  const Trial run = run_case(small_bed + fill + quick_settle + press + rest, {"output.contacts=false", "stage.4.max_duration=\"5 s\""});
  ASSERT_EQ(run.outcome.exit_code, exit_done) << run.outcome.message;
  const auto json = summary(run)["stages"].back();
  const double V = 4e-4 * json["values"]["height"].get<double>();
  const double plates = json["values"]["stress_top"].get<double>() + json["values"]["potential_energy"].get<double>() / V;
  ASSERT_GT(plates, 1e3);
  EXPECT_NEAR(json["bed"]["stress"][2][2].get<double>(), plates, 0.01 * plates);
  const double ratio = json["bed"]["lateral_stress_ratio"];
  EXPECT_GT(ratio, 0.2);
  EXPECT_LT(ratio, 1.0);
  const auto stress = ResultsFile(run.path() / "results.h5").doubles("/stages/" + json["name"].get<std::string>() + "/stress").values;
  const auto fabric = ResultsFile(run.path() / "results.h5").doubles("/stages/" + json["name"].get<std::string>() + "/fabric").values;
  ASSERT_EQ(stress.size(), 9u);
  for (std::size_t k = 0; k < 9; ++k) EXPECT_EQ(stress[k], json["bed"]["stress"][k / 3][k % 3].get<double>()) << k;
  EXPECT_NEAR(fabric[0] + fabric[4] + fabric[8], 1.0, 1e-12);
}

TEST(Exit, ASignalStopsSoon) {
  std::atomic<int> signal = 0;
  RunOptions options;
  options.stop_signal = &signal;
  options.stage_closed = [&](const StageResult&) { signal = 15; };  // after the first stage
  const Trial run = run_case(short_protocol, {"particles.count=30"}, options);
  EXPECT_EQ(run.outcome.exit_code, exit_stopped);
  EXPECT_NE(run.outcome.message.find("stopped in stage compress: signal 15"), std::string::npos) << run.outcome.message;
  EXPECT_EQ(summary(run)["exit_code"], 75);
  EXPECT_EQ(run.stage("fill").end_reason, "all spheres have landed");
}

TEST(Exit, WallTimeStops) {
  RunOptions options;
  options.max_walltime = 0.05;
  const Trial run = run_case(small_bed + fill + time_passes("50 s"), {"particles.count=30"}, options);
  EXPECT_EQ(run.outcome.exit_code, exit_stopped);
  EXPECT_NE(run.outcome.message.find("wall time of 0.05 s is over"), std::string::npos) << run.outcome.message;
}

// Two spheres shot at each other. At 30 m/s against each other their energy is twice that of an overlap of R.
TEST(Exit, ADeepOverlapStopsTheRunAndNamesTheSpheres) {
  const std::string table = "id,x,y,z,vx\n7,0,0,0,20\n12,0.02,0,0,-20\n40,0.5,0,0,0\n";
  const Trial run = run_case(table_case(time_passes("0.1 ms") + time_passes("50 ms")),
                             {"particles.law.restitution=1.0", "time.step=\"1 us\""}, {}, table);
  EXPECT_EQ(run.outcome.exit_code, exit_numerical);
  const std::string& said = run.outcome.message;
  EXPECT_NE(said.find("spheres 7 at"), std::string::npos) << said;
  EXPECT_NE(said.find("and 12 at ("), std::string::npos) << said;
  EXPECT_NE(said.find("m overlap by 1."), std::string::npos) << said;
  // The step: at 40 m/s relative, 15 mm to the touch, then through R = 2.5 mm of overlap while losing half of the energy at most.
  const auto at = said.find("step ");
  ASSERT_NE(at, std::string::npos);
  const double t = std::stod(said.substr(at + 5)) * 1e-6;
  EXPECT_GT(t, 0.015 / 40.0);
  EXPECT_LT(t, 0.015 / 40.0 + 0.0025 / 40.0 * 1.7);
  // What was there is readable.
  EXPECT_EQ(ResultsFile(run.path() / "results.h5").doubles("/stages/run/particles/position").rows(), 3u);
  const auto json = summary(run);
  EXPECT_EQ(json["exit_code"], 4);
  EXPECT_FALSE(json.contains("state_hash"));
  EXPECT_EQ(json["stages"][1]["end_reason"], "failed");
  EXPECT_GE(json["stages"][1]["steps"].get<std::int64_t>(), 0);
  EXPECT_GT(run.rows("run").size(), 1u);
}

TEST(Exit, ASphereThroughAPlateStopsTheRunAndIsNamed) {
  const std::string table = "id,x,y,z,vz\n3,0.01,0.01,0.02,-300\n";
  const Trial run = run_case(table_case("[box]\nwidth = 0.02\ndepth = 0.02\nheight = 0.04\n" + time_passes("50 ms"),
                                        "[plates]\ntop = false\n"),
                             {"time.step=\"1 us\""}, {}, table);
  EXPECT_EQ(run.outcome.exit_code, exit_numerical);
  EXPECT_NE(run.outcome.message.find("sphere 3 at"), std::string::npos) << run.outcome.message;
  EXPECT_NE(run.outcome.message.find("is in or beyond a plate or wall"), std::string::npos) << run.outcome.message;
  EXPECT_NE(run.outcome.message.find("at step "), std::string::npos) << run.outcome.message;
}

TEST(Exit, ASphereTooFastForAnythingIsNamed) {
  const std::string table = "id,x,y,z,vz\n3,0,0,0,2e4\n5,0.1,0,0,0\n";
  const Trial run = run_case(table_case(time_passes("50 ms")), {}, {}, table);
  EXPECT_EQ(run.outcome.exit_code, exit_numerical);
  EXPECT_NE(run.outcome.message.find("sphere 3 at"), std::string::npos) << run.outcome.message;
}

// ------------------------------------------------------------------------------------------------------------ time step

// Limits of a state as results.h5 has it, from spheres and plates alone.
StepLimits limits_of(const Trial& run, const std::string& stage, double top) {
  const ResultsFile file(run.path() / "results.h5");
  SimulationSetup setup;
  setup.pair = run.c.particles.law, setup.plate = run.c.plates.law;
  setup.width = run.c.box.width, setup.depth = run.c.box.depth, setup.periodic = true;
  const auto x = file.doubles("/stages/" + stage + "/particles/position");
  setup.spheres.position = x.values;
  for (std::size_t k = 0; k < x.rows(); ++k) {
    setup.spheres.id.push_back(static_cast<std::int64_t>(k));
    setup.spheres.radius.push_back(0.0025), setup.spheres.density.push_back(2000.0);
  }
  Simulation sim(std::move(setup));
  sim.set_time_step(1e-6);
  PlaneMotion bottom, lid;
  lid.origin = top;
  sim.set_plane(plate_bottom, bottom), sim.set_plane(plate_top, lid);
  return sim.step_limits();
}

TEST(TimeStep, AutoStaysBelowItsLimitsAndChangesOnTheGrid) {
  for (const char* safety : {"0.2", "1.0"}) {
    const Trial run = run_case(small_bed + fill + time_passes("50 ms") + press + time_passes("100 ms"),
                               {"time.step=\"auto\"", std::string("time.safety=") + safety, "output.series=\"1 us\"",
                                "particles.count=40", "stage.compress.until={ stress = \"40 kPa\" }"});
    ASSERT_EQ(run.outcome.exit_code, exit_done) << run.outcome.message;
    double dt = 0.0;
    int changes = 0;
    for (std::size_t r = 1; r < run.series.rows.size(); ++r) {
      const double steps = run.at(r, "step") - run.at(r - 1, "step");
      if (steps == 0.0) continue;
      const double now = (run.at(r, "time") - run.at(r - 1, "time")) / steps;
      if (dt != 0.0 && std::fabs(now - dt) > 1e-9 * dt) {
        ++changes;
        // Every step has its row: the first one that is longer or shorter follows a look.
        EXPECT_EQ(static_cast<std::int64_t>(run.at(r - 1, "step")) % 32, 0) << run.at(r, "step");
        const double k = 16.0 * std::log2(now);
        EXPECT_NEAR(k, std::round(k), 1e-6) << "steps are powers of 2^(1/16)";
      }
      dt = now;
    }
    EXPECT_GT(changes, 0) << "a bed that is pressed and relieved";
    for (const char* stage : {"run", "compress", "run-2"}) {
      const auto rows = run.rows(stage);
      const std::size_t last = rows.back();
      const double used =
          (run.at(last, "time") - run.at(last - 1, "time")) / (run.at(last, "step") - run.at(last - 1, "step"));
      const double top = run.at(last, "stress_top") > 0.0 ? run.at(last, "height") : 1.0;
      const StepLimits limits = limits_of(run, stage, top);
      // Eigenvalues are good to 1 %; a load that grows by less than 1.3 is not looked at: (1.3)^(1/6) in the step.
      EXPECT_LE(used, 0.8 * limits.dt_limit * 1.01 * 1.045) << stage << " safety " << safety;
      if (std::string(safety) == "0.2") {
        EXPECT_LE(used, 0.2 * limits.dt_pairs * 1.01 * 1.045) << stage;
      }
    }
  }
}

// In the air a shaken bed allows a step that its next impact does not.
TEST(TimeStep, AShakenBedStaysBelowItsLimits) {
  const std::string shake = "[[stage]]\nkind = \"vibrate\"\nfrequency = 60\namplitude = \"1.5 mm\"\nduration = \"0.2 s\"\n";
  const Trial run = run_case(small_bed + fill + shake + time_passes("20 ms"), {"time.step=\"auto\"", "particles.law.k_adh=0", "particles.count=150"});
  ASSERT_EQ(run.outcome.exit_code, exit_done) << run.outcome.message;
  std::istringstream log(read_file(run.path() / "log.jsonl"));
  int looks = 0;
  for (std::string line; std::getline(log, line);) {
    const auto event = nlohmann::json::parse(line);
    if (event["event"] != "limits") continue;
    ++looks;
    EXPECT_LT(event["dt"].get<double>(), event["dt_limit"].get<double>()) << line;
  }
  EXPECT_GT(looks, 3);
  for (const auto& stage : summary(run)["stages"])
    for (const auto& warning : stage["warnings"]) EXPECT_EQ(warning.get<std::string>().find("above dt_limit"), std::string::npos) << stage["name"];
}

TEST(TimeStep, AFixedStepAboveTheLimitIsRefused) {
  const auto parse = [](const std::string& step, const std::string& allow = "false") {
    return parse_case(small_bed + fill, "case.toml", ".", {"time.step=" + step, "time.allow_unstable=" + allow});
  };
  const double limit = first_step(parse("1e-6")).limits.dt_limit;
  EXPECT_NO_THROW(refuse_unstable_step(parse(std::to_string(0.89 * limit * 1e6) + "e-6")));
  EXPECT_THROW(refuse_unstable_step(parse(std::to_string(0.91 * limit * 1e6) + "e-6")), CaseError);
  EXPECT_NO_THROW(refuse_unstable_step(parse(std::to_string(0.91 * limit * 1e6) + "e-6", "true")));
  EXPECT_NO_THROW(refuse_unstable_step(parse("\"auto\"")));
  try {
    refuse_unstable_step(parse("1e-3"));
  } catch (const CaseError& error) {
    EXPECT_NE(std::string(error.what()).find("time.step"), std::string::npos);
    EXPECT_NE(std::string(error.what()).find("dt_limit"), std::string::npos);
  }
  try {
    std::string text = small_bed + fill;
    const std::size_t at = text.find("[time]");
    ASSERT_NE(at, std::string::npos);
    text.replace(at, text.find('\n', text.find("step =", at)) - at, "[time]\nstep = 1e-3");
    refuse_unstable_step(parse_case(text, "case.toml", "."));
    ADD_FAILURE() << "a step of a millisecond";
  } catch (const CaseError& error) {
    const std::string said = error.what();
    EXPECT_EQ(said.find("case.toml:"), 0u) << said;
    EXPECT_NE(said.find(":8: time.step: 0.001 s"), std::string::npos) << said;
  }
}

// 21 us are fine for the loose bed; under load the plates' contacts stiffen and the limit falls below.
TEST(TimeStep, AFixedStepThatCrossesTheLimitInMidRun) {
  const std::vector<std::string> overrides = {"time.step=\"21 us\"", "stage.compress.until={ stress = \"60 kPa\" }"};
  const Trial run = run_case(small_bed + fill + press, overrides);
  ASSERT_NO_THROW(refuse_unstable_step(run.c));
  EXPECT_EQ(run.outcome.exit_code, exit_numerical);
  EXPECT_NE(run.outcome.message.find("the time step 2.1e-05 s is above dt_limit"), std::string::npos)
      << run.outcome.message;
  EXPECT_NE(run.outcome.message.find("at step "), std::string::npos);
  const StageResult& failed = run.stage("compress");
  EXPECT_EQ(std::count(failed.warnings.begin(), failed.warnings.end(), "time step above 0.9 dt_limit"), 1)
      << "at 0.9 of the limit, once";
  EXPECT_EQ(failed.end_reason, "failed");

  std::vector<std::string> at_own_risk = overrides;
  at_own_risk.push_back("time.allow_unstable=true");
  const Trial allowed = run_case(small_bed + fill + press, at_own_risk);
  EXPECT_EQ(allowed.outcome.message.find("dt_limit"), std::string::npos) << allowed.outcome.message;
  const auto& warnings = allowed.stage("compress").warnings;
  EXPECT_NE(std::find(warnings.begin(), warnings.end(), "time step above dt_limit"), warnings.end());
}

}  // namespace
}  // namespace platen::test
