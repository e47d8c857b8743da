#include "core/batch_cuts.h"

#include <algorithm>
#include <cmath>

namespace platen {

namespace {

// Batches have a vector at least.
int possible(std::int32_t padded, int count) { return std::clamp(count, 1, std::max(padded / padding, 1)); }

}  // namespace

int automatic_batches(std::int32_t particles, int threads, bool even, double cache) {
  // Fewer and larger batches have fewer pairs across and cost the graph less. Where work lies unevenly on two threads about three to
  // eight for each even the load out, eight from 2,048 spheres each on, where a task is long against what the graph takes for it. More
  // threads have two each, so that what one waits for is done while it does the other, or as many more as have 2,048 spheres, up to
  // eight; one where two would be small. None has more than 20,000: larger ones were no faster. Beds that no cache holds are run batch
  // by batch in an order of their own, which needs small ones [core/task_order.h, docs/decisions.md].
  threads = std::max(1, threads);
  constexpr int least = 256;
  const int largest = particles > particles_in(cache) ? 2048 : 20000, each = std::max(1, (particles + threads * largest - 1) / (threads * largest));
  int count = threads * each;
  if (threads > 2)
    count = threads * std::max(each, particles < 2 * least * threads ? 1 : std::clamp(particles / 2048 / threads, 2, 8));
  else if (threads == 2 && !even)
    count = std::max(count, std::clamp(particles / 2048, 6, 16));
  return std::clamp(count, 1, std::max(1, particles / least));
}

std::int64_t work_of(const std::vector<Batch>& batches) {
  std::int64_t work = 0;
  for (const Batch& b : batches) work += work_of(b);
  return work;
}

int batches_of(std::int32_t padded, int size) {
  // What rounding leaves for one batch is at most half as much again.
  return static_cast<int>(std::lround(static_cast<double>(padded) / std::min(size, most_spheres_of_batch / 2)));
}

bool work_is_even(const std::vector<Batch>& batches, int parts) {
  std::int64_t spheres = 0;
  for (const Batch& b : batches) spheres += b.count;
  if (parts < 1 || spheres < parts) return false;
  // Work of equal stretches of the curve, spread evenly within each batch.
  double of_part = 0.0, most = 0.0;
  std::int64_t at = 0, part = 1;
  for (const Batch& b : batches) {
    for (std::int64_t left = b.count; left > 0;) {
      const std::int64_t end = spheres * part / parts, taken = std::min(left, end - at);
      of_part += static_cast<double>(taken) * (1.0 + static_cast<double>(b.used) / static_cast<double>(b.count));
      left -= taken, at += taken;
      if (at == end) most = std::max(most, of_part), of_part = 0.0, ++part;
    }
  }
  return most < 1.05 * static_cast<double>(work_of(batches)) / parts;
}

Cuts equal_cuts(std::int32_t padded, int count) {
  count = possible(padded, count);
  const std::int64_t vectors = padded / padding;
  Cuts cuts;
  for (int k = 0; k <= count; ++k) cuts.push_back(static_cast<std::int32_t>(vectors * k / count) * padding);
  return cuts;
}

Cuts cuts_of_equal_work(const std::vector<Batch>& batches, std::int32_t padded, int count) {
  count = possible(padded, count);
  const double all = static_cast<double>(work_of(batches));
  Cuts cuts = {0};
  std::size_t at = 0;
  double before = 0.0;  // work of the batches before that one
  for (int k = 1; k < count; ++k) {
    const double wanted = all * k / count;
    for (; at + 1 < batches.size() && before + static_cast<double>(work_of(batches[at])) < wanted; ++at) before += static_cast<double>(work_of(batches[at]));
    // Within a batch work is taken to lie evenly.
    const Batch& b = batches[at];
    const double share = (wanted - before) / static_cast<double>(std::max<std::int64_t>(work_of(b), 1));
    const auto place = padding * std::lround((b.first + share * b.count) / padding);
    // None is empty.
    cuts.push_back(static_cast<std::int32_t>(std::clamp<std::int64_t>(place, cuts.back() + padding, padded - std::int64_t{count - k} * padding)));
  }
  cuts.push_back(padded);
  return cuts;
}

}  // namespace platen
