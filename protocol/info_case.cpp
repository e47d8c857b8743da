#include "protocol/info_case.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

namespace platen {

namespace {

using Json = nlohmann::ordered_json;

// What a stage does and when it ends, in a few words.
std::string plan(const StageSpec& s) {
  std::string text;
  const auto add = [&](const std::string& part) { text += (text.empty() ? "" : ", ") + part; };
  switch (s.kind) {
    case StageKind::fill:
      add(s.method == FillMethod::rain ? fmt::format("rain at {:g} m/s", s.drop_speed) : "growth");
      if (s.outlet) add(fmt::format("from {:g} mm", 1e3 * *s.outlet));
      break;
    case StageKind::vibrate: add(fmt::format("{:g} Hz, {:g} mm", s.frequency, 1e3 * s.amplitude)); break;
    case StageKind::hold: add(fmt::format("{:g} kPa", 1e-3 * s.stress)); break;
    default: break;
  }
  if (s.speed > 0.0) add(fmt::format("{:g} mm/s", 1e3 * s.speed));
  if (s.kind == StageKind::settle || s.kind == StageKind::release) {
    add(fmt::format("until kinetic/potential < {:g} over {:g} s", s.until.kinetic_to_potential, s.until.window));
    return text;
  }
  const Until& u = s.until;
  if (u.stress) add(fmt::format("until {:g} kPa", 1e-3 * *u.stress));
  if (u.strain) add(fmt::format("until strain {:g} %", 1e2 * *u.strain));
  if (u.porosity) add(fmt::format("until porosity {:g}", *u.porosity));
  if (s.porosity) add(fmt::format("to porosity {:g}", *s.porosity));
  if (u.displacement) add(fmt::format("until {:g} mm moved", 1e3 * *u.displacement));
  if (u.drop) add(fmt::format("until {:g} % below the peak", 1e2 * *u.drop));
  if (u.duration) add(fmt::format("until {:g} s passed", *u.duration));
  if (s.duration) add(fmt::format("for {:g} s", *s.duration));
  return text;
}

std::string sizes(const SizeDistribution& d) {
  if (d.kind == SizeDistribution::Kind::mono) return fmt::format("radius {:g} mm", 1e3 * d.radius);
  return fmt::format("radii {:g} to {:g} mm", 1e3 * d.smallest(), 1e3 * d.largest());
}

// Where the spheres come from: a file is the whole truth about their number and sizes.
std::string spheres(const ParticleSpec& p) {
  if (!p.file.empty())
    return fmt::format("{} from {}", p.table ? std::to_string(p.table->size()) + " spheres" : "spheres", p.file);
  return fmt::format("{} spheres, {}, {:g} kg/m3", p.count, sizes(p.sizes), p.density);
}

std::string plates(const PlateSpec& p) {
  if (p.top && p.bottom) return "top and bottom";
  return p.top ? "top only" : p.bottom ? "bottom only" : "none";
}

}  // namespace

std::string case_text_summary(const Case& c) {
  const PairLaw& law = c.particles.law;
  std::string text = fmt::format("case       {}\nseed       {}\nparticles  {}\n", c.title, c.seed, spheres(c.particles));
  text += fmt::format("law        n = {:g}, k1 = {:g}, k2 = {:g}, k_adh = {:g} N/m^n, f0 = {:g} N\n", law.exponent, law.k1,
                      law.k2, law.k_adh, law.f0);
  text += fmt::format("           restitution {:g}, friction {:g}, rolling friction {:g}\n", law.restitution, law.friction,
                      law.rolling_friction);
  text += fmt::format("plates     {}\n", plates(c.plates));
  if (c.box.given)
    text += fmt::format("box        {:g} x {:g} x {:g} mm, sides {}\n", 1e3 * c.box.width, 1e3 * c.box.depth,
                        1e3 * c.box.height, to_string(c.box.sides));
  text += fmt::format("gravity    {:g} m/s2\n", c.gravity);
  text += c.time.step ? fmt::format("time step  {:g} s\n", *c.time.step)
                      : fmt::format("time step  auto, safety {:g}\n", c.time.safety);
  text += "stages\n";
  for (std::size_t i = 0; i < c.stages.size(); ++i) {
    const StageSpec& s = c.stages[i];
    const std::string name = s.name == to_string(s.kind) ? s.name : s.name + " (" + to_string(s.kind) + ")";
    text += fmt::format("  {:>2}  {:<20}  {}", i + 1, name, plan(s));
    text.erase(text.find_last_not_of(' ') + 1);
    text += '\n';
  }
  return text;
}

nlohmann::ordered_json case_json_summary(const Case& c) {
  const PairLaw& law = c.particles.law;
  Json particles = Json::object();
  if (!c.particles.file.empty()) {
    particles["file"] = c.particles.file;
    if (c.particles.table) particles["count"] = c.particles.table->size();
  } else {
    particles = {{"count", c.particles.count},
                 {"smallest_radius", c.particles.sizes.smallest()},
                 {"largest_radius", c.particles.sizes.largest()},
                 {"density", c.particles.density}};
  }
  Json result = {{"kind", "case"}, {"title", c.title}, {"seed", c.seed}, {"particles", particles}};
  result["law"] = {{"exponent", law.exponent},       {"k1", law.k1},
                   {"k2", law.k2},                   {"k_adh", law.k_adh},
                   {"f0", law.f0},                   {"restitution", law.restitution},
                   {"friction", law.friction},       {"rolling_friction", law.rolling_friction},
                   {"tangential_ratio", law.tangential_ratio}};
  result["plates"] = {{"top", c.plates.top}, {"bottom", c.plates.bottom}};
  if (c.box.given)
    result["box"] = {{"width", c.box.width},
                     {"depth", c.box.depth},
                     {"height", c.box.height},
                     {"sides", to_string(c.box.sides)}};
  result["gravity"] = c.gravity;
  if (c.time.step) result["time_step"] = *c.time.step;
  else result["time_step"] = "auto";
  result["stages"] = Json::array();
  for (const StageSpec& s : c.stages)
    result["stages"].push_back({{"name", s.name}, {"kind", to_string(s.kind)}, {"plan", plan(s)}});
  return result;
}

}  // namespace platen
