#include "protocol/study/settled_sample.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "protocol/output/results_h5.h"

namespace platen {

const StageSpec* settled_stage(const Case& c) {
  const auto compress = std::find_if(c.stages.begin(), c.stages.end(),
                                     [](const StageSpec& stage) { return stage.kind == StageKind::compress; });
  return compress == c.stages.begin() || compress == c.stages.end() ? nullptr : &*(compress - 1);
}

std::optional<double> settled_porosity(const Hdf5Group& results, const Case& c) {
  const StageSpec* const stage = settled_stage(c);
  if (stage == nullptr || !results.has("profiles") || !results.has("stages")) return std::nullopt;
  const std::string name = stage_group_name(stage->name);
  const Hdf5Group stages = results.group("stages"), profiles = results.group("profiles");
  if (!stages.has(name) || stages.integer_attribute(name, "reached", 0) == 0 || !profiles.has(name)) return std::nullopt;
  const std::vector<double> slabs = profiles.group(name).read<double>("porosity");
  if (slabs.size() < 3) return std::nullopt;
  const double porosity =
      std::accumulate(slabs.begin() + 1, slabs.end() - 1, 0.0) / static_cast<double>(slabs.size() - 2);
  return std::isfinite(porosity) ? std::optional(porosity) : std::nullopt;
}

}  // namespace platen
