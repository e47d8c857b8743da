// Stages that make a bed and bring it to rest, through whole runs and by hand.
#include <algorithm>
#include <numbers>

#include "tests/experiment_case.h"

namespace platen::test {
namespace {

TEST(Fill, TheLidStandsAtTheBoxHeightOrJustAboveTheBed) {
  for (const char* height : {"80 mm", "10 mm"}) {
    Bench bench(small_bed + fill, {std::string("box.height=\"") + height + "\""});
    EXPECT_FALSE(bench.sim->plane(plate_top).present) << "no lid while the rain falls";
    bench.drive(0);
    const double highest = bench.sim->measure(false).highest_point, R = 0.0025;
    ASSERT_TRUE(bench.sim->plane(plate_top).present);
    EXPECT_DOUBLE_EQ(bench.sim->plane_position(plate_top), std::max(bench.c.box.height, highest + 0.1 * R));
    EXPECT_EQ(bench.sim->plane(plate_top).velocity, 0.0);
    EXPECT_GT(highest, 0.02) << "100 spheres on 20 x 20 mm";
    EXPECT_LT(highest, 0.05);
  }
}

TEST(Fill, RainGivesALooseBedWhoseSpheresHaveAllLanded) {
  const Trial run = run_case(small_bed + fill);
  ASSERT_EQ(run.outcome.exit_code, exit_done) << run.outcome.message;
  const Measures& m = run.stage("fill").last.measures;
  // To the highest sphere, so a rough surface counts as pores: far looser than the 0.36 of a dense random packing.
  EXPECT_GT(m.porosity, 0.42);
  EXPECT_LT(m.porosity, 0.62);
  EXPECT_NEAR(m.support_force, m.weight, 0.1 * m.weight);
  const ResultsFile file(run.path() / "results.h5");
  const auto v = file.doubles("/stages/fill/particles/velocity"), x = file.doubles("/stages/fill/particles/position");
  ASSERT_EQ(v.rows(), 100u);
  for (std::size_t k = 0; k < v.rows(); ++k) {
    const double v2 = v.at(k, 0) * v.at(k, 0) + v.at(k, 1) * v.at(k, 1) + v.at(k, 2) * v.at(k, 2);
    EXPECT_LT(v2, 2.1 * 9.81 * 0.0025) << "sphere " << k << " is still falling";
    EXPECT_GT(x.at(k, 2), 0.99 * 0.0025);
    for (std::size_t axis : {0u, 1u}) EXPECT_TRUE(x.at(k, axis) >= 0.0 && x.at(k, axis) < 0.02);
  }
}

TEST(Fill, SpheresThatTouchNoOtherHaveLandedToo) {
  const Trial run = run_case(small_bed + fill, {"particles.count=3", "box.width=\"60 mm\"", "box.depth=\"60 mm\"", "particles.law.k_adh=0"});
  ASSERT_EQ(run.outcome.exit_code, exit_done) << run.outcome.message;
  EXPECT_EQ(run.stage("fill").last.measures.contacts, 0);
  EXPECT_LT(run.stage("fill").last.measures.time, 2.0);
}

const std::string slow_rain = "[[stage]]\nkind = \"fill\"\nduration = \"0.6 s\"\noutlet = \"60 mm\"\n";
constexpr double outlet = 0.06, drop_speed = 0.5;

TEST(Fill, ARainOfADurationFallsFromItsOutlet) {
  const Trial run = run_case(small_bed + slow_rain + quick_settle, {"particles.law.f0=-0.1"});
  ASSERT_EQ(run.outcome.exit_code, exit_done) << run.outcome.message;
  const StageResult& stage = run.stage("fill");
  EXPECT_GT(stage.time_end, 0.6 - 0.05) << "the last ones come at its end";
  EXPECT_LT(stage.time_end, 0.6 + 0.3);
  const auto& rows = run.series.rows;
  const double most = 0.5 * (drop_speed * drop_speed + 2.0 * 9.81 * outlet);
  const double mass = run.stage("fill").last.measures.weight / 9.81;
  bool some_left = false;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    EXPECT_LT(run.series.number(k, "kinetic_energy"), 1.02 * most * mass) << k;
    some_left = some_left || (run.series.number(k, "time") > 0.3 && run.series.number(k, "height") > outlet + 0.1);
  }
  EXPECT_TRUE(some_left) << "a column of 0.3 m at the start, 0.15 m at half the time";
  const Measures& m = run.stage("settle").last.measures;
  EXPECT_NEAR(m.support_force, m.weight, 0.01 * m.weight);
  EXPECT_LT(std::fabs(m.energy_residual), 0.01 * m.ledger.dissipated()) << "what the outlet takes counts as never put in";
}

// What bounces straight up from the plate is no longer in the outlet, however low that is.
TEST(Fill, ALowOutletLetsGoOfWhatBounces) {
  for (const char* restitution : {"0.4", "0.9"}) {
    const Trial run = run_case(small_bed + "[[stage]]\nkind = \"fill\"\nduration = \"0.2 s\"\noutlet = \"3 mm\"\nmax_duration = 1e30\n",
                               {"particles.count=10", std::string("plates.restitution=") + restitution});
    EXPECT_EQ(run.outcome.exit_code, exit_done) << restitution << ": " << run.outcome.message;
  }
}

TEST(Fill, TheOutletCarriesThoseThatHaveMetNothing) {
  SimulationSetup s;
  s.pair.k1 = 5e3, s.pair.k2 = 25e3;
  s.plate.particle_young_modulus = 2.6e8, s.plate.young_modulus = 2.5e10;
  s.spheres.id = {0, 1, 2, 3, 4, 5};
  s.spheres.radius.assign(6, 0.0025), s.spheres.density.assign(6, 2000.0);
  s.spheres.position = {0.01, 0.01, 0.10, 0.03, 0.01, 0.04, 0.05, 0.01, 0.10, 0.07, 0.01, 0.10, 0.09, 0.01, 0.10, 0.11, 0.01, 0.10};
  s.spheres.velocity = {0, 0, -1, 0, 0, -1, 1e-9, 0, -1, 0, 0, -1, 0, 0, 0.2, 0, 0, -0.3};
  s.spheres.spin = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1e-9, 0, 0, 0, 0, 0, 0, 0};
  Simulation sim(s);
  sim.set_time_step(1e-5);
  sim.count_inserted();
  sim.advance(100);
  const Measures before = sim.measure();
  EXPECT_EQ(sim.carry_down(0.05, 0.5), 1);
  const Measures after = sim.measure();
  const Snapshot snapshot = sim.snapshot();
  const double fallen = -1.0 - 9.81 * 1e-3, m = after.weight / (6.0 * 9.81);
  const double half = 0.5 * 9.81 * 1e-5;  // velocities are half a step old
  EXPECT_NEAR(snapshot.particles.velocity[2], -0.5 - half, 1e-12);
  for (std::size_t k : {1u, 2u, 3u}) EXPECT_NEAR(snapshot.particles.velocity[3 * k + 2], fallen, 1e-12) << k;
  EXPECT_NEAR(snapshot.particles.velocity[3 * 4 + 2], 0.2 - 9.81e-3, 1e-12) << "on its way up";
  EXPECT_NEAR(snapshot.particles.velocity[3 * 5 + 2], -0.3 - 9.81e-3, 1e-12) << "slower than the outlet";
  EXPECT_NEAR(after.kinetic_energy - before.kinetic_energy, 0.5 * m * ((0.5 + half) * (0.5 + half) - fallen * fallen), 1e-9 * before.kinetic_energy);
  EXPECT_NEAR(after.energy_residual, before.energy_residual, 1e-12 * before.kinetic_energy);
}

