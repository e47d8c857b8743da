#include "core/worker_tasks.h"

#include <algorithm>
#include <stdexcept>

namespace platen {

namespace {

// Places of the batches' counters, those of each worker's batches from the start of a line on.
std::vector<std::int32_t> places_of(const std::vector<int>& worker, int counters_of_a_line) {
  std::vector<std::int32_t> place(worker.size());
  std::int32_t at = 0;
  for (int w = 0; std::any_of(worker.begin(), worker.end(), [w](int of) { return of >= w; }); ++w) {
    for (std::size_t b = 0; b < worker.size(); ++b)
      if (worker[b] == w) place[b] = at++;
    at = (at + counters_of_a_line - 1) / counters_of_a_line * counters_of_a_line;
  }
  return place;
}

}  // namespace

WorkerTasks::WorkerTasks(const TaskTable& table) : queues_(static_cast<std::size_t>(worker_count(table))) {
  const std::vector<Task>& tasks = table.tasks();
  if (table.worker().size() != tasks.size()) throw std::logic_error("tasks that have no workers");
  int batches = 0;
  for (const Task& task : tasks) batches = std::max(batches, task.batch + 1);
  const std::vector<std::int32_t> place_of_batch = places_of(worker_of_batches(table, static_cast<std::size_t>(batches)), counters_of_a_line);
  const std::int32_t last = place_of_batch.empty() ? 0 : *std::max_element(place_of_batch.begin(), place_of_batch.end());
  progress_ = std::vector<Line>(static_cast<std::size_t>(last / counters_of_a_line + 1));

  std::vector<std::int32_t> before(static_cast<std::size_t>(batches), 0);
  for (std::size_t t = 0; t < tasks.size(); ++t) {
    const auto batch = static_cast<std::size_t>(tasks[t].batch);
    place_.push_back(place_of_batch[batch]);
    nth_.push_back(before[batch]++);
    queues_[static_cast<std::size_t>(table.worker()[t])].tasks.push_back(static_cast<std::int32_t>(t));
  }
  for (Queue& queue : queues_) queue.taken = std::make_unique<std::atomic<bool>[]>(queue.tasks.size());

  std::vector<std::vector<Want>> wants(tasks.size());
  who_waits_.resize(tasks.size());
  for (std::size_t t = 0; t < tasks.size(); ++t) {
    for (const std::int32_t next : table.successors()[t]) {
      std::vector<Want>& of_next = wants[static_cast<std::size_t>(next)];
      const auto same = std::find_if(of_next.begin(), of_next.end(), [&](const Want& want) { return want.place == place_[t]; });
      if (same == of_next.end()) of_next.push_back({place_[t], nth_[t] + 1});
      else same->done = std::max(same->done, nth_[t] + 1);
      const std::int32_t worker = table.worker()[static_cast<std::size_t>(next)];
      if (std::find(who_waits_[t].begin(), who_waits_[t].end(), worker) == who_waits_[t].end()) who_waits_[t].push_back(worker);
    }
  }
  for (const std::vector<Want>& of_task : wants) {
    first_want_.push_back(static_cast<std::int32_t>(wants_.size()));
    wants_.insert(wants_.end(), of_task.begin(), of_task.end());
  }
  first_want_.push_back(static_cast<std::int32_t>(wants_.size()));
  start();
}

void WorkerTasks::start() {
  for (Line& line : progress_)
    for (auto& done : line.counters) done.store(0, std::memory_order_relaxed);
  for (Queue& queue : queues_) {
    queue.first.store(0, std::memory_order_relaxed);
    for (std::size_t k = 0; k < queue.tasks.size(); ++k) queue.taken[k].store(false, std::memory_order_relaxed);
  }
}

bool WorkerTasks::is_ready(std::int32_t task) {
  const auto t = static_cast<std::size_t>(task);
  for (auto k = static_cast<std::size_t>(first_want_[t]); k < static_cast<std::size_t>(first_want_[t + 1]); ++k)
    if (progress(wants_[k].place).load(std::memory_order_acquire) < wants_[k].done) return false;
  return true;
}

bool WorkerTasks::try_to_take(Queue& queue, std::size_t k) {
  return !queue.taken[k].load(std::memory_order_relaxed) && is_ready(queue.tasks[k]) && !queue.taken[k].exchange(true, std::memory_order_relaxed);
}

// From the first that is not taken on. Whoever looks notes it, so that nobody goes through the same ones again.
WorkerTasks::Range WorkerTasks::window_of(Queue& queue) {
  const std::size_t known = queue.first.load(std::memory_order_relaxed);
  std::size_t first = known;
  while (first < queue.tasks.size() && queue.taken[first].load(std::memory_order_relaxed)) ++first;
  if (first != known) queue.first.store(first, std::memory_order_relaxed);
  return {first, std::min(queue.tasks.size(), first + window)};
}

std::int32_t WorkerTasks::take(std::size_t worker) {
  Queue& queue = queues_[worker];
  const Range range = window_of(queue);
  for (std::size_t k = range.first; k < range.end; ++k)
    if (try_to_take(queue, k)) return queue.tasks[k];
  return -1;
}

bool WorkerTasks::can_take(std::size_t worker) {
  Queue& queue = queues_[worker];
  const Range range = window_of(queue);
  for (std::size_t k = range.first; k < range.end; ++k)
    if (!queue.taken[k].load(std::memory_order_relaxed) && is_ready(queue.tasks[k])) return true;
  return false;
}

std::int32_t WorkerTasks::take_from_others(std::size_t worker) {
  for (std::size_t other = worker + 1; other < worker + workers(); ++other) {
    Queue& queue = queues_[other % workers()];
    const Range range = window_of(queue);
    for (std::size_t k = range.end; k-- > range.first;)
      if (try_to_take(queue, k)) return queue.tasks[k];
  }
  return -1;
}

void WorkerTasks::done(std::int32_t task) {
  const auto t = static_cast<std::size_t>(task);
  progress(place_[t]).store(nth_[t] + 1, std::memory_order_release);
}

bool WorkerTasks::has_left(std::size_t worker) {
  const Range range = window_of(queues_[worker]);
  return range.first < range.end;
}

bool WorkerTasks::have_left() {
  for (std::size_t w = 0; w < workers(); ++w)
    if (has_left(w)) return true;
  return false;
}

}  // namespace platen
