#include "core/third_cache.h"

#include <algorithm>
#include <charconv>
#include <fstream>

namespace platen {

double ordered_cache_of(double bytes) { return bytes > 0.0 ? std::min(0.375 * bytes, most_ordered_cache) : most_ordered_cache; }

double cache_size(const std::string& text) {
  long number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc{} || number <= 0) return 0.0;
  const std::string unit(end, text.data() + text.size());
  if (unit == "K") return 1024.0 * static_cast<double>(number);
  if (unit == "M") return 1024.0 * 1024.0 * static_cast<double>(number);
  return unit.empty() ? static_cast<double>(number) : 0.0;
}

double ordered_cache() {
  // sysconf(_SC_LEVEL3_CACHE_SIZE) has that of all cores of a package together, where each few of them have one of their own.
  static const double bytes = [] {
    std::string text;
    std::ifstream("/sys/devices/system/cpu/cpu0/cache/index3/size") >> text;
    return ordered_cache_of(cache_size(text));
  }();
  return bytes;
}

}  // namespace platen
