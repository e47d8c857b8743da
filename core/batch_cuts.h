// Into how many batches a bed is cut, and where.
#pragma once

#include <cstdint>
#include <vector>

#include "core/batches.h"

namespace platen {

// About as many particles, with their contacts, as fit into twice the bytes of a cache that one counts on [core/third_cache.h].
constexpr double particles_in(double cache) { return cache / 210.0; }

// Batches where nothing else is asked for: enough for all threads, none too small to be worth a task.
// `even`: equal stretches of the Morton curve are equal work; of interest to two threads only. `cache`: bytes that one counts on.
int automatic_batches(std::int32_t particles, int threads, bool even, double cache);
// Batches of about so many particles each, none of more than most_spheres_of_batch.
int batches_of(std::int32_t padded, int size);

// What a step has to do for a batch, about: a pair costs about as much as a sphere.
inline std::int64_t work_of(const Batch& b) { return std::int64_t{b.count} + b.used; }
std::int64_t work_of(const std::vector<Batch>& batches);

// Whether `parts` equal stretches of the curve are, to 5 %, equal work. False where nothing is known yet.
bool work_is_even(const std::vector<Batch>& batches, int parts);

// First particle of each batch, and one past the last one of all; whole vectors. Fewer than `count` where there are fewer vectors.
using Cuts = std::vector<std::int32_t>;
Cuts equal_cuts(std::int32_t padded, int count);
// Of equal work, as far as these batches of the same particles, cut elsewhere, tell.
Cuts cuts_of_equal_work(const std::vector<Batch>& batches, std::int32_t padded, int count);

}  // namespace platen
