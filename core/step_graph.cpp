#include "core/step_graph.h"

#include <algorithm>
#include <stdexcept>
#include <thread>

#include "core/worker_tasks.h"

namespace platen {

const char* to_string(TaskKind kind) {
  switch (kind) {
    case TaskKind::integrate: return "integrate";
    case TaskKind::contacts: return "contacts";
    case TaskKind::step: return "step";
  }
  return "?";
}

std::vector<Access> TaskTable::accesses(const Task& task) const {
  const auto at = [](int batch, Resource what) { return batch * resource_count + what; };
  const int b = task.batch;
  std::vector<Access> list;
  if (task.kind != TaskKind::contacts) {
    for (int owner : owners_[static_cast<std::size_t>(b)]) list.push_back({at(owner, resource_halo), false});
    list.push_back({at(b, resource_history), false});  // plate forces
    list.push_back({at(b, resource_sums), true});      // halo slots and plate forces are added in
    list.push_back({at(b, resource_state), true});
    list.push_back({at(b, resource_totals), true});
  }
  if (task.kind != TaskKind::integrate) {
    list.push_back({at(b, resource_state), false});
    for (int partner : partners_[static_cast<std::size_t>(b)]) list.push_back({at(partner, resource_state), false});
    for (Resource what : {resource_history, resource_sums, resource_halo, resource_totals})
      list.push_back({at(b, what), true});
  }
  return list;
}

TaskTable::TaskTable(const std::vector<Batch>& batches, int steps, bool fused) : steps_(steps), fused_(fused) {
  const int count = static_cast<int>(batches.size());
  for (const Batch& batch : batches) partners_.push_back(batch.partners), owners_.push_back(batch.owners);
  // Fused, a batch's contacts need the positions of its partners, which have higher colours: those go first.
  std::vector<int> order(batches.size());
  for (int b = 0; b < count; ++b) order[static_cast<std::size_t>(b)] = b;
  if (fused) {
    for (const Batch& batch : batches)
      for (const int partner : batch.partners)
        if (batches[static_cast<std::size_t>(partner)].colour <= batch.colour) throw std::logic_error("fused tasks of batches whose lists are not by colour");
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
      return batches[static_cast<std::size_t>(a)].colour > batches[static_cast<std::size_t>(b)].colour;
    });
  }
  for (int offset = 0; offset < steps; ++offset) {
    if (fused) {
      for (int b : order) tasks_.push_back({TaskKind::step, b, offset});
    } else {
      for (int b : order) tasks_.push_back({TaskKind::integrate, b, offset});
      for (int b : order) tasks_.push_back({TaskKind::contacts, b, offset});
    }
  }

  for (std::size_t t = 0; t < tasks_.size(); ++t) tasks_[t].number = static_cast<std::int32_t>(t);

  const auto resources = static_cast<std::size_t>(count) * resource_count;
  std::vector<std::int32_t> writer(resources, -1);
  std::vector<std::vector<std::int32_t>> readers(resources);
  predecessors_.assign(tasks_.size(), 0);
  std::vector<std::int32_t> before, all_before;
  for (std::size_t t = 0; t < tasks_.size(); ++t) {
    const auto list = accesses(tasks_[t]);
    before.clear();
    for (const Access& access : list) {
      const auto r = static_cast<std::size_t>(access.resource);
      if (writer[r] >= 0) before.push_back(writer[r]);
      if (access.writes) before.insert(before.end(), readers[r].begin(), readers[r].end());
    }
    // A doubled edge would make a flow graph wait for ever.
    std::sort(before.begin(), before.end());
    before.erase(std::unique(before.begin(), before.end()), before.end());
    for (std::int32_t p : before) {
      if (p == static_cast<std::int32_t>(t)) continue;
      all_before.push_back(p);
      ++predecessors_[t];
    }
    for (const Access& access : list) {
      const auto r = static_cast<std::size_t>(access.resource);
      if (access.writes) {
        writer[r] = static_cast<std::int32_t>(t);
        readers[r].clear();
      }
    }
    for (const Access& access : list)
      if (!access.writes && writer[static_cast<std::size_t>(access.resource)] != static_cast<std::int32_t>(t))
        readers[static_cast<std::size_t>(access.resource)].push_back(static_cast<std::int32_t>(t));
  }
  successors_ = TaskSuccessors(all_before, predecessors_);
}

