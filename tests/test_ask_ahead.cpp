// Asking for what comes [kernels/ask_ahead.h]: how far ahead, and that nobody sees it but the clock.
#include <gtest/gtest.h>

#include "kernels/ask_ahead.h"
#include "tests/contact_pass.h"
#include "tests/scenes.h"

namespace platen::test {
namespace {

TEST(AskAhead, ChangesNoBit) {
  for (const InstructionSet set : available_instruction_sets())
    for (const scenes::LawCase& c : scenes::laws_of_scenes()) {
      SCOPED_TRACE(std::string(to_string(set)) + ", " + c.name);
      scenes::BedOptions bed;
      bed.nx = bed.ny = 8, bed.nz = 10, bed.spread = c.spread;
      EngineOptions engine;
      engine.instruction_set = set, engine.batch = 200;
      Simulation sim(scenes::bed(bed, c.law, engine));
      sim.set_time_step(2e-6);
      sim.advance(20);
      ASSERT_GT(sim.batches().size(), 2u);
      std::int64_t contacts = 0;
      for (const Batch& b : sim.batches()) {
        const Pass silent = pass(sim, b, true, sim.leap_of(b, 2e-6));
        // Within the batch, beyond its end, and beyond all spheres.
        for (const std::int32_t ahead : {1, 64, 300, 5000}) EXPECT_TRUE(silent == pass(sim, b, true, sim.leap_of(b, 2e-6), ahead)) << ahead;
        EXPECT_TRUE(silent == pass(sim, b, true, sim.leap_of(b, 2e-6), 0, {}, true)) << "owners from rows alone";
        EXPECT_TRUE(pass(sim, b, false, sim.leap_of(b, 2e-6)) == pass(sim, b, false, sim.leap_of(b, 2e-6), 0, {}, true)) << "owners from rows alone, some passed over";
        StretchesOfLines others;
        for (const Batch& other : sim.batches()) others.add(other.tx.data(), other.tx.size(), 0.0, 1.0);
        EXPECT_GT(others.lines(), 0);
        EXPECT_TRUE(silent == pass(sim, b, true, sim.leap_of(b, 2e-6), 0, others));
        contacts += silent.totals.contacts;
      }
      EXPECT_GT(contacts, 0);
    }
}

// Every row from the first owner on, and none twice, to the last owner's reach; records to the end of the batch.
TEST(AskAhead, EverySphereOnce) {
  scenes::BedOptions bed;
  bed.nx = bed.ny = 8, bed.nz = 10;
  EngineOptions engine;
  engine.batch = 200;
  Simulation sim(scenes::bed(bed, scenes::full_law(), engine));
  sim.set_time_step(2e-6);
  sim.advance(2);
  bool beyond_batch = false, beyond_all = false;
  for (const Batch& b : sim.batches())
    for (const std::int32_t ahead : {1, 64, 300, 5000}) {
      PairBatch pairs{};
      pairs.to = b.to.data(), pairs.count = b.padded, pairs.first = b.first, pairs.end = b.first + b.count;
      pairs.ahead = ahead, pairs.spheres = sim.state().padded;
      std::int32_t next_row = b.i(0), next_record = b.i(0);
      for (std::int32_t start = 0; start < b.padded; start += chunk_size) {
        const AskedFor asked = asked_for(pairs, start);
        EXPECT_TRUE(asked.first >= asked.last_row || asked.first == next_row) << start;
        EXPECT_TRUE(asked.first >= asked.last_record || asked.first == next_record) << start;
        next_row = std::max(next_row, asked.last_row), next_record = std::max(next_record, asked.last_record);
      }
      EXPECT_EQ(next_row, std::min(pairs.end + ahead, pairs.spheres));
      EXPECT_EQ(next_record, pairs.end);
      beyond_batch = beyond_batch || next_row > pairs.end, beyond_all = beyond_all || pairs.end + ahead > pairs.spheres;
    }
  EXPECT_TRUE(beyond_batch && beyond_all);
}

// Most partners are met before they are as far ahead as is asked for; those of a sphere are a layer ahead of it at most.
TEST(AskAhead, ReachesBeyondMostPartners) {
  scenes::BedOptions bed;
  bed.nx = 40, bed.ny = 12, bed.nz = 12;  // layers of 144 spheres
  Simulation sim(scenes::bed(bed, scenes::full_law(), {}));
  sim.set_time_step(2e-6);
  sim.advance(2);
  std::int64_t listed = 0, within = 0;
  for (const Batch& b : sim.batches()) {
    EXPECT_GE(b.ahead, 256 + 72);
    EXPECT_LE(b.ahead, 256 + 288);
    for (std::size_t k = 0; k < static_cast<std::size_t>(b.used); ++k) ++listed, within += b.j(k) - b.i(k) < b.ahead - 128 ? 1 : 0;
  }
  EXPECT_GT(listed, 5000);
  EXPECT_GT(static_cast<double>(within), 0.85 * static_cast<double>(listed));
}

}  // namespace
}  // namespace platen::test
