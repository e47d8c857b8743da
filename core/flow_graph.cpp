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

#include "core/worker_tasks.h"

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

// How long a worker waits for others before it takes one of their tasks. Neighbours that have a core each are about a task behind, of some 50 us or
// less; in beds that fit in the caches a task is dear to anybody else.
// After so many waits that brought no task of its own it waits no more in this run: something else may have the core of whom it waits for.
struct Patience {
  std::chrono::microseconds wait;
  int most_in_vain;
};
constexpr Patience in_large_beds = {std::chrono::microseconds(50), 64}, in_caches = {std::chrono::microseconds(300), 4};

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
    std::atomic<bool> away{false};      // must be sent for
    std::atomic<int> waits_in_vain{0};  // of this run
  };

  tbb::flow::graph graph;
  std::vector<std::unique_ptr<Node>> nodes;
  std::vector<Node*> roots;
  TaskBody body;
  int steps = 0;
  // Where tasks have workers.
  std::unique_ptr<WorkerTasks> tasks;
  std::vector<Task> table;
  std::vector<Worker> workers;
  bool waits = false;
  Patience patience{};

  void run(const Task& task) {
    if (task.offset < steps) body(task);
  }
  std::int32_t wait_for_a_task(std::size_t worker);
  void work(std::size_t worker);
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

// A worker is a node, which takes task after task. So the worker, whose arrays its caches hold, stays with one thread while it has something to
// do or may soon have; then the thread is free for others, and whoever does what was missing sends for the worker.
void FlowGraph::build_for_workers(const TaskTable& table) {
  Graph& g = *graph_;
  g.tasks = std::make_unique<WorkerTasks>(table);
  g.table = table.tasks();
  g.workers = std::vector<Graph::Worker>(g.tasks->workers());
  // Where there are more workers than threads the one that is waited for may need this very thread.
  g.waits = static_cast<int>(g.workers.size()) <= most_threads();
  g.patience = table.ordered() ? in_large_beds : in_caches;
  for (std::size_t w = 0; w < g.workers.size(); ++w) {
    g.nodes.push_back(std::make_unique<Graph::Node>(g.graph, [&g, w](const Graph::Message&) {
      g.work(w);
      return Graph::Message();
    }));
    g.roots.push_back(g.nodes.back().get());
  }
}

// A task that can go on, after a while one of another worker's; -1 where there is none.
std::int32_t FlowGraph::Graph::wait_for_a_task(std::size_t worker) {
  std::int32_t task = tasks->take(worker);
  if (task >= 0 || !waits) return task;
  auto& in_vain = workers[worker].waits_in_vain;
  const bool patient = in_vain.load(std::memory_order_relaxed) < patience.most_in_vain;
  const auto start = std::chrono::steady_clock::now();
  while (tasks->have_left()) {
    for (int k = 0; k < 32; ++k) {
      pause();
      if (task = tasks->take(worker); task >= 0) return task;
    }
    const auto waited = std::chrono::steady_clock::now() - start;
    if (patient && waited < patience.wait) continue;
    if (task = tasks->take_from_others(worker); task >= 0) break;
    if (!patient || waited > 2 * patience.wait) break;
  }
  if (patient) in_vain.fetch_add(1, std::memory_order_relaxed);
  return task;
}

void FlowGraph::Graph::work(std::size_t worker) {
  for (bool sent_for = false; !sent_for;) {
    std::int32_t task = wait_for_a_task(worker);
    if (task < 0) {
      if (!tasks->has_left(worker)) return;
      // Either what is missing is seen here, or who brings it sees that this worker is away.
      std::atomic<bool>& away = workers[worker].away;
      away.store(true, std::memory_order_relaxed);
      std::atomic_thread_fence(std::memory_order_seq_cst);
      task = tasks->take(worker);
      if (task < 0) return;
      sent_for = !away.exchange(false, std::memory_order_relaxed);  // then the worker goes on elsewhere, and only this task is done here
    }
    run(table[static_cast<std::size_t>(task)]);
    tasks->done(task);
    std::atomic_thread_fence(std::memory_order_seq_cst);
    for (const std::int32_t number : tasks->who_waits_for(task)) {
      const auto other = static_cast<std::size_t>(number);
      std::atomic<bool>& away = workers[other].away;
      if (away.load(std::memory_order_relaxed) && tasks->can_take(other) && away.exchange(false, std::memory_order_relaxed)) nodes[other]->try_put(Message());
    }
  }
}

FlowGraph::~FlowGraph() = default;

void FlowGraph::run(int steps) {
  graph_->steps = steps;
  if (graph_->tasks) graph_->tasks->start();
  for (Graph::Worker& worker : graph_->workers) worker.away.store(false, std::memory_order_relaxed), worker.waits_in_vain.store(0, std::memory_order_relaxed);
  for (Graph::Node* root : graph_->roots) root->try_put(Graph::Message());
  graph_->graph.wait_for_all();
}

}  // namespace platen
