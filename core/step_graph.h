// The tasks of a number of time steps, what each reads and writes, and the order that follows from it.
//
// The table is written down once in the order of the steps. Two tasks that touch the same resource,
// at least one of them writing, keep that order: edges are derived, nobody writes them. It may be put into another order that keeps all edges; then one
// thread takes the tasks as they come, more take the first that is ready, or each the first of its own. The same table runs serially,
// as an oneTBB flow graph [core/flow_graph.h], or on plain threads that see for themselves what is done (for ThreadSanitizer, which cannot
// see through an uninstrumented libtbb).
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "core/batches.h"
#include "core/task_successors.h"

namespace platen {

enum class TaskKind : std::uint8_t {
  integrate,  // reads sums of b, halo slots meant for b, plate forces of b; writes x v u of b and its largest speed. Of a run's first step it
              // saves x v u and which sides were crossed before, and contacts the history, in places of b alone
  contacts,   // reads x v u of b and its partners; writes history, sums and halo slots of b
  step        // fused: integrate, then contacts
};

const char* to_string(TaskKind kind);

struct Task {
  TaskKind kind;
  int batch;
  int offset;  // step within the graph
  std::int32_t number = 0;  // in its table
};

struct Access {
  int resource;  // batch * resources + what
  bool writes;
};
enum Resource { resource_state, resource_sums, resource_halo, resource_history, resource_totals, resource_count };

struct TaskOrder {
  std::vector<std::int32_t> tasks;   // tasks[k]: the task that comes k-th
  std::vector<std::int32_t> worker;  // who takes it; empty: whoever is free
  double time = 0.0;                 // when the last one ends, as the search foresees it [times of a contact]
};

class TaskTable {
 public:
  // `fused` needs batches with lists by colour [core/neighbours.h, Ownership]; std::logic_error otherwise.
  TaskTable(const std::vector<Batch>& batches, int steps, bool fused);

  int steps() const { return steps_; }
  bool fused() const { return fused_; }
  const std::vector<Task>& tasks() const { return tasks_; }
  const TaskSuccessors& successors() const { return successors_; }
  const std::vector<std::int32_t>& predecessors() const { return predecessors_; }  // their number
  // Whether the order of the tasks is meant [core/task_order.h]; otherwise a graph takes whichever is ready.
  bool ordered() const { return ordered_; }
  void reorder(const TaskOrder& order);  // must keep all edges
  void give_to(std::vector<std::int32_t> workers);  // of each task; a worker takes its own in the table's order
  // Of each task who takes it; empty where no worker has a part of the bed.
  const std::vector<std::int32_t>& worker() const { return worker_; }
  std::vector<Access> accesses(const Task& task) const;
  void remove_edge(std::int32_t from, std::int32_t to);  // for tests that must see it missed
  std::string to_dot() const;                            // Graphviz

 private:
  int steps_;
  bool fused_, ordered_ = false;
  std::vector<std::vector<int>> partners_, owners_;  // of each batch
  std::vector<Task> tasks_;
  TaskSuccessors successors_;
  std::vector<std::int32_t> predecessors_, worker_;
};

// How many workers the tasks have; 0 where any worker may take any task.
int worker_count(const TaskTable& table);
// Who has each of so many batches; all are of worker 0 where any worker may take any task.
std::vector<int> worker_of_batches(const TaskTable& table, std::size_t batches);

using TaskBody = std::function<void(const Task&)>;

// Runs the tasks of the first `steps` steps of the table. On plain threads those of workers are taken by a thread for each, whatever `threads` is.
void run_serially(const TaskTable& table, int steps, const TaskBody& body);
void run_on_plain_threads(const TaskTable& table, int steps, const TaskBody& body, int threads);

}  // namespace platen