void TaskTable::reorder(const TaskOrder& order) {
  const std::size_t count = tasks_.size();
  std::vector<std::int32_t> place(count);
  for (std::size_t k = 0; k < count; ++k) place[static_cast<std::size_t>(order.tasks[k])] = static_cast<std::int32_t>(k);
  std::vector<Task> tasks;
  TaskSuccessors successors;
  std::vector<std::int32_t> predecessors;
  tasks.reserve(count), predecessors.reserve(count), successors.reserve(count, successors_.edges());
  for (const std::int32_t t : order.tasks) {
    const auto k = static_cast<std::size_t>(t);
    tasks.push_back(tasks_[k]), predecessors.push_back(predecessors_[k]);
    tasks.back().number = place[k];
    successors.add(successors_[k], [&](std::int32_t next) { return place[static_cast<std::size_t>(next)]; });
  }
  tasks_ = std::move(tasks), successors_ = std::move(successors), predecessors_ = std::move(predecessors);
  ordered_ = true;
  give_to(order.worker);
}

void TaskTable::give_to(std::vector<std::int32_t> workers) { worker_ = std::move(workers); }

int worker_count(const TaskTable& table) {
  return table.worker().empty() ? 0 : *std::max_element(table.worker().begin(), table.worker().end()) + 1;
}

std::vector<int> worker_of_batches(const TaskTable& table, std::size_t batches) {
  std::vector<int> worker(batches, 0);
  for (std::size_t k = 0; k < table.worker().size(); ++k) worker[static_cast<std::size_t>(table.tasks()[k].batch)] = table.worker()[k];
  return worker;
}

void TaskTable::remove_edge(std::int32_t from, std::int32_t to) {
  if (successors_.remove(from, to)) --predecessors_[static_cast<std::size_t>(to)];
}

std::string TaskTable::to_dot() const {
  std::string text = "digraph step {\n  rankdir=LR;\n";
  const auto name = [&](std::size_t t) {
    return "\"" + std::string(to_string(tasks_[t].kind)) + "(" + std::to_string(tasks_[t].batch) + ") +" +
           std::to_string(tasks_[t].offset) + "\"";
  };
  for (std::size_t t = 0; t < tasks_.size(); ++t)
    for (std::int32_t next : successors_[t]) text += "  " + name(t) + " -> " + name(static_cast<std::size_t>(next)) + ";\n";
  return text + "}\n";
}

void run_serially(const TaskTable& table, int steps, const TaskBody& body) {
  for (const Task& task : table.tasks()) {
    if (task.offset < steps) body(task);
  }
}

namespace {

// As the flow graph does it, but for sending for those who are away.
void run_by_workers_on_plain_threads(const TaskTable& table, int steps, const TaskBody& body) {
  WorkerTasks tasks(table);
  std::vector<std::thread> team;
  for (std::size_t worker = 0; worker < tasks.workers(); ++worker) {
    team.emplace_back([&, worker] {
      while (tasks.have_left()) {
        std::int32_t t = tasks.take(worker);
        if (t < 0) t = tasks.take_from_others(worker);
        if (t < 0) {
          std::this_thread::yield();
          continue;
        }
        const Task& task = table.tasks()[static_cast<std::size_t>(t)];
        if (task.offset < steps) body(task);
        tasks.done(t);
      }
    });
  }
  for (std::thread& thread : team) thread.join();
}

}  // namespace

void run_on_plain_threads(const TaskTable& table, int steps, const TaskBody& body, int threads) {
  if (!table.worker().empty()) return run_by_workers_on_plain_threads(table, steps, body);
  const std::size_t count = table.tasks().size();
  std::vector<std::vector<std::int32_t>> before(count);
  for (std::size_t t = 0; t < count; ++t)
    for (std::int32_t next : table.successors()[t]) before[static_cast<std::size_t>(next)].push_back(static_cast<std::int32_t>(t));
  std::vector<std::atomic<bool>> done(count);
  for (auto& flag : done) flag.store(false, std::memory_order_relaxed);
  // Tasks are dealt out in table order, so whoever waits, waits for a task that another thread already has.
  std::vector<std::thread> team;
  for (int worker = 0; worker < threads; ++worker) {
    team.emplace_back([&, worker] {
      for (std::size_t t = static_cast<std::size_t>(worker); t < count; t += static_cast<std::size_t>(threads)) {
        if (table.tasks()[t].offset >= steps) continue;
        for (std::int32_t p : before[t])
          while (!done[static_cast<std::size_t>(p)].load(std::memory_order_acquire)) std::this_thread::yield();
        body(table.tasks()[t]);
        done[t].store(true, std::memory_order_release);
      }
    });
  }
  for (std::thread& thread : team) thread.join();
}

}  // namespace platen
