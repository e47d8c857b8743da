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

void Quicker::next_block() {
  runs_ = 0;
  if (++blocks_ < blocks_of_trial) {
    way_ = 1 - way_;
    return;
  }
  way_ = median(times_[1]) < median(times_[0]) ? 1 : 0;
  trying_ = false;
}

}  // namespace platen
