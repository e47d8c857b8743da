#include "core/task_order.h"

#include <algorithm>

namespace platen {

namespace {

// Of each sphere: the state (nine columns and the row), its sums, its image and speed; of each contact: its history and lists.
double state_bytes(const Batch& b) {
  const double sphere = sizeof(double) * (9 + row_size + record_size + 1) + 2 * sizeof(std::int32_t);
  return sphere * b.count + record_bytes * static_cast<double>(b.halo.size());
}
double contact_bytes(const Batch& b) {
  const double history = sizeof(double) * (b.k_t_last.empty() ? 4 : 5);
  return (history + 2 * sizeof(std::int32_t) + sizeof(PairTargets)) * static_cast<double>(b.padded);
}

// Batches with numbers 0, 1, ..., some of which belong to it; adding, removing and looking at all take little.
class Subset {
 public:
  explicit Subset(std::size_t of) : place_(of, -1) {}
  const std::vector<int>& members() const { return members_; }
  void add(int b) {
    if (place_[static_cast<std::size_t>(b)] >= 0) return;
    place_[static_cast<std::size_t>(b)] = static_cast<int>(members_.size());
    members_.push_back(b);
  }
  void remove(int b) {
    const int place = place_[static_cast<std::size_t>(b)];
    if (place < 0) return;
    members_[static_cast<std::size_t>(place)] = members_.back();
    place_[static_cast<std::size_t>(members_.back())] = place;
    members_.pop_back();
    place_[static_cast<std::size_t>(b)] = -1;
  }

 private:
  std::vector<int> members_;
  std::vector<int> place_;
};

// What a cache holds of the batches: their states (2b) and their contacts (2b + 1).
class Cache {
 public:
  Cache(const std::vector<Batch>& batches, double bytes) : capacity_(bytes), near_(batches.size(), 0), around_(batches.size()) {
    for (const Batch& b : batches) {
      size_.push_back(state_bytes(b)), size_.push_back(contact_bytes(b));
      std::vector<int> all = b.partners;
      all.insert(all.end(), b.owners.begin(), b.owners.end());
      std::sort(all.begin(), all.end());
      all.erase(std::unique(all.begin(), all.end()), all.end());
      neighbours_.push_back(std::move(all));
    }
    last_use_.assign(size_.size(), -1);
  }

  // Batches that are in the cache or have a neighbour there.
  const std::vector<int>& around() const { return around_.members(); }
  double missing(const Task& task) const {
    const auto state = 2 * static_cast<std::size_t>(task.batch);
    return (holds(state) ? 0.0 : size_[state]) + (task.kind == TaskKind::integrate || holds(state + 1) ? 0.0 : size_[state + 1]);
  }
  double share_of_neighbours(int batch) const {
    const auto b = static_cast<std::size_t>(batch);
    return neighbours_[b].empty() ? 0.0 : near_[b] / static_cast<double>(neighbours_[b].size());
  }
  double taken_in() const { return taken_in_; }
  void use(const Task& task) {
    const auto state = 2 * static_cast<std::size_t>(task.batch);
    touch(state);
    if (task.kind != TaskKind::integrate) touch(state + 1);
  }

 private:
  bool holds(std::size_t what) const { return last_use_[what] >= 0; }
  void touch(std::size_t what) {
    const bool is_new = !holds(what);
    last_use_[what] = static_cast<std::int64_t>(uses_.size());
    uses_.push_back(what);
    if (is_new) {
      held_ += size_[what];
      taken_in_ += size_[what];
      if (what % 2 == 0) tell_neighbours(static_cast<int>(what / 2), 1);
    }
    for (; held_ > capacity_ && oldest_ + 1 < uses_.size(); ++oldest_) {
      const std::size_t old = uses_[oldest_];
      if (last_use_[old] != static_cast<std::int64_t>(oldest_)) continue;  // used again since
      last_use_[old] = -1;
      held_ -= size_[old];
      if (old % 2 == 0) tell_neighbours(static_cast<int>(old / 2), -1);
    }
  }
  void tell_neighbours(int batch, int change) {
    for (const int b : neighbours_[static_cast<std::size_t>(batch)]) {
      near_[static_cast<std::size_t>(b)] += change;
      update_around(b);
    }
    update_around(batch);
  }
  void update_around(int b) {
    if (near_[static_cast<std::size_t>(b)] > 0 || holds(2 * static_cast<std::size_t>(b)))
      around_.add(b);
    else
      around_.remove(b);
  }

