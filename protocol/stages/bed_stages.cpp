// Stages that make a bed and bring it to rest: fill, vibrate, settle, run.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "protocol/stages.h"
#include "protocol/stages/rain.h"

namespace platen {

namespace {
// Whole steps, none of the past; more than any run makes are as good as for ever.
std::int64_t whole_steps(double steps) { return std::llround(std::clamp(steps, 0.0, 1e15)); }
}  // namespace

std::int64_t Stand::step_at(double stage_seconds) const { return dt_step + whole_steps((stage_seconds - dt_time) / sim.time_step()); }

std::int64_t Stand::step_not_before(double stage_seconds) const {
  const double steps = (stage_seconds - dt_time) / sim.time_step();
  return dt_step + whole_steps(std::ceil(steps - 1e-6));
}

std::string pretty(double value, const char* unit) {
  const double size = std::fabs(value);
  if (size >= 1e3) return fmt::format("{:.4g} k{}", value / 1e3, unit);
  if (size > 0.0 && size < 0.1) return fmt::format("{:.4g} m{}", value * 1e3, unit);
  return fmt::format("{:.4g} {}", value, unit);
}

std::string what_is_missing(const Stand& stand, const Measures& m) {
  const StageSpec& spec = stand.spec;
  const Until& until = spec.until;
  std::vector<std::string> parts;
  const bool rests = spec.kind == StageKind::settle || spec.kind == StageKind::release;
  if (rests || spec.kind == StageKind::fill) {
    if (stand.c.gravity > 0.0) {
      parts.push_back(fmt::format("kinetic over potential energy {:.2g} (wanted: {:.2g})", m.kinetic_energy / m.potential_energy, rests ? until.kinetic_to_potential : 1e-3));
      if (stand.sim.plane(plate_bottom).present)
        parts.push_back(fmt::format("bottom carries {:.1f} % of the weight (wanted: 100 within {})", 100.0 * m.support_force / m.weight, rests ? 1 : 10));
    } else {
      parts.push_back(fmt::format("kinetic energy {:.2g} J (wanted: {:.2g} of what it was)", m.kinetic_energy, until.kinetic_to_potential));
    }
    if (!rests) parts.push_back("no sphere may be faster than after a fall by its radius, all that for 50 ms");
    if (rests) parts.push_back(fmt::format("coordination number {:.2f} (may change by {:.2g} % in {})", m.coordination_number, 100.0 * until.coordination_change, pretty(until.window, "s")));
  } else {
    if (until.stress) parts.push_back(fmt::format("stress {} (wanted: {})", pretty(m.stress_top, "Pa"), pretty(*until.stress, "Pa")));
    if (until.strain && stand.strain_zero_height) parts.push_back(fmt::format("strain {:.2f} % (wanted: {:.2f})", 100.0 * (1.0 - m.height / *stand.strain_zero_height), 100.0 * *until.strain));
    if (until.strain && !stand.strain_zero_height) parts.push_back("strain has not begun to count");
    if (until.porosity) parts.push_back(fmt::format("porosity {:.3f} (wanted: {:.3f})", m.porosity, *until.porosity));
    if (until.drop) parts.push_back(fmt::format("stress {}: no drop by {:.0f} % yet of a peak above {}", pretty(m.stress_top, "Pa"), 100.0 * *until.drop, pretty(least_peak_of_drop * spec.strain_zero, "Pa")));
  }
  return fmt::format("{}", fmt::join(parts, "; "));
}

Stage make_stage(const StageSpec& spec) {
  switch (spec.kind) {
    case StageKind::fill: return FillStage{};
    case StageKind::vibrate: return VibrateStage{};
    case StageKind::settle: return SettleStage{};
    case StageKind::compress: return PressStage{-1.0};
    case StageKind::unload: return PressStage{+1.0};
    case StageKind::hold: return HoldStage{};
    case StageKind::release: return ReleaseStage{};
    case StageKind::crush: return CrushStage{};
    case StageKind::run: break;
  }
  return RunStage{};
}

// ------------------------------------------------------------------------------------------------------------- rest

void RestWatch::begin(Stand& stand) {
  samples.clear();
  kinetic_at_start = stand.sim.measure(false).kinetic_energy;
  from_rest = kinetic_at_start == 0.0;
}

std::optional<std::string> RestWatch::done(Stand& stand, const Look& look) {
  const Until& until = stand.spec.until;
  const Measures& m = look.m;
  const bool gravity = stand.c.gravity > 0.0, bottom = stand.sim.plane(plate_bottom).present;
  // Without gravity there is no potential energy to compare with, without a bottom no support.
  if (from_rest) kinetic_at_start = std::max(kinetic_at_start, m.kinetic_energy);
  const double scale = gravity ? m.potential_energy : kinetic_at_start;
  bool quiet = m.kinetic_energy <= until.kinetic_to_potential * scale;
  if (gravity && bottom) quiet = quiet && std::fabs(m.support_force - m.weight) <= 0.01 * m.weight;
  samples.push_back({m.time, m.coordination_number, quiet});
  const double begin = m.time - until.window;
  while (samples.size() > 1 && samples[1].time <= begin) samples.pop_front();
  if (samples.front().time > begin) return std::nullopt;
  double low = samples.front().coordination_number, high = low, sum = 0.0;
  for (const Sample& s : samples) {
    if (!s.quiet) return std::nullopt;
    low = std::min(low, s.coordination_number), high = std::max(high, s.coordination_number);
    sum += s.coordination_number;
  }
  if (high - low > until.coordination_change * sum / static_cast<double>(samples.size())) return std::nullopt;
  return fmt::format("at rest for {:.3g} s", until.window);
}

// ------------------------------------------------------------------------------------------------------------- fill

// The spheres are there already (make_simulation); now the rain falls, without a lid.
void FillStage::begin(Stand& stand) {
  if (stand.sim.plane(plate_top).present) stand.sim.remove_plane(plate_top);
}

void FillStage::update(Stand& stand, const Look&) {
  in_outlet = stand.spec.duration ? stand.sim.carry_down(outlet_of(stand.c), stand.spec.drop_speed) : 0;
}

std::optional<std::string> FillStage::done(Stand& stand, const Look& look) {
  if (stand.spec.method == FillMethod::grow) return "bed grown to the target porosity";
  if (!landed(stand, look.m)) {
    landed_since.reset();
    return std::nullopt;
  }
  // Throughout the time of a small bounce: a sphere at the top of one is slow, yet not landed.
  if (!landed_since) landed_since = look.m.time;
  if (look.m.time - *landed_since < 0.05) return std::nullopt;
  return "all spheres have landed";
}

// What still moves is a thousandth of the energy of position, and the bottom carries all.
bool FillStage::landed(const Stand& stand, const Measures& m) const {
  if (in_outlet > 0) return false;
  if (!(m.kinetic_energy <= 1e-3 * m.potential_energy && std::fabs(m.support_force - m.weight) <= 0.1 * m.weight)) return false;
  // In a large bed neither would notice a few late ones: none may be faster than from a fall by its own radius.
  const Particles& p = stand.sim.state();
  for (std::int32_t k = 0; k < p.count; ++k) {
    const auto a = static_cast<std::size_t>(k);
    if (p.vx[a] * p.vx[a] + p.vy[a] * p.vy[a] + p.vz[a] * p.vz[a] > 2.0 * stand.c.gravity * p.radius_of(k)) return false;
  }
  return true;
}

void FillStage::end(Stand& stand, StageResult&) {
  if (!stand.c.plates.top) return;
  PlaneMotion top;
  top.origin = std::max(stand.c.box.height, stand.sim.measure(false).highest_point + 0.1 * stand.sim.largest_radius());
  stand.sim.set_plane(plate_top, top);
}

// ---------------------------------------------------------------------------------------------------------- vibrate

void VibrateStage::begin(Stand& stand) {
  PlaneMotion bottom;
  bottom.origin = stand.sim.plane_position(plate_bottom);
  bottom.amplitude = stand.spec.amplitude, bottom.frequency = stand.spec.frequency;
  // Whole cycles: the plate comes back to where it was and rests there for what is left of the stage.
  bottom.vibration_end = std::floor(stand.spec.frequency * *stand.spec.duration * (1.0 + 1e-12)) / stand.spec.frequency;
  stand.sim.set_plane(plate_bottom, bottom);
}

std::optional<std::int64_t> VibrateStage::last_step(const Stand& stand) const { return stand.step_at(*stand.spec.duration); }

void VibrateStage::end(Stand& stand, StageResult&) {
  PlaneMotion bottom;
  bottom.origin = stand.sim.plane(plate_bottom).origin;
  stand.sim.set_plane(plate_bottom, bottom);
}

std::optional<std::int64_t> RunStage::last_step(const Stand& stand) const { return stand.step_at(*stand.spec.duration); }

}  // namespace platen
