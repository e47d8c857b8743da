// Stages that move the top plate or take the sides away: compress, unload, hold, release, crush.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "protocol/stages.h"

namespace platen {

// -------------------------------------------------------------------------------------------------- compress, unload

void PressStage::begin(Stand& stand) {
  Simulation& sim = stand.sim;
  PlaneMotion top;
  top.origin = sim.plane_position(plate_top);
  if (stand.spec.start_gap && direction < 0.0) {
    const Measures m = sim.measure(false);
    // An unloaded plate is put right above the bed instead of driving there through empty space.
    if (!m.top_touches) top.origin = m.highest_point + *stand.spec.start_gap;
  }
  top.velocity = direction * stand.spec.speed;
  sim.set_plane(plate_top, top);
  start_position = top.origin;
  // Load steps of one bed have one strain: the first compression's zero stays, unless a later one names its own.
  const bool goes_on = stand.spec.kind == StageKind::compress && !stand.spec.own_strain_zero;
  if (direction < 0.0 && !goes_on) stand.strain_zero_height.reset();
}

void PressStage::update(Stand& stand, const Look& look) {
  if (direction < 0.0 && !stand.strain_zero_height && look.m.stress_top >= stand.spec.strain_zero && look.m.top_touches)
    stand.strain_zero_height = look.m.height;
}

std::optional<std::string> PressStage::done(Stand& stand, const Look& look) {
  const Until& until = stand.spec.until;
  const double down = -direction;  // 1 while pressing: goals are reached from below, from above while unloading
  if (until.stress && down * (look.m.stress_top - *until.stress) >= 0.0)
    return down > 0.0 ? fmt::format("stress {} reached", pretty(*until.stress, "Pa"))
                      : fmt::format("unloaded to {}", pretty(*until.stress, "Pa"));
  if (until.strain && down * (look.strain - *until.strain) >= 0.0) return fmt::format("strain {:.4g} % reached", 100.0 * *until.strain);
  if (until.porosity && down * (*until.porosity - look.m.porosity) >= 0.0)
    return fmt::format("porosity {:.4g} reached", *until.porosity);
  return std::nullopt;
}

std::optional<std::int64_t> PressStage::last_step(const Stand& stand) const {
  const Until& until = stand.spec.until;
  std::optional<std::int64_t> last;
  const auto at = [&](double seconds) {
    const std::int64_t step = stand.step_at(seconds);
    last = last ? std::min(*last, step) : step;
  };
  if (until.duration) at(*until.duration);
  if (until.displacement) at(*until.displacement / stand.spec.speed);
  return last;
}

void PressStage::end(Stand& stand, StageResult&) {
  // The plate rests between stages; its new velocity reaches the dashpots with the next stage's first forces.
  PlaneMotion top;
  top.origin = stand.sim.plane_position(plate_top);
  stand.sim.set_plane(plate_top, top);
}

// -------------------------------------------------------------------------------------------------------------- hold

namespace {

// The stiffest that a bed can be: every contact on the k2 branch, at an overlap of 5 % of R.
double stiffest_bed(const PairLaw& law, double R) {
  const double k2 = law.exponent == 1.0 ? law.k2 : law.exponent * law.k2 * std::pow(0.05 * R, law.exponent - 1.0);
  return k2 / (4.0 * R);
}

constexpr double servo_time = 0.02;     // [s] in which an error falls to 1/e
constexpr double servo_window = 5e-3;   // [s] over which the bed's answer is averaged
constexpr double servo_speed = 0.05;    // [m/s] at most

}  // namespace

void HoldStage::begin(Stand& stand) {
  modulus = stiffest_bed(stand.c.particles.law, stand.sim.largest_radius());
  window_begin = stand.first_time;
  PlaneMotion top;
  top.origin = stand.sim.plane_position(plate_top);
  stand.sim.set_plane(plate_top, top);
}

// The plate moves by what the bed needs to reach the stress within servo_time. How stiff the bed is, it shows itself: far
// stiffer when it is relieved than when it is pressed on. Taken as stiff at first, so that the plate starts gently.
void HoldStage::update(Stand& stand, const Look& look) {
  const PairLaw& law = stand.c.particles.law;
  stress_sum += look.m.stress_top, height_sum += look.m.height, ++looks;
  if (look.m.time >= window_begin + servo_window) {
    const double stress = stress_sum / looks, height = height_sum / looks;
    const double more = stress - stress_before, strain = (height_before - height) / height;
    // Smaller answers are noise.
    if (std::fabs(more) > 1e-3 * stand.spec.stress && strain != 0.0) {
      const double highest = stiffest_bed(law, stand.sim.largest_radius()), lowest = 0.1 * highest * law.k1 / law.k2;
      modulus = std::sqrt(modulus * std::clamp(more / strain, lowest, highest));
    }
    stress_before = stress, height_before = height;
    stress_sum = height_sum = 0.0, looks = 0, window_begin = look.m.time;
  }
  const double error = stand.spec.stress - look.m.stress_top;
  const double velocity = std::clamp(-error * look.m.height / modulus / servo_time, -servo_speed, servo_speed);
  stand.sim.set_plane_velocity(plate_top, velocity);
}

std::optional<std::int64_t> HoldStage::last_step(const Stand& stand) const { return stand.step_at(*stand.spec.duration); }

void HoldStage::end(Stand& stand, StageResult& result) { PressStage{}.end(stand, result); }

// ----------------------------------------------------------------------------------------------------------- release

namespace {
// Of the highest sphere above the bottom [m]; by places alone, so that no forces are found on the way.
double height_of_bed(const Simulation& sim) {
  const Particles& p = sim.state();
  double highest = 0.0;
  for (std::int32_t k = 0; k < p.count; ++k) highest = std::max(highest, p.z[static_cast<std::size_t>(k)] + p.radius_of(k));
  return highest - (sim.plane(plate_bottom).present ? sim.plane_position(plate_bottom) : 0.0);
}
}  // namespace

void ReleaseStage::begin(Stand& stand) {
  Simulation& sim = stand.sim;
  height_before = height_of_bed(sim);
  for (int wall : {wall_x_low, wall_x_high, wall_y_low, wall_y_high})
    if (sim.plane(wall).present) sim.remove_plane(wall);
  if (sim.plane(plate_top).present) {
    PlaneMotion top;
    top.origin = sim.plane_position(plate_top) + 1e-3;
    sim.remove_plane(plate_top);  // what its contacts hold is removed energy, should it still be loaded
    sim.set_plane(plate_top, top);
  }
  sim.open_sides();
  rest.begin(stand);
}

// A sample that stands a little lower has settled.
void ReleaseStage::end(Stand& stand, StageResult& result) {
  const double height = height_of_bed(stand.sim);
  if (height < standing * height_before)
    result.warnings.push_back(fmt::format("the sample fell over or to pieces: {} high with its sides, {} without; a strength found later is not its own; a wider box or more cohesion helps", pretty(height_before, "m"), pretty(height, "m")));
}

// ------------------------------------------------------------------------------------------------------------- crush

namespace {
constexpr double smoothing = 5e-3;    // [s] over which the stress is averaged for peak and drop
constexpr double drop_strain = 0.02;  // the stress must stay low for this much strain
constexpr double stiffness_strain = 0.005;
}  // namespace

void CrushStage::begin(Stand& stand) { press.begin(stand); }

void CrushStage::update(Stand& stand, const Look& look) {
  press.update(stand, look);
  if (!stand.strain_zero_height) return;
  curve.push_back({look.m.time, 1.0 - look.m.height / *stand.strain_zero_height, look.m.stress_top});
  window_sum += look.m.stress_top;
  while (curve[window_begin].time < look.m.time - smoothing) window_sum -= curve[window_begin++].stress;
  const double mean = window_sum / static_cast<double>(curve.size() - window_begin);
  smooth.push_back(mean);
  const double strain = curve.back().strain;
  if (mean > peak) peak = mean, peak_strain = strain;
  if (!stand.spec.until.drop || peak < least_peak_of_drop * stand.spec.strain_zero) return;
  if (mean >= (1.0 - *stand.spec.until.drop) * peak)
    low_since = std::numeric_limits<double>::quiet_NaN();
  else if (std::isnan(low_since))
    low_since = strain;
  dropped = strain - low_since >= drop_strain;
}

std::optional<std::string> CrushStage::done(Stand& stand, const Look& look) {
  if (dropped)
    return fmt::format("stress {:.3g} % below the peak for {:.3g} % strain", 100.0 * *stand.spec.until.drop, 100.0 * drop_strain);
  return press.done(stand, look);
}

void CrushStage::end(Stand& stand, StageResult& result) {
  press.end(stand, result);
  if (curve.empty() || !(peak > 0.0)) return;
  result.strength = peak;
  result.strength_strain = peak_strain;
  // A peak: the bed went on for at least half a percent beyond it and carried clearly less.
  result.peak_found = dropped || (curve.back().strain - peak_strain >= 0.005 && smooth.back() < 0.95 * peak);
  // Largest slope over windows of 0.5 % strain, below half the peak on the way up.
  double largest = 0.0;
  std::size_t a = 0;
  for (std::size_t b = 0; b < curve.size() && curve[b].strain <= peak_strain; ++b) {
    if (smooth[b] > 0.5 * peak) break;
    while (a + 1 < b && curve[b].strain - curve[a + 1].strain >= stiffness_strain) ++a;
    const double width = curve[b].strain - curve[a].strain;
    if (width >= stiffness_strain) largest = std::max(largest, (smooth[b] - smooth[a]) / width);
  }
  if (largest > 0.0) result.initial_stiffness = largest;
}

}  // namespace platen