  double capacity_, held_ = 0.0, taken_in_ = 0.0;
  std::vector<double> size_;
  std::vector<std::int64_t> last_use_;  // place in uses_; -1: not held
  std::vector<std::size_t> uses_;
  std::size_t oldest_ = 0;
  std::vector<std::vector<int>> neighbours_;
  std::vector<int> near_;  // neighbours whose states are held
  Subset around_;
};

}  // namespace

double touched_bytes(const std::vector<Batch>& batches) {
  double bytes = 0.0;
  for (const Batch& b : batches) bytes += state_bytes(b) + contact_bytes(b);
  return bytes;
}

double bytes_from_memory(const TaskTable& table, const std::vector<Batch>& batches, double bytes) {
  Cache cache(batches, bytes);
  for (const Task& task : table.tasks()) cache.use(task);
  return cache.taken_in();
}

std::vector<std::int32_t> order_for_cache(const TaskTable& table, const std::vector<Batch>& batches, double bytes) {
  // Weights against the mean bytes of half a batch, its state or its contacts. Found by trying on beds of 280,000 and a million
  // spheres; a factor of two in either changes little.
  constexpr double neighbours_weigh = 3.0, phase_weighs = 0.04;
  const double mean = touched_bytes(batches) / (2.0 * static_cast<double>(std::max<std::size_t>(batches.size(), 1)));
  Cache cache(batches, bytes);
  std::vector<std::int32_t> waits = table.predecessors();
  // Tasks of one batch follow each other, so each batch has one that is ready or none.
  std::vector<std::int32_t> ready(batches.size(), -1);
  const auto task_of = [&](std::int32_t t) -> const Task& { return table.tasks()[static_cast<std::size_t>(t)]; };
  for (std::size_t t = 0; t < waits.size(); ++t)
    if (waits[t] == 0) ready[static_cast<std::size_t>(table.tasks()[t].batch)] = static_cast<std::int32_t>(t);

  std::vector<std::int32_t> order;
  order.reserve(waits.size());
  while (order.size() < waits.size()) {
    std::int32_t best = -1;
    double best_price = 0.0;
    for (const int b : cache.around()) {
      const std::int32_t t = ready[static_cast<std::size_t>(b)];
      if (t < 0) continue;
      const Task& task = task_of(t);
      const int phase = 2 * task.offset + (task.kind == TaskKind::contacts ? 1 : 0);
      const double price = cache.missing(task) / mean + phase_weighs * phase - neighbours_weigh * cache.share_of_neighbours(b);
      if (best < 0 || price < best_price || (price == best_price && t < best)) best = t, best_price = price;
    }
    if (best < 0) {  // nobody near what the cache holds can go on, which is rare: the first of all who can
      for (const std::int32_t t : ready)
        if (t >= 0 && (best < 0 || t < best)) best = t;
    }
    const Task& task = task_of(best);
    order.push_back(best);
    cache.use(task);
    ready[static_cast<std::size_t>(task.batch)] = -1;
    for (const std::int32_t next : table.successors()[static_cast<std::size_t>(best)])
      if (--waits[static_cast<std::size_t>(next)] == 0) ready[static_cast<std::size_t>(task_of(next).batch)] = next;
  }
  return order;
}

void order_if_large(TaskTable& table, const std::vector<Batch>& batches, double bytes) {
  const double touched = touched_bytes(batches), of_batch = touched / static_cast<double>(std::max<std::size_t>(batches.size(), 1));
  if (touched > 2.0 * bytes && 256.0 * of_batch > bytes) table.reorder(order_for_cache(table, batches, bytes));
}

}  // namespace platen
