// The tasks of a table as an oneTBB flow graph.
#pragma once

#include <memory>

#include "core/step_graph.h"

namespace platen {

// Who takes which task of a flow graph.
enum class Takers {
  anybody,  // whoever is free takes whatever is ready; a thread goes on with the batch that it has, if it can
  workers   // the table says [TaskTable::worker]: in a run each worker stays with one thread while nothing holds it up [core/worker_tasks.h]
};

// Built once and run many times, until a task throws. Build and run it inside the arena that shall work.
class FlowGraph {
 public:
  // The table must have workers if they are the takers; std::logic_error otherwise.
  FlowGraph(const TaskTable& table, TaskBody body, Takers takers);
  // By workers where the table has them.
  FlowGraph(const TaskTable& table, TaskBody body);
  ~FlowGraph();
  void run(int steps);

 private:
  struct Graph;
  void build_for_anybody(const TaskTable& table);
  void build_for_workers(const TaskTable& table);
  std::unique_ptr<Graph> graph_;
};

}  // namespace platen
