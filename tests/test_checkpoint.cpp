// What a checkpoint holds: the file, of which every bit is watched, and the engine's state, from which it goes on with the same bits.
#include <gtest/gtest.h>

#include <cstring>

#include "core/simulation_state.h"
#include "protocol/output/checkpoint_file.h"
#include "tests/experiment_case.h"
#include "tests/scenes.h"

namespace platen::test {
namespace {

Checkpoint small_checkpoint() {
  scenes::BedOptions o;
  o.nx = o.ny = 3, o.nz = 2;
  Simulation sim(scenes::bed(o, scenes::full_law(), {}));
  sim.set_time_step(1e-5);
  scenes::add_plates(sim, scenes::height_of(o), -0.05);
  sim.advance(40);
  Checkpoint c;
  c.bed = sim.whole_state();
  c.density = {2000.0};
  c.experiment = "{\"rows\":3}";
  c.instruction_set = "scalar";
  return c;
}

TEST(CheckpointFile, EveryBitIsWatched) {
  TemporaryFolder root;
  write_checkpoint(root.path(), small_checkpoint());
  const std::string bytes = read_file(root / "checkpoint.h5");
  EXPECT_TRUE(checkpoint_is_whole(bytes));
  std::string damaged = bytes;
  for (std::size_t k = 0; k < bytes.size(); ++k)
    for (int bit = 0; bit < 8; ++bit) {
      damaged[k] = static_cast<char>(bytes[k] ^ (1 << bit));
      ASSERT_FALSE(checkpoint_is_whole(damaged)) << "byte " << k << ", bit " << bit;
      damaged[k] = bytes[k];
    }
  for (std::size_t size = 0; size < bytes.size(); ++size) ASSERT_FALSE(checkpoint_is_whole(std::string_view(bytes).substr(0, size))) << size;
  EXPECT_FALSE(checkpoint_is_whole(bytes + '\n'));
  write_file(root / "checkpoint.h5", damaged.replace(bytes.size() / 2, 1, 1, static_cast<char>(bytes[bytes.size() / 2] ^ 1)));
  EXPECT_THROW(read_checkpoint(root / "checkpoint.h5"), OutputError);
}

TEST(CheckpointFile, ComesBackToTheBit) {
  TemporaryFolder root;
  const Checkpoint c = small_checkpoint();
  EXPECT_FALSE(c.bed.pairs.empty());
  EXPECT_FALSE(c.bed.plates.empty());
  write_checkpoint(root.path(), c);
  write_checkpoint(root.path(), c);
  EXPECT_EQ(read_file(root / "checkpoint.h5"), read_file(root / "checkpoint.prev.h5"));
  const Checkpoint d = read_checkpoint(root / "checkpoint.h5");
  EXPECT_EQ(c.bed.position, d.bed.position);
  EXPECT_EQ(c.bed.sums, d.bed.sums);
  EXPECT_EQ(c.bed.image, d.bed.image);
  ASSERT_EQ(c.bed.pairs.size(), d.bed.pairs.size());
  for (std::size_t k = 0; k < c.bed.pairs.size(); ++k) EXPECT_EQ(std::memcmp(&c.bed.pairs[k], &d.bed.pairs[k], sizeof(PairHistory)), 0);
  for (int term = 0; term < term_count; ++term) EXPECT_TRUE(c.bed.dissipated[term] == d.bed.dissipated[term]);
  EXPECT_TRUE(c.bed.plate_work == d.bed.plate_work && c.bed.plate_work != 0);
  EXPECT_EQ(c.bed.planes[plate_top].origin, d.bed.planes[plate_top].origin);
  EXPECT_EQ(c.experiment, d.experiment);
  EXPECT_EQ(c.instruction_set, d.instruction_set);
}

// ---- the engine -----------------------------------------------------------------------------------------------------------

// Every law that kernels are built for, several threads, open sides: taken out, put into a fresh Simulation, on.
TEST(SimulationState, GoesOnWithTheSameBits) {
  for (const scenes::LawCase& law : scenes::laws_of_scenes()) {
    SCOPED_TRACE(law.name);
    scenes::BedOptions o;
    o.nx = o.ny = 5, o.nz = 6, o.spread = law.spread;
    EngineOptions engine;
    engine.instruction_set = preferred_instruction_set();
    const SimulationSetup setup = scenes::bed(o, law.law, engine);
    Simulation whole(setup);
    whole.set_time_step(2e-6);
    scenes::add_plates(whole, scenes::height_of(o), -0.2);
    whole.count_inserted();
    for (const bool open : {false, true}) {
      SCOPED_TRACE(open ? "open" : "periodic");
      if (open) whole.open_sides();
      whole.advance(150);
      SimulationSetup other = setup;
      other.engine.threads = 2, other.engine.batch = 24, other.engine.executor = Executor::flow_graph;
      Simulation broken(other);
      broken.take_up(whole.whole_state());
      EXPECT_EQ(broken.state_hash(), whole.state_hash());
      whole.set_time_step(1.5e-6), broken.set_time_step(1.5e-6);
      whole.advance(150), broken.advance(150);
      EXPECT_EQ(broken.state_hash(), whole.state_hash());
      EXPECT_EQ(broken.measure().energy_residual, whole.measure().energy_residual);
      EXPECT_EQ(broken.measure().stress_top, whole.measure().stress_top);
      EXPECT_EQ(broken.time(), whole.time());
    }
  }
}

TEST(SimulationState, OfOtherSpheresIsRefused) {
  scenes::BedOptions o;
  Simulation sim(scenes::bed(o, scenes::full_law(), {}));
  SimulationState state = sim.whole_state();
  o.nx = 5;
  Simulation other(scenes::bed(o, scenes::full_law(), {}));
  EXPECT_THROW(other.take_up(state), std::invalid_argument);
  state.pairs.push_back({0, 64, 0.0, 0.0, 0.0, 0.0, 0.0});
  Simulation same(scenes::bed({}, scenes::full_law(), {}));
  EXPECT_THROW(same.take_up(state), std::invalid_argument);
}

}  // namespace
}  // namespace platen::test