TEST(Fill, WallsKeepTheSpheresInside) {
  const Trial run = run_case(small_bed + fill + quick_settle, {"box.sides=\"walls\"", "particles.count=80"});
  ASSERT_EQ(run.outcome.exit_code, exit_done) << run.outcome.message;
  const auto x = ResultsFile(run.path() / "results.h5").doubles("/particles/position");
  for (std::size_t k = 0; k < x.rows(); ++k)
    for (std::size_t axis : {0u, 1u}) {
      EXPECT_GT(x.at(k, axis), 0.99 * 0.0025);
      EXPECT_LT(x.at(k, axis), 0.02 - 0.99 * 0.0025);
    }
  const Measures& m = run.stage("settle").last.measures;
  EXPECT_NEAR(m.support_force, m.weight, 0.01 * m.weight) << "bottom plus friction of the walls";
  EXPECT_GT(std::fabs(m.stress_bottom * 4e-4 - m.weight), 1e-3 * m.weight) << "walls push up or down by friction";
}

TEST(Fill, GrowthReachesItsPorosityWithoutTime) {
  const Trial run = run_case(small_bed + "[[stage]]\nkind = \"fill\"\nmethod = \"grow\"\nporosity = 0.5\n");
  ASSERT_EQ(run.outcome.exit_code, exit_done) << run.outcome.message;
  EXPECT_EQ(run.stage("fill").last_step, 0);
  const double R = 0.0025, solid = 100 * 4.0 / 3.0 * std::numbers::pi * R * R * R, height = solid / (4e-4 * 0.5);
  const ResultsFile file(run.path() / "results.h5");
  const auto x = file.doubles("/particles/position");
  double highest = 0.0;
  for (std::size_t k = 0; k < x.rows(); ++k) {
    highest = std::max(highest, x.at(k, 2) + R);
    EXPECT_GT(x.at(k, 2), R * (1.0 - 1.1e-3));
  }
  EXPECT_LT(highest, height + 1.1e-3 * R);
  EXPECT_GT(highest, height - R) << "the bed fills its height";
  const auto overlap = file.doubles("/contacts/overlap");
  for (std::size_t k = 0; k < overlap.rows(); ++k) EXPECT_LT(overlap.at(k), 1.1e-3 * R);
}

