#include "core/task_order.h"

#include <algorithm>
#include <cassert>
#include <functional>
#include <numeric>
#include <queue>
#include <tuple>

#include "core/batch_cuts.h"

namespace platen {

namespace {

// Who has which batch: the workers' parts of the bed are equally large, slabs across an axis, or stretches of the curve.
enum class Cut { across_x, across_y, across_z, of_curve };
std::vector<int> parts_of(const std::vector<Batch>& batches, int workers, Cut cut) {
  std::vector<std::size_t> order(batches.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  if (cut != Cut::of_curve)
    std::stable_sort(order.begin(), order.end(), [&, axis = static_cast<std::size_t>(cut)](std::size_t a, std::size_t b) {
      return batches[a].centre[axis] < batches[b].centre[axis];
    });
  const double share = touched_bytes(batches) / workers;
  double before = 0.0;
  std::vector<int> worker(batches.size());
  for (const std::size_t k : order) {
    const double own = state_bytes(batches[k]) + contact_bytes(batches[k]);
    worker[k] = std::min(workers - 1, static_cast<int>((before + 0.5 * own) / share));
    before += own;
  }
  return worker;
}

// Spheres of each batch that two workers have to do with: what its contacts read and add to of others', what it takes in of its own.
struct Abroad {
  std::vector<std::int64_t> read, taken;
};
Abroad abroad_of(const std::vector<Batch>& batches, const std::vector<int>& worker) {
  Abroad of{std::vector<std::int64_t>(batches.size(), 0), std::vector<std::int64_t>(batches.size(), 0)};
  for (std::size_t b = 0; b < batches.size(); ++b)
    for (const Incoming& in : batches[b].incoming) {
      const auto from = static_cast<std::size_t>(in.batch);
      if (worker[from] == worker[b]) continue;
      of.read[from] += in.count, of.taken[b] += in.count;
    }
  return of;
}

double mean_pairs(const std::vector<Batch>& batches) {
  double sum = 0.0;
  for (const Batch& b : batches) sum += b.padded;
  return sum / static_cast<double>(std::max<std::size_t>(batches.size(), 1));
}

// The search for an order: workers take tasks at the times at which they would, each of its own batches and for its own cache.
class Planner {
 public:
  Planner(const TaskTable& table, const std::vector<Batch>& batches, double bytes, int workers, Cut cut, double phase_weighs)
      : phase_weighs_(phase_weighs), table_(table), batches_(batches), waits_(table.predecessors()), ready_(batches.size(), -1), worker_(parts_of(batches, workers, cut)),
        abroad_(abroad_of(batches, worker_)), caches_(batches, worker_, bytes), ready_tasks_(static_cast<std::size_t>(workers), 0),
        late_(mean_pairs(batches)), mean_(touched_bytes(batches) / (2.0 * static_cast<double>(std::max<std::size_t>(batches.size(), 1)))) {
    for (std::size_t t = 0; t < waits_.size(); ++t)
      if (waits_[t] == 0) set_free(static_cast<std::int32_t>(t));
  }

  TaskOrder plan() {
    std::priority_queue<Running, std::vector<Running>, std::greater<>> running;
    std::vector<bool> busy(ready_tasks_.size(), false);
    while (order_.tasks.size() < waits_.size()) {
      for (std::size_t w = 0; w < busy.size(); ++w) {
        if (busy[w] || ready_tasks_[w] == 0) continue;
        const std::int32_t t = best_of(w);
        const double missing = take(t, w);
        running.push({now_ + time_of(task(t), missing), w, t});
        busy[w] = true;
      }
      const auto [when, w, t] = running.top();
      running.pop();
      now_ = when;
      const bool others = w == busy.size();  // it is the others who hear of it
      if (!others) {
        busy[w] = false;
        order_.time = when;
        running.push({when + late_, busy.size(), t});
      }
      for (const std::int32_t next : table_.successors()[static_cast<std::size_t>(t)])
        if ((worker_of(next) != worker_of(t)) == others && --waits_[static_cast<std::size_t>(next)] == 0) set_free(next);
    }
    for (; !running.empty(); running.pop())
      if (std::get<1>(running.top()) < busy.size()) order_.time = std::get<0>(running.top());
    return std::move(order_);
  }

 private:
  using Running = std::tuple<double, std::size_t, std::int32_t>;  // when it ends, worker, task; when others hear of it, number of workers, task
  const Task& task(std::int32_t t) const { return table_.tasks()[static_cast<std::size_t>(t)]; }
  std::size_t worker_of(std::int32_t t) const { return static_cast<std::size_t>(worker_[static_cast<std::size_t>(task(t).batch)]); }

  // Tasks of one batch follow each other, so each batch has one that is ready or none.
  void set_free(std::int32_t t) {
    assert(ready_[static_cast<std::size_t>(task(t).batch)] < 0);
    ready_[static_cast<std::size_t>(task(t).batch)] = t;
    ++ready_tasks_[worker_of(t)];
  }
  double take(std::int32_t t, std::size_t w) {
    order_.tasks.push_back(t), order_.worker.push_back(static_cast<std::int32_t>(w));
    ready_[static_cast<std::size_t>(task(t).batch)] = -1;
    --ready_tasks_[w];
    const double missing = caches_.missing(task(t)).all();
    caches_.use(task(t));
    return missing;
  }
  // A contact takes about twice as long as a sphere's motion, and as 300 bytes from memory; what another core wrote last takes as long as
  // three contacts with each sphere whose row is read, and as two with each share that is added [docs/decisions.md, "Borders have a price"].
  double time_of(const Task& t, double missing) const {
    const auto index = static_cast<std::size_t>(t.batch);
    const Batch& b = batches_[index];
    double time = 0.003 * missing;
    if (t.kind != TaskKind::integrate) time += b.padded + 3.0 * static_cast<double>(abroad_.read[index]);
    if (t.kind != TaskKind::contacts) time += 0.5 * b.count + 2.0 * static_cast<double>(abroad_.taken[index]);
    return time;
  }
  std::int32_t best_of(std::size_t w) const {
    // Weights against the mean bytes of half a batch, its state or its contacts. Found by trying on beds of 280,000 and a million
    // spheres; a factor of two in either changes little.
    constexpr double neighbours_weigh = 3.0;
    std::int32_t best = -1;
    double best_price = 0.0;
    for (const int b : caches_.around(w)) {
      const std::int32_t t = ready_[static_cast<std::size_t>(b)];
      if (t < 0) continue;
      const int phase = 2 * task(t).offset + (task(t).kind == TaskKind::contacts ? 1 : 0);
      const double price = caches_.missing(task(t)).all() / mean_ + phase_weighs_ * phase - neighbours_weigh * caches_.share_of_neighbours(b);
      if (best < 0 || price < best_price || (price == best_price && t < best)) best = t, best_price = price;
    }
    if (best >= 0) return best;
    // Nobody near what a cache holds can go on, which is rare: the first of all who can.
    for (const std::int32_t t : ready_)
      if (t >= 0 && worker_of(t) == w && (best < 0 || t < best)) best = t;
    return best;
  }

  const double phase_weighs_;
  const TaskTable& table_;
  const std::vector<Batch>& batches_;
  std::vector<std::int32_t> waits_;   // for how many each task still waits
  std::vector<std::int32_t> ready_;   // task of each batch that may begin, or -1
  std::vector<int> worker_;           // of each batch
  const Abroad abroad_;
  CacheModel caches_;
  std::vector<int> ready_tasks_;      // of each worker
  // Other workers count on a task this much later, about the time of one: what takes longer than foreseen then keeps nobody waiting.
  double late_;
  double mean_;
  TaskOrder order_;
  double now_ = 0.0;
};

// A worker's part of the bed, small as it is, should be more than its border.
constexpr std::size_t least_batches_of_worker = 16;

}  // namespace

double bytes_from_memory(const TaskTable& table, const std::vector<Batch>& batches, double bytes) {
  CacheModel caches(batches, worker_of_batches(table, batches.size()), bytes);
  for (const Task& task : table.tasks()) caches.use(task);
  return caches.taken_in();
}

TaskOrder order_for_cache(const TaskTable& table, const std::vector<Batch>& batches, double bytes, int workers, const ParallelFor& parallel) {
  // No weight of how far a batch is ahead suits every bed; these two differ by up to 6 %. Nor does a cut: one leaves workers a short border,
  // another lets a worker's cache take more steps of its batches one after the other.
  struct Try {
    Cut cut;
    double phase_weighs;
    TaskOrder order = {};
  };
  std::vector<Try> tries = {{Cut::of_curve, 0.04}, {Cut::of_curve, 0.08}};
  if (workers > 1)
    for (const Cut cut : {Cut::across_x, Cut::across_y, Cut::across_z}) tries.push_back({cut, 0.04});
  parallel(static_cast<int>(tries.size()), [&](int k) {
    Try& t = tries[static_cast<std::size_t>(k)];
    t.order = Planner(table, batches, bytes, workers, t.cut, t.phase_weighs).plan();
  });
  const auto best = std::min_element(tries.begin(), tries.end(), [](const Try& a, const Try& b) { return a.order.time < b.order.time; });
  if (workers == 1) best->order.worker.clear();
  return std::move(best->order);
}

double order_if_large(TaskTable& table, const std::vector<Batch>& batches, double bytes, int workers, const ParallelFor& parallel) {
  const double touched = touched_bytes_with_columns(batches), of_batch = touched / static_cast<double>(std::max<std::size_t>(batches.size(), 1));
  if (touched <= 2.0 * bytes || 256.0 * of_batch <= bytes) return 0.0;
  const bool parts = workers > 1 && batches.size() >= least_batches_of_worker * static_cast<std::size_t>(workers);
  // Up to eight cores share a third cache, of some three times what one may count on.
  const double own = parts ? std::min(bytes, bytes * 8.0 / (3.0 * std::min(workers, 8))) : bytes;
  table.reorder(order_for_cache(table, batches, own, parts ? workers : 1, parallel));
  return own;
}

void deal_out(TaskTable& table, const std::vector<Batch>& batches, int workers) {
  const auto all = static_cast<double>(work_of(batches));
  double before = 0.0;
  std::vector<std::int32_t> of_batch, of_task;
  for (const Batch& b : batches) {
    const auto own = static_cast<double>(work_of(b));
    of_batch.push_back(std::min(workers - 1, static_cast<std::int32_t>(workers * (before + 0.5 * own) / std::max(all, 1.0))));
    before += own;
  }
  for (const Task& task : table.tasks()) of_task.push_back(of_batch[static_cast<std::size_t>(task.batch)]);
  table.give_to(std::move(of_task));
}

}  // namespace platen
