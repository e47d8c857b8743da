#include "protocol/check_command.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <numbers>

#include "kernels/kernel_table.h"
#include "protocol/experiment.h"
#include "protocol/progress.h"
#include "protocol/stages.h"
#include "protocol/usable_cores.h"

namespace platen {
namespace {

constexpr double dense_porosity = 0.40;  // the bed that a plate presses [A34]

// Measured: largest resident memory of dense beds of 8,000 and 97,000 spheres, contacts in the output [own runs].
constexpr double bytes_of_program = 20e6, bytes_of_sphere = 1700.0;

std::string why_scene(const Case& c, bool equal) {
  const PairLaw& law = c.particles.law;
  std::vector<std::string> needs;
  needs.push_back(fmt::format("n = {:g}", law.exponent));
  needs.push_back(law.k_adh > 0.0 || law.f0 != 0.0 ? "adhesion (k_adh or f0)" : "no adhesion");
  needs.push_back(law.k2 > law.k1 ? "plasticity (k2 > k1)" : "no plasticity (k2 = k1)");
  if (law.rolling_friction == 0.0) needs.push_back("no rolling friction");
  else needs.push_back(law.rolling_model == RollingModel::absolute ? "absolute rolling friction" : "relative rolling friction");
  needs.push_back(equal ? "equal spheres" : "unequal spheres");
  std::string text = "the cheapest that covers ";
  for (std::size_t k = 0; k < needs.size(); ++k) text += (k == 0 ? "" : ", ") + needs[k];
  return text;
}

std::string why_instruction_set() {
  const char* forced = std::getenv("PLATEN_ISA");
  return forced != nullptr && *forced != '\0' ? "forced by PLATEN_ISA" : "the widest that this processor has";
}

// Asked stage by stage, in order: does this compression's strain go on from an earlier one's zero [plate_stages.cpp]?
class StrainZero {
 public:
  bool goes_on(const StageSpec& s) {
    if (s.kind == StageKind::vibrate || s.kind == StageKind::release) there_ = false;  // another bed
    if (s.kind != StageKind::compress) return false;
    const bool on = there_ && !s.own_strain_zero;
    there_ = on || !s.until.stress || *s.until.stress >= s.strain_zero;
    return on;
  }

