// The energy ledger of whole runs: closed at every stage end, of first order in the step, dissipation only grows
// [docs/laws.md, "Energy"].
#include <map>

#include "tests/experiment_case.h"

namespace platen::test {
namespace {

const char* const dissipations[] = {"plastic_dissipation", "viscous_dissipation", "sliding_dissipation",
                                    "rolling_dissipation"};
const char* const other_lines[] = {"elastic_energy",   "adhesion_energy", "tangential_energy", "plate_energy",
                                   "plate_model_work", "plate_work",      "inserted_energy",   "removed_energy"};

double lost(const Trial& run, std::size_t row) {
  double sum = 0.0;
  for (const char* name : dissipations) sum += run.at(row, name);
  return sum;
}

// The shipped quick case with fewer spheres: fill, settle, compress, unload, release, crush.
const Trial& quick() {
  static const Trial run = run_case(read_file(std::string(PLATEN_SOURCE_DIR) + "/protocol/cases/quick.toml"),
                                    {"particles.count=250", "output.frames=\"off\""});
  return run;
}

TEST(Ledger, ClosesAtEveryStageEndOfTheQuickCase) {
  const Trial& run = quick();
  ASSERT_EQ(run.outcome.exit_code, exit_done) << run.outcome.message;
  ASSERT_EQ(run.outcome.stages.size(), 6u);
  for (const StageResult& stage : run.outcome.stages)
    EXPECT_LT(std::fabs(stage.last.measures.energy_residual), 0.01 * stage.last.measures.ledger.dissipated())
        << stage.name;
}

// A sphere held by cohesion between two heavy ones spins about the line between them and rolls to and fro: no dashpot, no
// slip, nothing from outside. With the present normal instead of that of half a step ago it would not keep its energy.
TEST(Ledger, ASphereThatSpinsBetweenTwoOthersKeepsItsEnergy) {
  for (const bool unequal : {false, true}) {  // kernels for equal spheres hold one mass: the heavy ones make it the others
    SimulationSetup setup;
    setup.gravity = 0.0;
    PairLaw& law = setup.pair;
    law.k1 = 2500.0, law.k2 = 12500.0, law.k_adh = 1250.0, law.f0 = -0.03125;
    law.restitution = 1.0, law.friction = 0.5;
    const double R = 2.5e-3, heavy = unequal ? 1e9 : 1500.0;
    setup.spheres.id = {1, 2, 3};
    setup.spheres.position = {-0.00494084118177007, 0, 0, 0.00494084118177007, 0, 0, 0, 0.000698704813583646, 0};
    setup.spheres.velocity = {0, 0, 0, 0, 0, 0, 0, 0, 0.0419222888150188};
    setup.spheres.spin = {0, 0, 0, 0, 0, 0, 120.0, 0, 0};
    setup.spheres.radius = {R, R, R}, setup.spheres.density = {heavy, heavy, 1500.0};
    Simulation sim(setup);
    sim.set_time_step(2e-5);
    sim.count_inserted();
    const double before = sim.measure().kinetic_energy;
    sim.advance(50'000);
    const Measures after = sim.measure();
    EXPECT_LT(std::fabs(after.energy_residual), 1e-4 * before) << unequal;
    EXPECT_GT(after.kinetic_energy, 0.9 * before) << unequal;
  }
}

TEST(Ledger, TheResidualIsTheSumOfItsLines) {
  const Trial& run = quick();
  for (std::size_t r = 0; r < run.series.rows.size(); ++r) {
    const double sum = run.at(r, "kinetic_energy") + run.at(r, "potential_energy") + run.at(r, "elastic_energy") +
                       run.at(r, "adhesion_energy") + run.at(r, "tangential_energy") + run.at(r, "plate_energy") +
                       lost(run, r) - run.at(r, "plate_model_work") - run.at(r, "plate_work") -
                       run.at(r, "inserted_energy") + run.at(r, "removed_energy");
    // Terms of some 0.01 J, a few roundings each.
    EXPECT_NEAR(run.at(r, "energy_residual"), sum, 1e-15) << r;
  }
  EXPECT_EQ(run.at(0, "energy_residual"), 0.0) << "what is there at the start counts as inserted";
}

TEST(Ledger, DissipationNeverDecreases) {
  const Trial& run = quick();
  for (const char* name : dissipations) {
    const std::vector<double> values = run.series.column(name);
    // The rolling loss of the half step up to now is part of a row; where a stage changes the forces on the spot, that
    // part is found anew.
    const bool half_step = std::string(name) == "rolling_dissipation";
    for (std::size_t r = 1; r < values.size(); ++r) {
      const bool same_step = run.at(r, "step") == run.at(r - 1, "step");
      ASSERT_GE(values[r], values[r - 1] * (half_step && same_step ? 1.0 - 1e-5 : 1.0)) << name << " row " << r;
    }
    EXPECT_GT(values.back(), 0.0) << name;
  }
}

TEST(Ledger, LinesMeanWhatTheySay) {
  const Trial& run = quick();
  const double inserted = run.at(0, "inserted_energy");
  EXPECT_NEAR(inserted, run.at(0, "kinetic_energy") + run.at(0, "potential_energy"), 1e-15) << "spheres in the air";
  for (std::size_t r = 0; r < run.series.rows.size(); ++r) EXPECT_EQ(run.at(r, "inserted_energy"), inserted);
  EXPECT_EQ(run.stage("unload").last.measures.ledger.removed_energy, 0.0);
  EXPECT_GT(run.stage("release").last.measures.ledger.removed_energy, 0.0);
  EXPECT_EQ(run.stage("settle").last.measures.ledger.plate_work, 0.0) << "nothing has moved yet";
  // Work of the plate against the stress: integral of the force over the path, trapezoids between rows.
  const double area = 0.035 * 0.035, speed = 0.015;  // of quick.toml
  const auto rows = run.rows("compress");
  double work = 0.0;
  for (std::size_t k = 1; k < rows.size(); ++k)
    work += 0.5 * (run.at(rows[k], "stress_top") + run.at(rows[k - 1], "stress_top")) * area * speed *
            (run.at(rows[k], "time") - run.at(rows[k - 1], "time"));
  EXPECT_NEAR(run.at(rows.back(), "plate_work"), work, 0.02 * work);
}

TEST(Ledger, WithoutItTheColumnsAreEmptyAndTheBedIsTheSame) {
  std::vector<std::uint64_t> hashes;
  for (const char* energy : {"true", "false"}) {
    const Trial run =
        run_case(small_bed + fill + press, {std::string("output.energy=") + energy, "particles.count=60"});
    ASSERT_EQ(run.outcome.exit_code, exit_done) << run.outcome.message;
    hashes.push_back(run.outcome.state_hash);
    const bool kept = std::string(energy) == "true";
    for (std::size_t r = 0; r < run.series.rows.size(); ++r) {
      for (const char* name : dissipations) ASSERT_NE(run.series.cell(r, name).empty(), kept);
      for (const char* name : other_lines) ASSERT_NE(run.series.cell(r, name).empty(), kept);
      ASSERT_NE(run.series.cell(r, "energy_residual").empty(), kept);
      ASSERT_FALSE(run.series.cell(r, "kinetic_energy").empty());
    }
  }
  EXPECT_EQ(hashes[0], hashes[1]);
}

// Largest magnitude of the residual in each stage, averaged over seeds: at least of order 0.8 in the step. Averaged,
// because beds of different steps are different beds, whose residuals scatter.
TEST(Ledger, TheResidualIsOfFirstOrderInTheStep) {
  const double steps[] = {8e-6, 4e-6, 2e-6};
  std::map<std::string, std::vector<double>> residual;
  for (const double dt : steps) {
    std::map<std::string, double> sum;
    for (int seed = 1; seed <= 3; ++seed) {
      const std::string stages =
          fill + "[[stage]]\nkind = \"settle\"\nuntil = { kinetic_to_potential = 1e-3, window = \"5 ms\" }\n" + press;
      const Trial run = run_case(small_bed + stages,
                                 {"time.step=" + std::to_string(1e6 * dt) + "e-6", "case.seed=" + std::to_string(seed),
                                  "particles.count=150", "output.series=\"1 ms\""});
      ASSERT_EQ(run.outcome.exit_code, exit_done) << run.outcome.message;
      for (const char* stage : {"fill", "compress"}) {
        double largest = 0.0;
        for (const std::size_t r : run.rows(stage))
          largest = std::max(largest, std::fabs(run.at(r, "energy_residual")));
        sum[stage] += largest / 3.0;
      }
    }
    for (const auto& [stage, value] : sum) residual[stage].push_back(value);
  }
  for (const auto& [stage, r] : residual) {
    const double order = std::log(r[0] / r[2]) / std::log(4.0);  // least squares over three equidistant logarithms
    EXPECT_GE(order, 0.8) << stage << ": " << r[0] << " " << r[1] << " " << r[2] << " J";
    EXPECT_GT(r[1], r[2]) << stage;
  }
}

}  // namespace
}  // namespace platen::test