TEST(Fill, APorosityThatCannotBeHadIsSaid) {
  const Trial run = run_case(small_bed + "[[stage]]\nkind = \"fill\"\nmethod = \"grow\"\nporosity = 0.2\n");
  EXPECT_EQ(run.outcome.exit_code, exit_numerical);
  EXPECT_NE(run.outcome.message.find("porosity of 0.2 cannot be reached"), std::string::npos) << run.outcome.message;
  EXPECT_TRUE(std::filesystem::exists(run.path() / "summary.json"));
}

TEST(Fill, SizesOfADistributionAndOtherExponents) {
  const std::string sizes =
      "particles.sizes={ kind = \"lognormal\", median = \"2.5 mm\", sigma = 0.2, min = \"2 mm\", max = \"3 mm\" }";
  std::string text = small_bed + fill + quick_settle;
  text.replace(text.find("radius = \"2.5 mm\"\n"), std::string("radius = \"2.5 mm\"\n").size(), "");
  // k delta^1.5 like 5 kN/m at an overlap of 1 % of R.
  const Trial run = run_case(text, {sizes, "box.width=\"24 mm\"", "particles.law.exponent=1.5", "particles.law.k1=1e6",
                                    "particles.law.k2=5e6", "particles.law.k_adh=1e6", "time.step=\"auto\""});
  ASSERT_EQ(run.outcome.exit_code, exit_done) << run.outcome.message;
  const auto R = ResultsFile(run.path() / "results.h5").doubles("/particles/radius");
  const auto [low, high] = std::minmax_element(R.values.begin(), R.values.end());
  EXPECT_GE(*low, 0.002);
  EXPECT_LE(*high, 0.003);
  EXPECT_GT(*high - *low, 5e-4) << "a distribution";
  const Measures& m = run.stage("settle").last.measures;
  EXPECT_NEAR(m.stress_bottom, m.weight / (0.024 * 0.02), 0.01 * m.stress_bottom);
  EXPECT_LT(std::fabs(m.energy_residual), 0.01 * m.ledger.dissipated());
}

TEST(Vibrate, TheBottomIsASineAndEndsExactlyAtZero) {
  const std::string shake =
      "[[stage]]\nkind = \"vibrate\"\nfrequency = 60\namplitude = \"1.5 mm\"\nduration = \"40 ms\"\n";
  Bench bench(small_bed + fill + shake, {"particles.count=20"});
  bench.drive(0);
  Stand stand = bench.stand(1);
  VibrateStage stage;
  stage.begin(stand);
  const std::int64_t last = *stage.last_step(stand);
  EXPECT_EQ(last - stand.first_step, 4000);
  const double begin = bench.sim->time(), A = 1.5e-3, w = 2.0 * std::numbers::pi * 60.0;
  double highest = 0.0;
  while (bench.sim->step() < last) {
    bench.sim->advance(std::min<std::int64_t>(7, last - bench.sim->step()));
    // Half way the automatic step changes: the plate must not notice.
    if (bench.sim->step() - stand.first_step == 7 * 100) bench.sim->set_time_step(8e-6), bench.sim->set_time_step(1e-5);
    const double t = bench.sim->time() - begin, z = bench.sim->plane_position(plate_bottom);
    if (t < 2.0 / 60.0 - 1e-9) {
      EXPECT_NEAR(z, A * std::sin(w * t), 1e-12 * A + 1e-15) << t;
    } else {
      EXPECT_EQ(z, 0.0) << "two whole periods, then rest";
    }
    highest = std::max(highest, z);
  }
  EXPECT_NEAR(highest, A, 1e-3 * A);
  StageResult result;
  stage.end(stand, result);
  EXPECT_EQ(bench.sim->plane_position(plate_bottom), 0.0);
  EXPECT_EQ(bench.sim->plane(plate_bottom).velocity_at(bench.sim->step()), 0.0);
}

