#include "core/quicker.h"

#include <algorithm>

namespace platen {

namespace {

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

// By more than what changes from block to block with either way, as in a bed that becomes denser.
bool Quicker::clearly_quicker(int way) const {
  constexpr double clear = 0.99;
  const std::vector<double>&own = times_[way], &other = times_[1 - way];
  return *std::max_element(own.begin(), own.end()) < clear * *std::min_element(other.begin(), other.end());
}

void Quicker::next_block() {
  runs_ = 0;
  const bool both = ++blocks_ % 2 == 0, clear = both && (clearly_quicker(0) || clearly_quicker(1));
  if (blocks_ < blocks_of_trial && !clear) {
    way_ = 1 - way_;
    return;
  }
  way_ = median(times_[1]) < median(times_[0]) ? 1 : 0;
  trying_ = false;
}

}  // namespace platen
