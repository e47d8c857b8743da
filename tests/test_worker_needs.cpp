// What tasks wait for of other workers [core/worker_needs.h].
#include <gtest/gtest.h>

#include <tbb/task_arena.h>

#include <algorithm>
#include <mutex>
#include <random>

#include "core/flow_graph.h"
#include "core/task_order.h"
#include "core/worker_needs.h"
#include "tests/scenes.h"

namespace platen {
namespace {

using Needs = std::vector<std::vector<Need>>;

Simulation bed(bool fused) {
  scenes::BedOptions o;
  o.nx = 16, o.ny = 16, o.nz = 16;
  EngineOptions engine;
  engine.batch = 16, engine.fused = fused;
  return Simulation(scenes::bed(o, scenes::full_law(), engine));
}

TaskTable dealt_out(const Simulation& sim, bool fused, int workers) {
  TaskTable table(sim.batches(), 4, fused);
  deal_out(table, sim.batches(), workers);
  return table;
}

// The workers' tasks one after the other, each as soon as `needs` lets it and `next_worker` picks its worker of those that can go on.
template <class Pick>
std::vector<std::int32_t> run_by(const TaskTable& table, const Needs& needs, const Pick& next_worker) {
  const auto workers = static_cast<std::size_t>(worker_count(table));
  std::vector<std::vector<std::int32_t>> chains(workers);
  for (std::size_t t = 0; t < table.tasks().size(); ++t) chains[static_cast<std::size_t>(table.worker()[t])].push_back(static_cast<std::int32_t>(t));
  std::vector<std::size_t> done(workers, 0);
  std::vector<std::int32_t> order;
  while (order.size() < table.tasks().size()) {
    std::vector<std::size_t> able;
    for (std::size_t w = 0; w < workers; ++w) {
      if (done[w] == chains[w].size()) continue;
      const auto& of = needs[static_cast<std::size_t>(chains[w][done[w]])];
      if (std::all_of(of.begin(), of.end(), [&](const Need& need) { return done[static_cast<std::size_t>(need.worker)] >= static_cast<std::size_t>(need.done); }))
        able.push_back(w);
    }
    if (able.empty()) return {};
    const std::size_t w = next_worker(able);
    order.push_back(chains[w][done[w]++]);
  }
  return order;
}

bool keeps_edges(const TaskTable& table, const std::vector<std::int32_t>& order) {
  std::vector<std::size_t> place(order.size());
  for (std::size_t k = 0; k < order.size(); ++k) place[static_cast<std::size_t>(order[k])] = k;
  for (std::size_t t = 0; t < place.size(); ++t)
    for (const std::int32_t next : table.successors()[t])
      if (place[t] >= place[static_cast<std::size_t>(next)]) return false;
  return true;
}

TEST(WorkerNeeds, KeepAllEdgesWhoeverIsFast) {
  std::mt19937 random(3);
  for (const bool fused : {false, true}) {
    Simulation sim = bed(fused);
    sim.ensure_forces();
    for (const int workers : {2, 3, 7}) {
      const TaskTable table = dealt_out(sim, fused, workers);
      const Needs needs = needs_of_others(table);
      for (int repetition = 0; repetition < 30; ++repetition) {
        const auto order = run_by(table, needs, [&](const std::vector<std::size_t>& able) { return able[random() % able.size()]; });
        ASSERT_EQ(order.size(), table.tasks().size());
        EXPECT_TRUE(keeps_edges(table, order));
      }
    }
  }
}

// Without any one of them some order breaks an edge: that in which its task comes as early and what it waits for as late as can be.
TEST(WorkerNeeds, NoneIsTooMany) {
  Simulation sim = bed(false);
  sim.ensure_forces();
  const TaskTable table = dealt_out(sim, false, 3);
  Needs needs = needs_of_others(table);
  std::size_t all = 0, edges = 0;
  for (std::size_t t = 0; t < needs.size(); ++t) {
    for (const std::int32_t next : table.successors()[t]) edges += table.worker()[t] != table.worker()[static_cast<std::size_t>(next)];
    for (std::size_t k = 0; k < needs[t].size(); ++k) {
      ++all;
      const Need need = needs[t][k];
      needs[t].erase(needs[t].begin() + static_cast<std::ptrdiff_t>(k));
      const auto order = run_by(table, needs, [&](const std::vector<std::size_t>& able) {
        const auto early = static_cast<std::size_t>(table.worker()[t]), late = static_cast<std::size_t>(need.worker);
        for (const std::size_t w : able)
          if (w == early) return w;
        for (const std::size_t w : able)
          if (w != late) return w;
        return late;
      });
      EXPECT_FALSE(keeps_edges(table, order)) << "task " << t;
      needs[t].insert(needs[t].begin() + static_cast<std::ptrdiff_t>(k), need);
    }
  }
  EXPECT_GT(all, 0u);
  EXPECT_LT(3 * all, 2 * edges);
}

// The order of a large bed, whose tasks are not step by step.
TEST(WorkerNeeds, OfATableInAnotherOrder) {
  std::mt19937 random(4);
  Simulation sim = bed(false);
  sim.ensure_forces();
  TaskTable table(sim.batches(), 4, false);
  table.reorder(order_for_cache(table, sim.batches(), touched_bytes(sim.batches()) / 8.0, 3));
  ASSERT_EQ(worker_count(table), 3);
  const Needs needs = needs_of_others(table);
  for (int repetition = 0; repetition < 30; ++repetition)
    EXPECT_TRUE(keeps_edges(table, run_by(table, needs, [&](const std::vector<std::size_t>& able) { return able[random() % able.size()]; })));
}

// One graph, run again and again: each task once, in order, and no steps that a run does not have.
TEST(WorkerNeeds, AGraphOfWorkersRunsManyTimes) {
  for (const bool fused : {false, true}) {
    Simulation sim = bed(fused);
    sim.ensure_forces();
    for (const int threads : {1, 2, 4}) {
      const TaskTable table = dealt_out(sim, fused, std::max(2, threads));
      std::mutex mutex;
      std::vector<std::int32_t> order;
      tbb::task_arena arena(threads);
      arena.execute([&] {
        FlowGraph graph(table, [&](const Task& task) {
          const std::lock_guard<std::mutex> lock(mutex);
          order.push_back(task.number);
        }, Takers::workers);
        for (const int steps : {4, 1, 3, 4, 2, 4}) {
          order.clear();
          graph.run(steps);
          std::vector<std::int32_t> place(table.tasks().size(), -1);
          for (std::size_t k = 0; k < order.size(); ++k) place[static_cast<std::size_t>(order[k])] = static_cast<std::int32_t>(k);
          for (std::size_t t = 0; t < place.size(); ++t) {
            EXPECT_EQ(place[t] >= 0, table.tasks()[t].offset < steps);
            for (const std::int32_t next : table.successors()[t])
              EXPECT_TRUE(place[static_cast<std::size_t>(next)] < 0 || place[t] < place[static_cast<std::size_t>(next)]);
          }
          EXPECT_EQ(order.size() * 4, table.tasks().size() * static_cast<std::size_t>(steps));
        }
      });
    }
  }
}

TEST(WorkerNeeds, OneWorkerNeedsNobody) {
  Simulation sim = bed(false);
  sim.ensure_forces();
  for (const auto& of : needs_of_others(dealt_out(sim, false, 1))) EXPECT_TRUE(of.empty());
}

// Stretches of the curve, of equal work to a batch, in the order of the table.
TEST(WorkerNeeds, WorkIsDealtOutEvenly) {
  Simulation sim = bed(false);
  sim.ensure_forces();
  for (const int workers : {2, 3, 5}) {
    const TaskTable table = dealt_out(sim, false, workers);
    const std::vector<int> worker = worker_of_batches(table, sim.batches().size());
    EXPECT_TRUE(std::is_sorted(worker.begin(), worker.end()));
    std::vector<double> work(static_cast<std::size_t>(workers), 0.0);
    double all = 0.0, largest = 0.0;
    for (std::size_t k = 0; k < worker.size(); ++k) {
      const auto own = static_cast<double>(work_of(sim.batches()[k]));
      work[static_cast<std::size_t>(worker[k])] += own, all += own, largest = std::max(largest, own);
    }
    for (const double of : work) EXPECT_NEAR(of, all / workers, 1.01 * largest);
    EXPECT_FALSE(table.ordered());
    const TaskTable plain(sim.batches(), 4, false);
    for (std::size_t t = 0; t < table.tasks().size(); ++t) EXPECT_EQ(table.tasks()[t].batch, plain.tasks()[t].batch);
  }
}

TEST(WorkerNeeds, AGraphOfWorkersNeedsWorkers) {
  Simulation sim = bed(false);
  sim.ensure_forces();
  const TaskTable plain(sim.batches(), 4, false);
  EXPECT_THROW(FlowGraph(plain, [](const Task&) {}, Takers::workers), std::logic_error);
  EXPECT_NO_THROW(FlowGraph(plain, [](const Task&) {}, Takers::anybody));
}

}  // namespace
}  // namespace platen