TEST(Vibrate, TakesItsDurationAndDensifies) {
  const std::string shake =
      "[[stage]]\nkind = \"vibrate\"\nfrequency = 60\namplitude = \"1.5 mm\"\nduration = \"0.3 s\"\n";
  const Trial run = run_case(small_bed + fill + shake + quick_settle, {"particles.law.k_adh=0", "particles.count=150"});
  ASSERT_EQ(run.outcome.exit_code, exit_done) << run.outcome.message;
  EXPECT_EQ(run.stage("vibrate").last_step - run.stage("vibrate").first_step, 30000);
  EXPECT_EQ(run.stage("vibrate").end_reason, "duration 0.3 s over");
  // By the mean height of the spheres: the porosity of so small a bed hangs on its highest sphere.
  EXPECT_LT(run.stage("settle").last.measures.potential_energy, run.stage("fill").last.measures.potential_energy);
  EXPECT_GT(run.stage("vibrate").last.measures.ledger.plate_work, 0.0);
  // The first slab begins at the bottom plate.
  const auto z = ResultsFile(run.path() / "results.h5").doubles("/profiles/vibrate/z");
  EXPECT_NEAR(z.at(0) - 0.5 * (z.at(1) - z.at(0)), 0.0, 1e-16);
}

// The criterion from the rows: at its end, and not a look earlier.
TEST(Settle, EndsWithTheFirstWindowOfRest) {
  const Trial run = run_case(
      small_bed + fill + "[[stage]]\nkind = \"settle\"\nuntil = { kinetic_to_potential = 2e-5, window = \"30 ms\" }\n");
  ASSERT_EQ(run.outcome.exit_code, exit_done) << run.outcome.message;
  const auto rows = run.rows("settle");
  ASSERT_GT(rows.size(), 90u);
  const double own = run.weight_stress();
  const auto rests = [&](std::size_t last) {
    const double begin = run.at(rows[last], "time") - 0.03;
    if (run.at(rows[1], "time") > begin) return false;  // looks begin behind the stage's first row
    double low = 1e9, high = 0.0, sum = 0.0;
    int n = 0;
    for (std::size_t k = last + 1; k-- > 1;) {
      const std::size_t r = rows[k];
      if (run.at(r, "kinetic_energy") > 2e-5 * run.at(r, "potential_energy")) return false;
      if (std::fabs(run.at(r, "stress_bottom") - run.at(r, "stress_top") - own) > 0.01 * own) return false;
      const double Z = run.at(r, "coordination_number");
      low = std::min(low, Z), high = std::max(high, Z), sum += Z, ++n;
      if (run.at(r, "time") <= begin) break;
    }
    return high - low <= 0.005 * sum / n;
  };
  // The stage may begin between two looks and ends at one: the last row is a look, as are those a whole grid apart.
  ASSERT_EQ(static_cast<std::int64_t>(run.at(rows.back(), "step")) % 32, 0);
  EXPECT_TRUE(rests(rows.size() - 1));
  EXPECT_FALSE(rests(rows.size() - 2));
  EXPECT_EQ(run.stage("settle").end_reason, "at rest for 0.03 s");
}

TEST(Settle, ABedThatNeverRestsEndsWithExitCode6AndItsData) {
  const Trial run =
      run_case(small_bed + fill +
               "[[stage]]\nkind = \"settle\"\nmax_duration = \"20 ms\"\nuntil = { kinetic_to_potential = 1e-30 }\n" +
               time_passes("1 ms"));
  EXPECT_EQ(run.outcome.exit_code, exit_goal);
  EXPECT_NE(run.outcome.message.find("settle: goal not reached within max_duration"), std::string::npos)
      << run.outcome.message;
  EXPECT_NE(run.outcome.message.find("kinetic over potential energy "), std::string::npos) << run.outcome.message;
  EXPECT_NE(run.outcome.message.find(" % of the weight (wanted: 100 within 1)"), std::string::npos) << run.outcome.message;
  ASSERT_EQ(run.outcome.stages.size(), 2u) << "nothing runs after it";
  EXPECT_EQ(run.stage("settle").last_step - run.stage("settle").first_step, 2000);
  EXPECT_FALSE(run.stage("settle").reached);
  EXPECT_EQ(ResultsFile(run.path() / "results.h5").doubles("/stages/settle/particles/position").rows(), 100u);
  EXPECT_NE(read_file(run.path() / "summary.json").find("\"exit_code\": 6"), std::string::npos);
}

