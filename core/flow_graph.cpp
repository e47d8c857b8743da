#include "core/flow_graph.h"

#include <tbb/flow_graph.h>
#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <stdexcept>
#include <thread>

#include "core/worker_needs.h"

#if defined(__x86_64__) || defined(__i386__)
#include <immintrin.h>
#endif

namespace platen {

namespace {

void pause() {
#if defined(__x86_64__) || defined(__i386__)
  _mm_pause();
#else
  std::this_thread::yield();
#endif
}

// How long a thread waits for others before it looks for other work. Neighbours that have a core each are about a task behind.
constexpr auto patience = std::chrono::microseconds(300);
// After so many waits in vain a worker waits no more in this run: something else may have the core of whom it waits for.
constexpr int most_in_vain = 4;

// Whether `ready` came true.
template <class Ready>
bool wait_a_little(const Ready& ready) {
  if (ready()) return true;
  const auto start = std::chrono::steady_clock::now();
  do {
    for (int k = 0; k < 32; ++k) {
      pause();
      if (ready()) return true;
    }
  } while (std::chrono::steady_clock::now() - start < patience);
  return false;
}

// Threads that may run at once, as far as is known: the arena's, of a process that has been given some cores.
int most_threads() {
  return std::min({tbb::info::default_concurrency(), tbb::this_task_arena::max_concurrency(),
                   static_cast<int>(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism))});
}

// The next task of the same batch, which always waits for this one; -1 at the end.
std::int32_t next_of_batch(const TaskTable& table, std::size_t t) {
  for (const std::int32_t next : table.successors()[t])
    if (table.tasks()[static_cast<std::size_t>(next)].batch == table.tasks()[t].batch) return next;
  return -1;
}

}  // namespace

struct FlowGraph::Graph {
  using Message = tbb::flow::continue_msg;
  using Node = tbb::flow::continue_node<Message>;
  struct alignas(128) Worker {  // on lines of its own
    std::atomic<std::int32_t> done{0};  // tasks of this run
    int waits_in_vain = 0;              // of this run
  };

  tbb::flow::graph graph;
  std::vector<std::unique_ptr<Node>> nodes;
  std::vector<Node*> roots;
  TaskBody body;
  int steps = 0;
  // Where tasks have workers: of each task what it needs of others, and who of others needs it.
  std::vector<std::vector<Need>> needs;
  std::vector<std::vector<std::int32_t>> needed_by;
  std::vector<Worker> workers;

  void run(const Task& task) {
    if (task.offset < steps) body(task);
  }
  bool others_are_done(std::size_t task) const {
    for (const Need& need : needs[task])
      if (workers[static_cast<std::size_t>(need.worker)].done.load(std::memory_order_acquire) < need.done) return false;
    return true;
  }
};

FlowGraph::FlowGraph(const TaskTable& table, TaskBody body, Takers takers) : graph_(std::make_unique<Graph>()) {
  graph_->body = std::move(body);
  graph_->nodes.reserve(table.tasks().size());
  if (takers == Takers::workers && table.worker().size() != table.tasks().size()) throw std::logic_error("a flow graph of workers for tasks that have none");
  if (takers == Takers::workers)
    build_for_workers(table);
  else
    build_for_anybody(table);
}

FlowGraph::FlowGraph(const TaskTable& table, TaskBody body)
    : FlowGraph(table, std::move(body), table.worker().empty() ? Takers::anybody : Takers::workers) {}

void FlowGraph::build_for_anybody(const TaskTable& table) {
  Graph& g = *graph_;
  for (const Task& task : table.tasks()) {
    const auto priority = static_cast<tbb::flow::node_priority_t>(table.tasks().size() - g.nodes.size());
    g.nodes.push_back(std::make_unique<Graph::Node>(g.graph, [&g, task](const Graph::Message&) {
      g.run(task);
      return Graph::Message();
    }, table.ordered() ? priority : tbb::flow::no_priority));
  }
  for (std::size_t t = 0; t < table.tasks().size(); ++t) {
    const auto edge = [&](std::int32_t next) { tbb::flow::make_edge(*g.nodes[t], *g.nodes[static_cast<std::size_t>(next)]); };
    // The last edge is that of the task to go on with, if it is ready: a thread keeps it, and leaves what else it sets free to be taken. It is
    // the same batch's, whose arrays its caches hold. Otherwise two threads may change batches at every task.
    const std::int32_t own = next_of_batch(table, t);
    for (const std::int32_t next : table.successors()[t])
      if (next != own) edge(next);
    if (own >= 0) edge(own);
    if (table.predecessors()[t] == 0) g.roots.push_back(g.nodes[t].get());
  }
}

// The only edges are those from a worker's task to its next one. A task tells those of others that wait for it; then its thread waits a
// little for what the next one needs of others, so that the chain, whose arrays its caches hold, stays with it. Where that takes too long
// the thread is free for others, and whoever brings what was missing goes on with the chain, or leaves it to be taken.
void FlowGraph::build_for_workers(const TaskTable& table) {
  Graph& g = *graph_;
  const std::size_t tasks = table.tasks().size();
  g.needs = needs_of_others(table);
  g.needed_by.resize(tasks);
  for (std::size_t t = 0; t < tasks; ++t)
    for (const Need& need : g.needs[t]) g.needed_by[static_cast<std::size_t>(need.task)].push_back(static_cast<std::int32_t>(t));
  const int workers = worker_count(table);
  g.workers = std::vector<Graph::Worker>(static_cast<std::size_t>(workers));
  // Where there are more workers than threads the one that is waited for may need this very thread.
  const bool waits = workers <= most_threads();
  for (std::size_t t = 0; t < tasks; ++t) {
    const auto worker = static_cast<std::size_t>(table.worker()[t]);
    g.nodes.push_back(std::make_unique<Graph::Node>(g.graph, static_cast<int>(g.needs[t].size()),
        [&g, &own = g.workers[worker], task = table.tasks()[t], t, next = waits ? table.next_of_worker()[t] : -1](const Graph::Message&) {
      g.run(task);
      for (const std::int32_t other : g.needed_by[t]) g.nodes[static_cast<std::size_t>(other)]->try_put(Graph::Message());
      own.done.store(own.done.load(std::memory_order_relaxed) + 1, std::memory_order_release);
      if (next >= 0 && own.waits_in_vain < most_in_vain && !wait_a_little([&] { return g.others_are_done(static_cast<std::size_t>(next)); })) ++own.waits_in_vain;
      return Graph::Message();
    }));
  }
  std::vector<bool> first(tasks, true);
  for (std::size_t t = 0; t < tasks; ++t) {
    if (const std::int32_t next = table.next_of_worker()[t]; next >= 0) {
      tbb::flow::make_edge(*g.nodes[t], *g.nodes[static_cast<std::size_t>(next)]);
      first[static_cast<std::size_t>(next)] = false;
    }
    if (first[t] && g.needs[t].empty()) g.roots.push_back(g.nodes[t].get());
  }
}

FlowGraph::~FlowGraph() = default;

void FlowGraph::run(int steps) {
  graph_->steps = steps;
  for (Graph::Worker& worker : graph_->workers) worker.done.store(0, std::memory_order_relaxed), worker.waits_in_vain = 0;
  for (Graph::Node* root : graph_->roots) root->try_put(Graph::Message());
  graph_->graph.wait_for_all();
}

}  // namespace platen
