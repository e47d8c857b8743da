// What another batch holds of a batch's spheres is added to their sums.
#pragma once

#include "kernels/real.h"
#include "kernels/views.h"

namespace platen {

template <class I>
void merge_kernel(const SharesBatch& b) noexcept {
  for (std::int32_t k = 0; k < b.count; ++k) {
    double* sum = b.sum + record_size * static_cast<std::int64_t>(b.particle[k] - b.first);
    I::store_record(sum, I::add(I::load_record(sum), I::load_record(b.shares + record_size * static_cast<std::int64_t>(k))));
  }
}

}  // namespace platen