 private:
  bool there_ = false;
};

void add_inertial_numbers(const Case& c, CheckReport& report) {
  const SphereFacts& f = report.spheres;
  const double area = c.box.width * c.box.depth;
  if (!(area > 0.0)) return;
  const double height = f.solid_volume / (area * (1.0 - dense_porosity));
  StrainZero zero;
  for (const StageSpec& s : c.stages) {
    const bool goes_on = zero.goes_on(s);
    if (s.kind != StageKind::compress && s.kind != StageKind::crush) continue;
    const auto add = [&](double stress, const char* of) {
      if (!(stress > 0.0)) return;
      report.inertial.push_back(
          {s.name, stress, of, s.speed / height * 2.0 * f.radius_mean * std::sqrt(f.density / stress)});
    };
    if (!goes_on) add(s.strain_zero, "strain zero");
    if (s.until.stress) add(*s.until.stress, "target");
  }
}

void add_notes(const Case& c, CheckReport& report) {
  if (c.particles.law.exponent < 1.0)
    report.notes.push_back("exponent < 1: K1 = n k1 delta^(n-1) has no bound at delta = 0; in K1, and hence in the dashpots, "
                           "k_t and the time step, max(delta, 1e-3 R) stands for delta");
  if (c.particles.law.exponent > 1.0)
    report.notes.push_back("exponent > 1: stiffness grows with the overlap; the first time step assumes overlaps of R/10");
  if (c.time.step && report.limits.dt_limit < *c.time.step)
    report.notes.push_back("time.step is above dt_limit of a dense bed; the run goes on because of time.allow_unstable");
  // Plates are stiffer than pairs by a factor that depends on how hard they press: two was seen at 40 kPa.
  if (c.time.step && !c.time.allow_unstable && (c.plates.top || c.plates.bottom) && *c.time.step > 0.45 * report.limits.dt_limit)
    report.notes.push_back("time.step is near dt_limit of a bed without plates; spheres at a plate may have half of it, and a run looks at its own bed");
  if (const PairLaw& law = c.particles.law; law.rolling_friction == 0.0 && (law.f0 != 0.0 || law.k_adh > 0.0))
    report.notes.push_back("rolling_friction = 0 with cohesion: a sphere held between two others may spin on, and a bed take long to come to rest");
  bool sides = c.box.given && c.box.sides != Sides::open, pressed = false;
  StrainZero zero;
  for (const StageSpec& s : c.stages) {
    const bool goes_on = zero.goes_on(s);
    if (s.kind == StageKind::release) sides = false;
    // Rumpf: a contact of a dense bed carries about pi d^2 sigma / ((1 - porosity) Z); largest overlaps are some five times the mean.
    if (s.kind == StageKind::compress && s.until.stress) {
      const PairLaw& law = c.particles.law;
      const double d = 2.0 * report.spheres.radius_mean, force = std::numbers::pi * d * d * *s.until.stress / ((1.0 - dense_porosity) * 6.0);
      const double overlap = std::pow(force / law.k1, 1.0 / law.exponent) / d;
      if (overlap > 0.1)
        report.notes.push_back(fmt::format("{}: {} makes overlaps of some {:.0f} % of a diameter, several times more in places: the law is meant for small ones; stiffer spheres or less load help",
                                           s.name, pretty(*s.until.stress, "Pa"), 100.0 * overlap));
    }
    if (s.kind == StageKind::unload && s.until.stress && !pressed) report.notes.push_back(s.name + ": nothing has pressed before it, so it ends at once");
    if (s.kind == StageKind::compress && !sides) report.notes.push_back(s.name + ": there are no sides, so this is no confined compression; `crush` finds the strength of such a bed");
    pressed = pressed || s.kind == StageKind::compress || s.kind == StageKind::crush || s.kind == StageKind::hold || (s.kind == StageKind::fill && s.method == FillMethod::grow);
    if (s.kind == StageKind::crush && sides) report.notes.push_back(s.name + ": the sides are still there: its strength will not be an unconfined one; a stage `release` takes them away");
    if (s.kind == StageKind::compress && !goes_on && s.until.stress && *s.until.stress < s.strain_zero)
      report.notes.push_back(fmt::format("{}: ends at {} before strain begins to count at {} (strain_zero)", s.name, pretty(*s.until.stress, "Pa"), pretty(s.strain_zero, "Pa")));
  }
  for (std::size_t k = 0; k < report.stages.size(); ++k)
    if (const ExpectedStage& e = report.stages[k]; e.needed > e.simulated * (1.0 + 1e-9))
      report.notes.push_back(fmt::format("{}: needs about {:.3g} s; max_duration = {:.3g} s ends the run before that (exit code {})", e.name, e.needed,
                                         e.simulated, static_cast<int>(exit_goal)));
  if (const SphereFacts& f = report.spheres; f.count >= 100 && f.mass_max > 0.02 * f.mass_total)
    report.notes.push_back(fmt::format("the largest sphere holds {:.0f} % of the volume: too few spheres for so broad a distribution; more of them, or a narrower range",
                                       100.0 * f.mass_max / f.mass_total));
  for (const InertialNumber& i : report.inertial)
    if (i.value > 1e-3)
      report.notes.push_back(fmt::format("{}: inertial number {:.1e} at {} ({}): above 1e-3: not quasi-static there (below 1e-4 would be)",
                                         i.stage, i.value, pretty(i.stress, "Pa"), i.of));
}

std::string bytes_text(double bytes) {
  return bytes < 1e9 ? fmt::format("{:.0f} MB", bytes * 1e-6) : fmt::format("{:.1f} GB", bytes * 1e-9);
}

double total_wall(const std::vector<ExpectedStage>& stages) {
  double sum = 0.0;
  for (const ExpectedStage& s : stages) sum += s.wall;
  return sum;
}

}  // namespace

CheckReport check_report(const Case& c, int threads) {
  refuse_unstable_step(c);
  CheckReport report;
  report.spheres = sphere_facts(c);
  const SphereFacts& f = report.spheres;
  const FirstStep first = first_step(c);
  report.dt = first.dt, report.limits = first.limits, report.rule = first.rule;

  report.bond_number = bond_number(c, f);
  const std::optional<BedGuess> bed = guess_bed(c, f);
  if (bed) report.settled_porosity = bed->porosity, report.settled_height = bed->height;
  add_inertial_numbers(c, report);
  report.memory = bytes_of_program + bytes_of_sphere * static_cast<double>(f.count);

  // The made-up bed must not blow up, whatever step the user insists on.
  const EngineSpeed speed = measure_speed(c, f.count, f.equal, std::min(report.dt, 0.2 * first.limits.dt_limit), threads);
  report.scene = speed.scene, report.instruction_set = speed.instruction_set, report.threads = speed.threads;
  report.why_scene = why_scene(c, f.equal), report.why_instruction_set = why_instruction_set();
  report.particle_steps_per_second = speed.particle_steps_per_second;
  report.stages = expected_stages(c, bed.value_or(BedGuess{}), f.count, report.dt, speed.particle_steps_per_second);
  add_notes(c, report);
  return report;
}

std::string check_text(const Case& c, const CheckReport& r) {
  const SphereFacts& f = r.spheres;
  std::string text;
  const auto row = [&](const char* name, const std::string& value) { text += fmt::format("{:<16}{}\n", name, value); };
  row("case", c.title.empty() ? c.file.string() : c.title);
  row("spheres", f.radius_min == f.radius_max
                     ? fmt::format("{}, radius {:g} mm", f.count, 1e3 * f.radius_min)
                     : fmt::format("{}, radii {:.4g} to {:.4g} mm, mean {:.4g} mm", f.count, 1e3 * f.radius_min,
                                   1e3 * f.radius_max, 1e3 * f.radius_mean));
  if (f.volume_radii)
    row("", fmt::format("10, 50, 90 % of the volume below {:.4g}, {:.4g}, {:.4g} mm", 1e3 * (*f.volume_radii)[0], 1e3 * (*f.volume_radii)[1],
                        1e3 * (*f.volume_radii)[2]));
  row("mass", f.mass_min == f.mass_max
                  ? fmt::format("{:.4g} kg together, {:.4g} kg each", f.mass_total, f.mass_min)
                  : fmt::format("{:.4g} kg together, {:.4g} to {:.4g} kg each", f.mass_total, f.mass_min, f.mass_max));
  row("solid volume", fmt::format("{:.4g} m3", f.solid_volume));
  if (r.settled_height)
    row("settled bed", fmt::format("about {:.3g} mm high, porosity {:.2f}", 1e3 * *r.settled_height, *r.settled_porosity));
  row("time step", fmt::format("{:.4g} s, {}", r.dt, r.rule));
  row("  dt_crit", fmt::format("{:.4g} s (springs alone; step is {:.0f} % of it)", r.limits.dt_crit, 100.0 * r.dt / r.limits.dt_crit));
  row("  dt_limit", fmt::format("{:.4g} s (with dashpots; step is {:.0f} % of it)", r.limits.dt_limit, 100.0 * r.dt / r.limits.dt_limit));
  text += fmt::format("{:<16}both of a dense bed of the smallest spheres{}\n", "",
                      c.time.step ? "" : "; the run looks at the bed that there is");
  const PairLaw& law = c.particles.law;
  const std::string unit = law.exponent == 1.0 ? "N/m" : fmt::format("N/m^{:g}", law.exponent);
  row("law", fmt::format("k1 {:.5g}, k2 {:.5g}, k_adh {:.5g}, k_t {:.5g} {}, f0 {:.4g} N", law.k1, law.k2, law.k_adh, law.tangential_ratio * law.k1, unit, law.f0));
  for (const auto& [key, formula] : c.particles.law_origins) text += fmt::format("{:<16}{} = {}\n", "", key, formula);
  if (r.bond_number) row("Bond number", fmt::format("{:.3g}  (|f0| over a sphere's weight)", *r.bond_number));
  for (const InertialNumber& i : r.inertial)
    row("inertial number", fmt::format("{:.1e}  {} at {:.3g} kPa ({})", i.value, i.stage, 1e-3 * i.stress, i.of));
  row("memory", "about " + bytes_text(r.memory));
  row("kernels", fmt::format("{}: {}", r.scene, r.why_scene));
  row("", fmt::format("{}: {}", r.instruction_set, r.why_instruction_set));
  const bool measured = r.particle_steps_per_second > 0.0;
  row("speed here", measured ? fmt::format("{:.1f} M particle-steps/s on {} thread{}", 1e-6 * r.particle_steps_per_second, r.threads, r.threads == 1 ? "" : "s")
                             : "not measured: the dense bed made up for it does not hold together with this law");
  row("expected time", measured ? "about " + duration_text(total_wall(r.stages)) : "unknown");
  for (const ExpectedStage& s : r.stages)
    text += fmt::format("  {:<22}{:>10} simulated {:>14}\n", s.name, fmt::format("{:.3g} s", s.simulated), measured ? duration_text(s.wall) : "");
  for (const std::string& note : r.notes) text += "note: " + note + '\n';
  return text;
}

std::string check_json(const Case& c, const CheckReport& r) {
  using Json = nlohmann::ordered_json;
  const SphereFacts& f = r.spheres;
  Json json = {{"kind", "check"}, {"title", c.title}};
  json["particles"] = {{"count", f.count},           {"radius_min", f.radius_min}, {"radius_max", f.radius_max},
                       {"radius_mean", f.radius_mean}, {"density", f.density},     {"mass_min", f.mass_min},
                       {"mass_max", f.mass_max},     {"mass_total", f.mass_total}, {"solid_volume", f.solid_volume}};
  if (f.volume_radii) json["particles"]["volume_radii"] = *f.volume_radii;
  json["time_step"] = {{"dt", r.dt}, {"dt_crit", r.limits.dt_crit}, {"dt_limit", r.limits.dt_limit}, {"rule", r.rule}};
  if (r.settled_height) json["settled_bed"] = {{"height", *r.settled_height}, {"porosity", *r.settled_porosity}};
  const PairLaw& law = c.particles.law;
  json["law"] = {{"k1", law.k1}, {"k2", law.k2}, {"k_adh", law.k_adh}, {"k_t", law.tangential_ratio * law.k1}, {"f0", law.f0}, {"exponent", law.exponent}};
  for (const auto& [key, formula] : c.particles.law_origins) json["law"]["from"][key] = formula;
  if (r.bond_number) json["bond_number"] = *r.bond_number;
  json["inertial_numbers"] = Json::array();
  for (const InertialNumber& i : r.inertial)
    json["inertial_numbers"].push_back({{"stage", i.stage}, {"stress", i.stress}, {"of", i.of}, {"value", i.value}});
  json["memory"] = r.memory;
  json["kernels"] = {{"scene", r.scene},
                     {"why_scene", r.why_scene},
                     {"instruction_set", r.instruction_set},
                     {"why_instruction_set", r.why_instruction_set}};
  // Numbers that are not known are null.
  const auto known = [&](double value) { return r.particle_steps_per_second > 0.0 ? Json(value) : Json(nullptr); };
  json["speed"] = {{"threads", r.threads}, {"particle_steps_per_second", known(r.particle_steps_per_second)}};
  json["stages"] = Json::array();
  for (const ExpectedStage& s : r.stages)
    json["stages"].push_back(
        {{"name", s.name}, {"kind", to_string(s.kind)}, {"simulated_seconds", s.simulated}, {"wall_seconds", known(s.wall)}});
  json["wall_seconds"] = known(total_wall(r.stages));
  json["notes"] = r.notes;
  return json.dump(2) + "\n";
}

int check_command(const CheckCommand& command) {
  const Case c = read_case(command.case_file, command.overrides);
  const CheckReport report = check_report(c, command.threads.value_or(usable_cores()));
  const std::string text = command.json ? check_json(c, report) : check_text(c, report);
  std::fwrite(text.data(), 1, text.size(), stdout);
  return exit_done;
}

}  // namespace platen
