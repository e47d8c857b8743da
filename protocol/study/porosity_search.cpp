#include "protocol/study/porosity_search.h"

#include <algorithm>
#include <cmath>

namespace platen {
namespace {

// A side of the bracket: a tried setting, or one step beyond the range.
struct Side {
  std::int64_t knob = 0;
  bool tried = false;
  std::optional<double> porosity{};
};

std::int64_t setting_at(double ln_knob) {
  return std::llround(std::exp(std::min(ln_knob, 40.0)));  // e^40 is above every range and still a whole number
}

std::int64_t between(const Side& low, const Side& high, const PorosityKnob& knob, const PorosityAim& aim,
                     std::size_t tries) {
  const std::int64_t first = low.knob + 1, last = high.knob - 1;
  if (low.porosity && high.porosity) {
    const double straight = (aim.porosity - *low.porosity) / (*high.porosity - *low.porosity);
    // The middle now and then: along a bent curve straight lines come near from one side only.
    const double part = tries % 3 == 1 ? 0.5 : std::clamp(straight, 0.1, 0.9);
    const double a = std::log(static_cast<double>(low.knob)), b = std::log(static_cast<double>(high.knob));
    return std::clamp(setting_at(a + part * (b - a)), first, last);
  }
  const bool open = (low.porosity && !high.tried) || (high.porosity && !low.tried);
  if (open) {
    const Side& known = low.porosity ? low : high;
    const double far = std::pow(2.0, static_cast<double>(tries)) * (aim.porosity - *known.porosity) / knob.slope;
    return std::clamp(setting_at(std::log(static_cast<double>(known.knob)) + far), first, last);
  }
  const double middle = 0.5 * (std::log(static_cast<double>(first)) + std::log(static_cast<double>(last)));
  return std::clamp(setting_at(middle), first, last);
}

}  // namespace

SearchStep next_step(const PorosityKnob& knob, const PorosityAim& aim, const std::vector<PorosityTry>& tries) {
  if (tries.empty()) return {SearchStep::Kind::attempt, knob.start};
  Side low{knob.low - 1}, high{knob.high + 1};
  SearchStep nearest{SearchStep::Kind::not_met, 0};
  double distance = 0.0;
  for (const PorosityTry& one : tries) {
    const double off = one.porosity ? *one.porosity - aim.porosity : 0.0;
    if (one.porosity && (nearest.knob == 0 || std::abs(off) < distance)) {
      nearest.knob = one.knob;
      distance = std::abs(off);
    }
    const bool too_loose = one.porosity && off > 0.0;
    (too_loose == (knob.slope > 0.0) ? high : low) = {one.knob, true, one.porosity};
  }
  if (nearest.knob != 0 && distance <= aim.tolerance) return {SearchStep::Kind::met, nearest.knob};
  const bool room = high.knob - low.knob > 1;
  if (!room && !(low.tried && high.tried)) return {SearchStep::Kind::out_of_range, nearest.knob};
  if (!room || static_cast<int>(tries.size()) >= aim.most_tries) return nearest;
  return {SearchStep::Kind::attempt, between(low, high, knob, aim, tries.size())};
}

}  // namespace platen