TEST(Settle, WithoutGravityTheEnergyOfTheStartIsTheMeasure) {
  // Two spheres that meet and stick [A45]; open sides, no plates, no box.
  const std::string table = "x,y,z,vx\n0,0,0,0.1\n0.0051,0,0,-0.1\n";
  const Trial run =
      run_case(table_case("[[stage]]\nkind = \"settle\"\nuntil = { window = \"10 ms\" }\n"), {}, {}, table);
  ASSERT_EQ(run.outcome.exit_code, exit_done) << run.outcome.message;
  const auto rows = run.rows("settle");
  const double start = run.at(rows.front(), "kinetic_energy");
  EXPECT_NEAR(start, 4.0 / 3.0 * std::numbers::pi * std::pow(0.0025, 3) * 2000 * 0.01, 1e-9 * start);
  const double end = run.at(rows.back(), "time");
  for (const std::size_t r : rows)
    if (run.at(r, "time") >= end - 0.01) {
      EXPECT_LE(run.at(r, "kinetic_energy"), 1e-5 * start);
    }
  EXPECT_EQ(run.at(rows.back(), "contacts"), 1.0);
  EXPECT_TRUE(std::isnan(run.at(rows.back(), "kinetic_to_potential"))) << "no meaning without gravity";
  EXPECT_EQ(run.at(rows.back(), "stress_top"), 0.0);
}

TEST(Settle, SpheresThatNeverMoveAreAtRest) {
  const std::string table = "x,y,z\n0,0,0\n0.01,0,0\n";
  const Trial run =
      run_case(table_case("[[stage]]\nkind = \"settle\"\nmax_duration = \"1 s\"\nuntil = { window = \"10 ms\" }\n"), {},
               {}, table);
  EXPECT_EQ(run.outcome.exit_code, exit_done) << run.outcome.message;
  EXPECT_NEAR(run.stage("settle").time_end, 0.01, 2 * 3.2e-4);
}

TEST(Settle, WithoutGravityABedThatOnlyThenStartsToMoveComesToRest) {
  // Overlapping spheres at rest push each other: there is no energy at the start to compare with.
  const std::string table = "x,y,z\n0,0,0\n0.0049,0,0\n0.0024,0.0043,0\n";
  const Trial run =
      run_case(table_case("[[stage]]\nkind = \"settle\"\nmax_duration = \"2 s\"\nuntil = { window = \"10 ms\" }\n"),
               {"particles.law.k_adh=5e3"}, {}, table);
  EXPECT_EQ(run.outcome.exit_code, exit_done) << run.outcome.message;
}

TEST(RunStage, TakesExactlyItsTime) {
  // A free fall: the scheme is exact for a constant acceleration.
  const std::string table = "x,y,z,vx,vz\n0,0,1,0.2,0.3\n";
  const Trial run = run_case(table_case(time_passes("5 ms") + time_passes("20 ms"), "", "9.81"), {}, {}, table);
  ASSERT_EQ(run.outcome.exit_code, exit_done) << run.outcome.message;
  EXPECT_EQ(run.stage("run").last_step, 500);
  EXPECT_EQ(run.stage("run-2").last_step, 2500);
  const ResultsFile file(run.path() / "results.h5");
  const auto x = file.doubles("/particles/position"), v = file.doubles("/particles/velocity");
  const double t = 0.025;
  EXPECT_NEAR(x.at(0, 0), 0.2 * t, 1e-14);
  EXPECT_NEAR(x.at(0, 2), 1.0 + 0.3 * t - 0.5 * 9.81 * t * t, 1e-13);
  EXPECT_NEAR(v.at(0, 2), 0.3 - 9.81 * t, 1e-13);
}

TEST(RunStage, HalfAStepMoreEndsAtTheSameStepHoweverOftenRowsAreWritten) {
  const std::string table = "x,y,z\n0,0,1\n";
  for (const auto& [duration, steps] :
       {std::pair("1 ms", 62.5), std::pair("1.008 ms", 63.0), std::pair("0.5 ms", 31.25)}) {  // of 16 us
    std::vector<std::int64_t> last;
    for (const char* series : {"1 s", "16 us", "0.2 ms", "31 us"}) {
      const Trial run = run_case(table_case(time_passes(duration), "", "9.81"),
                                 {"time.step=\"16 us\"", std::string("output.series=\"") + series + "\""}, {}, table);
      ASSERT_EQ(run.outcome.exit_code, exit_done) << run.outcome.message;
      last.push_back(run.stage("run").last_step);
    }
    EXPECT_LE(std::fabs(static_cast<double>(last[0]) - steps), 0.5);
    for (const std::int64_t step : last) EXPECT_EQ(step, last[0]) << duration;
  }
}

}  // namespace
}  // namespace platen::test
