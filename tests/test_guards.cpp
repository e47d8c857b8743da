// Faults put into a running bed must end the run within one look, and the message must name the step, the spheres and
// what to change.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "kernels/law_phase.h"
#include "tests/experiment_case.h"
#include "tests/scenes.h"

namespace platen {
namespace {

using namespace test;

constexpr double inf = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();

// What the engine says while it goes on; "" where nothing is wrong.
std::string said_by(Simulation& sim, std::int64_t steps) {
  try {
    sim.advance(steps);
  } catch (const RunError& error) {
    return error.what();
  }
  return "";
}

// What the engine says when `fault` has been put into a bed at step 20; "" where it goes on as if nothing were wrong.
// A running Simulation cannot be written to from outside; only this test does so.
template <class Fault>
std::string said_after(InstructionSet set, int threads, const Fault& fault, const PairLaw& law = scenes::full_law(), bool energy = true) {
  EngineOptions engine;
  engine.instruction_set = set, engine.threads = threads, engine.batch = 16, engine.energy = energy;
  scenes::BedOptions options;
  Simulation sim(scenes::bed(options, law, engine));
  sim.set_time_step(2e-6);
  scenes::add_plates(sim, options.nz * options.spacing * options.R + 0.02 * options.R, -0.1);
  sim.advance(20);
  const Particles& state = sim.state();
  std::int32_t k = 0;  // the sphere of id 10 + 3 * 21, in the middle of the bed
  while (state.id_of_rank[static_cast<std::size_t>(state.rank[static_cast<std::size_t>(k)])] != 73) ++k;
  fault(const_cast<Particles&>(state), const_cast<std::vector<Batch>&>(sim.batches()), static_cast<std::size_t>(k));
  const_cast<Particles&>(state).write_rows();
  return said_by(sim, 32);
}

void expect_named(const std::string& said, const std::string& what) {
  EXPECT_NE(said.find(what), std::string::npos) << said;
  const auto at = said.find("at step ");
  ASSERT_NE(at, std::string::npos) << said;
  const int step = std::stoi(said.substr(at + 8));
  EXPECT_GE(step, 20) << said;
  EXPECT_LE(step, 52) << said;
  EXPECT_NE(said.find("73 at ("), std::string::npos) << said;
  EXPECT_NE(said.find("a smaller time step"), std::string::npos) << said;
}

TEST(Guards, AVelocityThatIsNoNumber) {
  for (const InstructionSet set : available_instruction_sets())
    for (const int threads : {1, 3})
      for (const double wrong : {nan, inf, -inf, 1e200})
        for (const bool spin : {false, true}) {
          SCOPED_TRACE(std::string(to_string(set)) + " " + std::to_string(threads) + " " + std::to_string(wrong));
          const std::string said = said_after(set, threads, [&](Particles& p, std::vector<Batch>&, std::size_t k) { (spin ? p.ux : p.vx)[k] = wrong; });
          expect_named(said, "at step ");
        }
}

// Of a sphere that touches nobody, in beds with and without rolling friction and energy terms.
TEST(Guards, ASpinThatIsNoNumberOfAFreeSphere) {
  for (const InstructionSet set : available_instruction_sets())
    for (const double mu_r : {0.0, 0.01})
      for (const bool energy : {true, false})
        for (const double wrong : {0.0, nan, inf, -inf}) {
          EngineOptions engine;
          engine.instruction_set = set, engine.energy = energy;
          PairLaw law = scenes::full_law();
          law.rolling_friction = mu_r;
          scenes::BedOptions options;
          options.spacing = 3.0;
          SimulationSetup setup = scenes::bed(options, law, engine);
          setup.plate.rolling_friction = mu_r;
          Simulation sim(std::move(setup));
          sim.set_time_step(2e-6);
          sim.advance(20);
          const_cast<Particles&>(sim.state()).uy[40] = wrong;
          const_cast<Particles&>(sim.state()).write_rows();
          const std::string said = said_by(sim, 32);
          EXPECT_EQ(said.empty(), wrong == 0.0) << said;
          EXPECT_TRUE(wrong == 0.0 || said.find("a smaller time step") != std::string::npos) << said;
        }
}

TEST(Guards, ASphereAsFastAsNoneCanBe) {
  for (const InstructionSet set : available_instruction_sets()) {
    const std::string said = said_after(set, 1, [](Particles& p, std::vector<Batch>&, std::size_t k) { p.vz[k] = 5e3; });
    expect_named(said, "in one step");
  }
}

// A history that no path of overlaps leads to: its force is beyond what an overlap of R/2 could give.
TEST(Guards, AForceBeyondAnyCredibleOne) {
  for (const InstructionSet set : available_instruction_sets())
    for (const double wrong : {1e9, nan}) {
      const std::string said = said_after(set, 1, [&](Particles& p, std::vector<Batch>& batches, std::size_t k) {
        for (Batch& b : batches)
          for (std::size_t m = 0; m < static_cast<std::size_t>(b.used); ++m)
            if (static_cast<std::size_t>(b.i(m)) == k || static_cast<std::size_t>(b.j(m)) == k) {
              (std::isnan(wrong) ? b.tx : b.ty)[m] = wrong;
              // Without friction's limit nothing would be left of it: the pair is made to stick.
              b.sp[m] = -1.0;
            }
        (void)p;
      }, [] {
        PairLaw law = scenes::full_law();
        law.friction = 1e12;
        return law;
      }());
      EXPECT_NE(said.find("out of range at step "), std::string::npos) << said;
      EXPECT_NE(said.find("73 at ("), std::string::npos) << said;
      EXPECT_NE(said.find("; spheres "), std::string::npos) << said;
      EXPECT_NE(said.find(" N, rub with "), std::string::npos) << said;
      EXPECT_NE(said.find("a smaller time step"), std::string::npos) << said;
    }
}

TEST(Guards, OverlapsAboveR) {
  for (const InstructionSet set : available_instruction_sets()) {
    EngineOptions engine;
    engine.instruction_set = set;
    scenes::BedOptions options;
    options.nx = options.ny = 7;  // the box must be wide enough for a sphere not to meet another one twice
    options.spacing = 0.9;
    Simulation sim(scenes::bed(options, scenes::full_law(), engine));
    sim.set_time_step(2e-6);
    const std::string said = said_by(sim, 1);
    EXPECT_NE(said.find("forces out of range at step 0"), std::string::npos) << said;
    EXPECT_NE(said.find("; spheres "), std::string::npos) << said;
    for (const char* what : {" overlap by 1.", " R (plastic ", "approach at ", "push with ", "a smaller time step"}) EXPECT_NE(said.find(what), std::string::npos) << said;
  }
}

// With ordinary friction the limit makes an end of any spring, but not of one that is no number; with the ledger off no
// energy shows it.
TEST(Guards, AHistoryThatIsNoNumber) {
  for (const InstructionSet set : available_instruction_sets())
    for (const bool energy : {true, false}) {
      const std::string said = said_after(set, 1, [&](Particles&, std::vector<Batch>& batches, std::size_t k) {
        for (Batch& b : batches)
          for (std::size_t m = 0; m < static_cast<std::size_t>(b.used); ++m)
            if (static_cast<std::size_t>(b.i(m)) == k || static_cast<std::size_t>(b.j(m)) == k) b.tx[m] = nan;
      }, scenes::full_law(), energy);
      EXPECT_NE(said.find(energy ? "out of range at step 21 " : "out of range at step 22 "), std::string::npos) << to_string(set) << energy << said;
      EXPECT_NE(said.find("; sphere"), std::string::npos) << said;
    }
}

// A dashpot at a hundred times R omega, long before the overlap is deep.
TEST(Guards, AnImpactThatNoSphereSurvives) {
  for (const InstructionSet set : available_instruction_sets()) {
    EngineOptions engine;
    engine.instruction_set = set;
    SimulationSetup setup;
    setup.pair = scenes::full_law(), setup.engine = engine, setup.gravity = 0.0;
    const double R = 0.0025, omega = std::sqrt(setup.pair.k2 / sphere_mass(R, 2000.0));
    setup.spheres.id = {1, 2};
    setup.spheres.position = {0, 0, 0, 1.999 * R, 0, 0};
    setup.spheres.velocity = {100.0 * R * omega, 0, 0, 0, 0, 0};
    setup.spheres.radius = {R, R}, setup.spheres.density = {2000.0, 2000.0};
    Simulation sim(setup);
    sim.set_time_step(1e-9);
    const std::string said = said_by(sim, 4);
    EXPECT_NE(said.find("out of range at step 1 "), std::string::npos) << to_string(set) << said;
  }
}

// A sphere that a plate stops hard is no fault: only what pairs push with has the limit.
TEST(Guards, APlateMayPushHarderThanPairs) {
  for (const int batch : {0, 8}) {
    EngineOptions engine;
    engine.batch = batch;
    SimulationSetup setup;
    setup.pair = scenes::full_law(), setup.engine = engine, setup.gravity = 0.0;
    setup.plate.particle_young_modulus = 7e10, setup.plate.young_modulus = 7e10;
    const double R = 0.0025;
    for (int k = 0; k < 24; ++k) {
      setup.spheres.id.push_back(k);
      for (const double x : {3.0 * R * k, 0.0, 1.001 * R}) setup.spheres.position.push_back(x);
      for (const double v : {0.0, 0.0, -20.0}) setup.spheres.velocity.push_back(k == 3 ? v : 0.0);
      setup.spheres.radius.push_back(R), setup.spheres.density.push_back(2000.0);
    }
    Simulation sim(setup);
    sim.set_time_step(1e-7);
    PlaneMotion bottom;
    sim.set_plane(plate_bottom, bottom);
    double strongest = 0.0;
    for (int k = 0; k < 400; ++k) {
      ASSERT_NO_THROW(sim.advance(1)) << "batch " << batch;
      strongest = std::max(strongest, sim.measure(false).support_force);
    }
    EXPECT_GT(strongest, 4.0 * sim.law().force.bound) << "the plate never pushed hard: the test shows nothing";
  }
}

// A contact is judged by itself: one that is deep does not make a shallow and strong one of its chunk a fault.
TEST(Guards, ForcesOfOneChunkAreJudgedOneByOne) {
  constexpr SceneTraits scene = built_scenes[2].traits;
  static_assert(scene.equal_spheres && scene.rolling == Rolling::absolute);
  constexpr Quantum bound{0.0, 10.0, 0.0};  // nothing is rounded
  Chunk<scene> chunk{};
  ActiveVectors active;
  for (int at = 0; at < 4; ++at) active.at[active.count++] = at, chunk.lever[0][at] = 0.9, chunk.F[0][at] = 1.0;
  chunk.lever[0][1] = 0.6;                      // deep and weak
  chunk.F[1][2] = 12.0;                         // shallow and strong
  EXPECT_FALSE((too_strong<Scalar, scene>(chunk, active, bound, 0.75)));
  EXPECT_TRUE((too_strong<Scalar, scene>(chunk, active, bound, 2.0)));
  chunk.F[2][1] = -12.0;                        // deep and strong
  EXPECT_TRUE((too_strong<Scalar, scene>(chunk, active, bound, 0.75)));
  chunk.F[2][1] = 0.0, chunk.S[0][1] = 12.0;    // by its share in rolling friction
  EXPECT_TRUE((too_strong<Scalar, scene>(chunk, active, bound, 0.75)));
  chunk.S[0][1] = nan;
  EXPECT_TRUE((too_strong<Scalar, scene>(chunk, active, bound, 0.75)));
}

// Between R/2 and R an overlap may be in order, its force not.
TEST(Guards, AForceOfADeepOverlapBeyondItsBound) {
  scenes::BedOptions options;
  options.spacing = 1.1, options.speed = 0.0;  // overlaps of 0.9 R
  for (const InstructionSet set : available_instruction_sets()) {
    EngineOptions engine;
    engine.instruction_set = set;
    PairLaw law = scenes::full_law();
    law.k_adh = law.f0 = 0.0, law.restitution = 1.0;
    law.k1 = law.k2 = 31.0 / (0.5 * options.R);  // 31 N at R/2, so the bound is 32 N; 56 N at 0.9 R
    Simulation sim(scenes::bed(options, law, engine));
    sim.set_time_step(1e-9);
    const std::string said = said_by(sim, 1);
    EXPECT_NE(said.find("forces out of range at step 0"), std::string::npos) << to_string(set) << said;
    EXPECT_NE(said.find(" overlap by 0.9"), std::string::npos) << said;
  }
}

// Forces of chunks with a deep overlap are looked at: what is large but in range must pass.
TEST(Guards, ManyStrongForcesAreNoFault) {
  scenes::BedOptions options;
  options.spacing = 1.1;  // overlaps of 0.9 R: below R, forces half their bound
  options.speed = 0.0;
  for (const InstructionSet set : available_instruction_sets()) {
    EngineOptions engine;
    engine.instruction_set = set;
    PairLaw law = scenes::full_law();
    law.k_adh = law.f0 = 0.0, law.k2 = law.k1;
    Simulation sim(scenes::bed(options, law, engine));
    sim.set_time_step(1e-9);
    EXPECT_NO_THROW(sim.advance(2)) << to_string(set);
  }
}

TEST(Guards, ASphereLostInOpenSpace) {
  const std::string table = "id,x,y,z,vx\n3,0,0,0,40\n5,0.01,0.02,0,0\n";
  const Trial run = run_case(table_case(time_passes("50 s")), {"time.step=\"20 us\"", "particles.law.k1=50", "particles.law.k2=100"}, {}, table);
  EXPECT_EQ(run.outcome.exit_code, exit_numerical);
  const std::string& said = run.outcome.message;
  EXPECT_NE(said.find("a sphere is lost at step "), std::string::npos) << said;
  EXPECT_NE(said.find("; sphere 3 at (20.0"), std::string::npos) << said;  // 1000 times 0.02 m
  EXPECT_NE(said.find("farther out than 1000 times the box, 20 m"), std::string::npos) << said;
  EXPECT_NE(said.find("periodic sides keep spheres in"), std::string::npos) << said;
}

TEST(Guards, ASpinThatNoStepCanFollow) {
  const std::string table = "id,x,y,z,wx\n3,0,0,0,0\n8,0.01,0.02,0,30000\n";
  const Trial run = run_case(table_case(time_passes("50 ms")), {"time.step=\"20 us\""}, {}, table);
  EXPECT_EQ(run.outcome.exit_code, exit_numerical);
  const std::string& said = run.outcome.message;
  EXPECT_NE(said.find("a sphere turns by 0.6 rad in one step at step "), std::string::npos) << said;
  EXPECT_NE(said.find("; sphere 8 at (0.01, 0.02, 0) m turns at 30000 rad/s"), std::string::npos) << said;
  EXPECT_NE(said.find("use a smaller time step"), std::string::npos) << said;
}

TEST(Guards, AnOverlapAboveAQuarterOfTheDiameterIsTold) {
  const std::string below = "id,x,y,z\n3,0,0,0\n5,0.0039,0,0\n";
  const auto warnings = [](const std::string& spheres) {
    const Trial run = run_case(table_case(time_passes("0.1 ms")), {"time.step=\"0.1 us\""}, {}, spheres);
    return nlohmann::json::parse(read_file(run.path() / "summary.json"))["stages"][0]["warnings"].dump();
  };
  EXPECT_NE(warnings("id,x,y,z\n3,0,0,0\n5,0.0030,0,0\n").find("an overlap above a quarter of the diameter"), std::string::npos);
  EXPECT_EQ(warnings(below), "[]");
}

}  // namespace
}  // namespace platen
