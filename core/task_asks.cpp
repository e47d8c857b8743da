#include "core/task_asks.h"

#include <algorithm>

#include "core/cache_model.h"

namespace platen {

namespace {

// Asking costs time too: no task asks for more than so much with each of its contacts [bytes] ...
constexpr double asked_with_a_contact = 96.0;
// ... nor for less than this at a time, and nobody for what is needed so many tasks with contacts later, or is used before that.
constexpr double least_asked = 4096.0;
constexpr std::size_t longest_ahead = 8;

struct Host {
  std::size_t task;
  double room;  // what it may still ask for [bytes]
};

}  // namespace

TaskAsks asks_of_tasks(const TaskTable& table, const std::vector<Batch>& batches, double bytes) {
  const std::vector<int> worker = worker_of_batches(table, batches.size());
  CacheModel caches(batches, worker, bytes);
  TaskAsks asks(table.tasks().size());
  std::vector<std::int64_t> last_use[2];  // of each batch's state and of its contacts: the task
  for (auto& of : last_use) of.assign(batches.size(), -1);
  std::vector<std::vector<Host>> hosts(worker.empty() ? 0 : 1 + static_cast<std::size_t>(*std::max_element(worker.begin(), worker.end())));
  for (std::size_t t = 0; t < table.tasks().size(); ++t) {
    const Task& task = table.tasks()[t];
    const auto batch = static_cast<std::size_t>(task.batch);
    std::vector<Host>& before = hosts[static_cast<std::size_t>(worker[batch])];
    // The later parts are met last, so they are asked for last: from the last host backwards.
    const auto deal_out = [&](double missing, bool contacts) {
      double left = missing;
      for (std::size_t n = 0; n < std::min(before.size(), longest_ahead) && left > 0.0; ++n) {
        Host& host = before[before.size() - 1 - n];
        if (static_cast<std::int64_t>(host.task) <= last_use[contacts][batch]) break;
        const double part = std::min(host.room, left);
        if (part < std::min(least_asked, missing) || asks[host.task].size() == most_asked) continue;
        host.room -= part;
        asks[host.task].push_back({task.batch, contacts, (left - part) / missing, left / missing, task.offset});
        left -= part;
      }
    };
    const Missing missing = caches.missing(task);
    caches.use(task);
    if (missing.state > 0.0) deal_out(missing.state, false);
    if (missing.contacts > 0.0) deal_out(missing.contacts, true);
    last_use[false][batch] = static_cast<std::int64_t>(t);
    if (task.kind != TaskKind::integrate) last_use[true][batch] = static_cast<std::int64_t>(t);
    if (task.kind != TaskKind::integrate) before.push_back({t, asked_with_a_contact * batches[batch].padded});
  }
  return asks;
}

}  // namespace platen
