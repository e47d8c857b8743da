// What tasks ask for ahead of others [core/task_asks.h]: what comes from memory, in time, by its own worker, and nothing else.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <tuple>

#include "core/cache_model.h"
#include "core/task_asks.h"
#include "core/task_order.h"
#include "kernels/ask_ahead.h"
#include "tests/contact_pass.h"
#include "tests/scenes.h"

namespace platen::test {
namespace {

using scenes::BedOptions;

EngineOptions small_batches() {
  EngineOptions engine;
  engine.batch = 48;
  return engine;
}
SimulationSetup long_bed(const EngineOptions& engine) {
  BedOptions o;
  o.nx = 40, o.ny = 6, o.nz = 7;
  return scenes::bed(o, scenes::full_law(), engine);
}

struct Need {
  std::size_t task;
  int batch;
  bool contacts;
};

TEST(TaskAsks, AskForWhatIsMissingInTime) {
  Simulation sim(long_bed(small_batches()));
  sim.ensure_forces();
  const std::vector<Batch>& batches = sim.batches();
  for (const int workers : {1, 2, 3})
    for (const double share : {0.05, 0.3}) {
      SCOPED_TRACE(std::to_string(workers) + " workers, caches of " + std::to_string(share));
      const double cache = share * touched_bytes(batches);
      TaskTable table(batches, 12, false);
      table.reorder(order_for_cache(table, batches, cache, workers));
      const TaskAsks asks = asks_of_tasks(table, batches, cache);
      ASSERT_EQ(asks.size(), table.tasks().size());

      const std::vector<int> worker = worker_of_batches(table, batches.size());
      CacheModel caches(batches, worker, cache);
      std::vector<Need> needs;
      double missing = 0.0;
      for (std::size_t t = 0; t < table.tasks().size(); ++t) {
        const Missing m = caches.missing(table.tasks()[t]);
        caches.use(table.tasks()[t]);
        missing += m.all();
        if (m.state > 0.0) needs.push_back({t, table.tasks()[t].batch, false});
        if (m.contacts > 0.0) needs.push_back({t, table.tasks()[t].batch, true});
      }

      double asked = 0.0;
      std::map<std::size_t, std::vector<std::pair<double, double>>> parts;  // of each need
      for (std::size_t t = 0; t < asks.size(); ++t) {
        double of_task = 0.0;
        EXPECT_LE(asks[t].size(), most_asked);
        for (const Asked& a : asks[t]) {
          EXPECT_EQ(table.tasks()[t].kind, TaskKind::contacts);
          EXPECT_EQ(worker[static_cast<std::size_t>(a.batch)], worker[static_cast<std::size_t>(table.tasks()[t].batch)]);
          EXPECT_TRUE(0.0 <= a.from && a.from < a.to && a.to <= 1.0) << a.from << " to " << a.to;
          const auto need = std::find_if(needs.begin(), needs.end(), [&](const Need& n) { return n.task > t && n.batch == a.batch && n.contacts == a.contacts; });
          ASSERT_NE(need, needs.end());
          EXPECT_EQ(a.offset, table.tasks()[need->task].offset);
          parts[static_cast<std::size_t>(need - needs.begin())].push_back({a.from, a.to});
          const Batch& b = batches[static_cast<std::size_t>(a.batch)];
          of_task += (a.to - a.from) * (a.contacts ? contact_bytes(b) : state_bytes(b));
        }
        EXPECT_LE(of_task, 96.0 * (1.0 + 1e-9) * batches[static_cast<std::size_t>(table.tasks()[t].batch)].padded);
        asked += of_task;
      }
      // Nothing twice, and the part that is met last by the task that comes last.
      for (auto& [need, of] : parts)
        for (std::size_t k = 1; k < of.size(); ++k) EXPECT_GE(of[k].first, of[k - 1].second - 1e-12);
      EXPECT_LE(asked, missing * (1.0 + 1e-12));
      EXPECT_GT(asked, (share > 0.1 ? 0.7 : 0.3) * missing);
    }
}

TEST(TaskAsks, NobodyAsksForWhatACacheHolds) {
  Simulation sim(long_bed(small_batches()));
  sim.ensure_forces();
  TaskTable table(sim.batches(), 12, false);
  table.reorder(order_for_cache(table, sim.batches(), 0.1 * touched_bytes(sim.batches())));
  const TaskAsks asks = asks_of_tasks(table, sim.batches(), 1e12);
  std::map<std::pair<int, bool>, double> asked;  // only before a batch is met for the first time
  for (const auto& of : asks)
    for (const Asked& a : of) asked[{a.batch, a.contacts}] += a.to - a.from;
  for (const auto& [what, share] : asked) EXPECT_LE(share, 1.0 + 1e-12);
}

// A bed that fits asks for nothing, nor do threads of which any may take any task.
TEST(TaskAsks, WhoAsks) {
  const auto ask = [](double cache, int threads, Executor executor) {
    EngineOptions engine = small_batches();
    engine.cache = cache, engine.threads = threads, engine.executor = executor;
    Simulation sim(long_bed(engine));
    sim.set_time_step(1e-6);
    sim.advance(1);
    std::size_t parts = 0;
    for (const auto& of : sim.asks()) parts += of.size();
    return parts > 0;
  };
  EXPECT_TRUE(ask(1e5, 1, Executor::serial));
  EXPECT_TRUE(ask(1e5, 1, Executor::flow_graph));
  EXPECT_TRUE(ask(1e5, 2, Executor::flow_graph));
  EXPECT_FALSE(ask(1e5, 2, Executor::plain_threads));
  EXPECT_FALSE(ask(1e5, 5, Executor::flow_graph)) << "too few batches for a part of their own";
  EXPECT_FALSE(ask(1e12, 1, Executor::serial));
}

TEST(TaskAsks, ChangeNoBit) {
  std::vector<std::uint64_t> hashes;
  for (const double cache : {1e12, 1e5})
    for (const auto& [threads, executor] : {std::pair{1, Executor::serial}, {2, Executor::flow_graph}, {3, Executor::plain_threads}}) {
      EngineOptions engine = small_batches();
      engine.cache = cache, engine.threads = threads, engine.executor = executor;
      engine.instruction_set = preferred_instruction_set();
      Simulation sim(long_bed(engine));
      sim.set_time_step(2e-6);
      sim.advance(200);
      hashes.push_back(sim.state_hash());
    }
  for (const std::uint64_t hash : hashes) EXPECT_EQ(hash, hashes.front());
}

std::vector<AskedLines> stretches_of(const StretchesOfLines& lines) {
  PairBatch pairs{};
  pairs.count = chunk_size;
  lines.put_into(pairs);
  return {pairs.lines, pairs.lines + pairs.stretches};
}

// Where a batch's arrays lie: those that its tasks of the run have read and written, and the shares of its spheres that others hold.
TEST(TaskAsks, LinesOfABatch) {
  for (const bool equal : {true, false}) {
    EngineOptions engine = small_batches();
    engine.cache = 1e5;
    SimulationSetup setup = long_bed(engine);
    if (!equal) setup.spheres.radius[0] *= 0.999;
    Simulation sim(std::move(setup));
    sim.set_time_step(1e-6);
    sim.advance(4);
    const Particles& p = sim.state();
    std::size_t incoming = 0;
    for (std::int32_t k = 0; k < static_cast<std::int32_t>(sim.batches().size()); ++k) {
      const Batch& b = sim.batches()[static_cast<std::size_t>(k)];
      const auto first = static_cast<std::size_t>(b.first), count = static_cast<std::size_t>(b.count);
      std::vector<std::pair<const void*, std::size_t>> state, contacts;  // where, bytes
      // Rows alone hold the state.
      if (!equal)
        for (const auto* column : {&p.radius, &p.inverse_radius, &p.mass, &p.inverse_mass}) state.push_back({column->data() + first, 8 * count});
      state.push_back({p.rows.data() + row_size * first, 8 * row_size * count});
      state.push_back({b.sum.data(), 8 * record_size * count});
      for (const Incoming& in : b.incoming) {
        const Batch& owner = sim.batches()[static_cast<std::size_t>(in.batch)];
        state.push_back({owner.sum.data() + record_size * static_cast<std::size_t>(owner.count + in.slot), 8 * record_size * static_cast<std::size_t>(in.count)});
        ++incoming;
      }
      for (const auto* column : {&b.sp, &b.tx, &b.ty, &b.tz}) contacts.push_back({column->data(), 8 * static_cast<std::size_t>(b.padded)});
      contacts.push_back({b.row_j.data(), 4 * static_cast<std::size_t>(b.padded)});
      contacts.push_back({b.to.data(), 8 * static_cast<std::size_t>(b.padded)});
      contacts.push_back({b.owners_of_eight.data(), 12 * static_cast<std::size_t>(b.padded) / 8});
      for (const auto& [what, arrays] : {std::pair{false, state}, {true, contacts}}) {
        const std::vector<AskedLines> found = stretches_of(sim.lines_of({{k, what, 0.0, 1.0, 0}}));
        EXPECT_EQ(found.size(), arrays.size() + (what ? 0 : 1));  // and the speeds, which nobody else sees
        for (const auto& [at, bytes] : arrays)
          EXPECT_EQ(std::count_if(found.begin(), found.end(), [&, place = at, size = bytes](const AskedLines& l) { return l.first == place && l.count == static_cast<std::int64_t>(size / 64); }), 1);
        EXPECT_TRUE(stretches_of(sim.lines_of({{k, what, 0.0, 1.0, 4}})).empty()) << "a step that is not in the run";
      }
    }
    EXPECT_GT(incoming, 10u);
  }
}

// Chunk by chunk, each line once.
TEST(TaskAsks, EveryLineOnce) {
  const char* const memory = nullptr;
  for (const std::vector<std::int64_t>& counts : std::vector<std::vector<std::int64_t>>{{1}, {7, 3}, {10, 10, 1}, {5, 5, 5, 30}})
    for (const int chunks : {1, 2, 3, 10, 100}) {
      std::vector<AskedLines> lines;
      std::int64_t all = 0;
      for (const std::int64_t n : counts) lines.push_back({memory + 64 * (2 * all), n}), all += n;
      std::vector<const char*> asked, wanted;
      for (const AskedLines& l : lines)
        for (std::int64_t n = 0; n < l.count; ++n) wanted.push_back(l.first + 64 * n);
      AskForOthers<Scalar> others;
      for (int k = 0; k < chunks; ++k)
        for (std::int64_t left = (all + chunks - 1) / chunks; left > 0;) {
          const auto piece = others.next(lines.data(), static_cast<std::int32_t>(lines.size()), left);
          ASSERT_LE(piece.lines, left);
          if (piece.lines == 0) break;
          left -= piece.lines;
          for (std::int64_t n = 0; n < piece.lines; ++n) asked.push_back(piece.first + 64 * n);
        }
      EXPECT_EQ(asked, wanted);
    }
}

// Whole lines, each once, shared out evenly to the chunks of a pass; more stretches than there is room for are left out.
TEST(TaskAsks, LinesOfAPass) {
  AlignedArray<double> array;
  array.assign(1000, 0.0);
  StretchesOfLines lines;
  lines.add(array.data(), array.size(), 0.0, 0.3);
  lines.add(array.data(), array.size(), 0.3, 1.0);
  EXPECT_EQ(lines.lines(), 125);
  lines.add(array.data(), array.size(), 0.5, 0.5);
  lines.add(static_cast<const double*>(nullptr), 0, 0.0, 1.0);
  PairBatch pairs{};
  pairs.count = 5 * chunk_size - 16;
  lines.put_into(pairs);
  ASSERT_EQ(pairs.stretches, 2);
  EXPECT_EQ(pairs.lines_of_chunk, 25);
  EXPECT_EQ(pairs.lines[0].first, reinterpret_cast<const char*>(array.data()));
  EXPECT_EQ(pairs.lines[0].count, 37);
  EXPECT_EQ(pairs.lines[1].first, reinterpret_cast<const char*>(array.data()) + 37 * 64);
  pairs.count = 0;
  lines.put_into(pairs);
  EXPECT_EQ(pairs.lines_of_chunk, 0);
  for (int k = 0; k < 1000; ++k) lines.add(array.data(), array.size(), 0.0, 1.0);
  lines.put_into(pairs);
  EXPECT_LT(pairs.stretches, 1000);
  EXPECT_EQ(lines.lines(), 125 * (pairs.stretches - 1));
}

}  // namespace
}  // namespace platen::test
