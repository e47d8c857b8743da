#include "core/cache_model.h"

#include <algorithm>

namespace platen {

double state_bytes(const Batch& b) {
  const double sphere = sizeof(double) * (row_size + record_size) + sizeof(float);
  return sphere * b.count + record_bytes * static_cast<double>(b.halo.size());
}

double contact_bytes(const Batch& b) {
  const double history = sizeof(double) * (b.k_t_last.empty() ? 4 : 5);
  return (history + sizeof(std::int32_t) + sizeof(PairTargets) + sizeof(OwnersOfEight) / 8.0) * static_cast<double>(b.padded);
}

double touched_bytes(const std::vector<Batch>& batches) {
  double bytes = 0.0;
  for (const Batch& b : batches) bytes += state_bytes(b) + contact_bytes(b);
  return bytes;
}

double touched_bytes_with_columns(const std::vector<Batch>& batches) {
  double bytes = touched_bytes(batches);
  for (const Batch& b : batches) bytes += 9.0 * sizeof(double) * b.count;
  return bytes;
}

CacheModel::CacheModel(const std::vector<Batch>& batches, const std::vector<int>& worker, double bytes)
    : capacity_(bytes), worker_(worker), near_(batches.size(), 0) {
  for (const Batch& b : batches) {
    size_.push_back(state_bytes(b)), size_.push_back(contact_bytes(b));
    std::vector<int> all = b.partners;
    all.insert(all.end(), b.owners.begin(), b.owners.end());
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
    neighbours_.push_back(std::move(all));
  }
  last_use_.assign(size_.size(), -1);
  const int workers = worker.empty() ? 1 : *std::max_element(worker.begin(), worker.end()) + 1;
  one_.resize(static_cast<std::size_t>(workers));
  around_.assign(static_cast<std::size_t>(workers), Subset(batches.size()));
}

void CacheModel::touch(std::size_t what) {
  Cache& c = one_[static_cast<std::size_t>(worker_[what / 2])];
  const bool is_new = !holds(what);
  last_use_[what] = static_cast<std::int64_t>(c.uses.size());
  c.uses.push_back(what);
  if (is_new) {
    c.held += size_[what];
    taken_in_ += size_[what];
    if (what % 2 == 0) tell_neighbours(static_cast<int>(what / 2), 1);
  }
  for (; c.held > capacity_ && c.oldest + 1 < c.uses.size(); ++c.oldest) {
    const std::size_t old = c.uses[c.oldest];
    if (last_use_[old] != static_cast<std::int64_t>(c.oldest)) continue;  // used again since
    last_use_[old] = -1;
    c.held -= size_[old];
    if (old % 2 == 0) tell_neighbours(static_cast<int>(old / 2), -1);
  }
}

void CacheModel::tell_neighbours(int batch, int change) {
  for (const int b : neighbours_[static_cast<std::size_t>(batch)]) {
    near_[static_cast<std::size_t>(b)] += change;
    update_around(b);
  }
  update_around(batch);
}

void CacheModel::update_around(int b) {
  Subset& around = around_[static_cast<std::size_t>(worker_[static_cast<std::size_t>(b)])];
  if (near_[static_cast<std::size_t>(b)] > 0 || holds(2 * static_cast<std::size_t>(b)))
    around.add(b);
  else
    around.remove(b);
}

}  // namespace platen
