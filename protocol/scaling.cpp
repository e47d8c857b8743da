#include "protocol/scaling.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "protocol/case_document.h"

namespace platen {
namespace {

constexpr double pi = std::numbers::pi;

// z of the dashpot, beta_n = sqrt(4 m* k1 z); 0 at e = 1.
double damping_of(double e) {
  if (e >= 1.0) return 0.0;
  const double q = pi / std::log(e);
  return 1.0 / (1.0 + q * q);
}

double restitution_of(double z) { return std::exp(-pi * std::sqrt(z / (1.0 - z))); }

void set(std::vector<std::string>& out, const char* key, double value) {
  out.push_back(std::string(key) + "=" + toml_number(value));
}

void scale_sizes(const SizeDistribution& sizes, double lambda, std::vector<std::string>& out) {
  using Kind = SizeDistribution::Kind;
  if (sizes.kind == Kind::mono) return set(out, "particles.radius", sizes.radius * lambda);
  if (sizes.kind == Kind::list || sizes.kind == Kind::cumulative) {
    std::string radii;
    for (const double R : sizes.radii) radii += (radii.empty() ? "" : ", ") + toml_number(R * lambda);
    out.push_back("particles.sizes.radii=[" + radii + "]");
    return;
  }
  set(out, "particles.sizes.min", sizes.min * lambda);
  set(out, "particles.sizes.max", sizes.max * lambda);
  if (sizes.kind == Kind::lognormal) set(out, "particles.sizes.median", sizes.median * lambda);
  if (sizes.kind == Kind::normal) {
    // The case may call it mean or median: the whole table in one go.
    out.resize(out.size() - 2);
    out.push_back(fmt::format("particles.sizes={{ kind = \"normal\", basis = \"{}\", mean = {}, sigma = {}, min = {}, max = {} }}",
                              sizes.basis == SizeDistribution::Basis::volume ? "volume" : "number", toml_number(sizes.median * lambda), toml_number(sizes.sigma * lambda),
                              toml_number(sizes.min * lambda), toml_number(sizes.max * lambda)));
  }
}

}  // namespace

std::string toml_number(double value) {
  CaseValue number;
  number.type = CaseValue::Type::real;
  number.real = value;
  return to_toml_value(number);
}

PairLaw scaled_law(const PairLaw& reference, const ScalingPowers& powers, double lambda) {
  PairLaw law = reference;
  const double stiffness = std::pow(lambda, powers.stiffness);
  law.k1 *= stiffness;
  law.k2 *= stiffness;
  law.k_adh *= stiffness;
  law.f0 *= std::pow(lambda, powers.adhesion);
  if (powers.dashpots) {
    // beta_n^2 = 4 m* K1 z, where m* ~ lambda^3 and K1 = n k1 delta^(n-1) ~ lambda^(a + n - 1) at equal delta/R.
    const double kept = 3.0 + powers.stiffness + reference.exponent - 1.0;
    const double z = damping_of(reference.restitution) * std::pow(lambda, 2.0 * *powers.dashpots - kept);
    if (!(z < 1.0))
      throw std::domain_error(
          fmt::format("dashpots ~ R^{:g} at {:g} times the reference radius need more than critical "
                      "damping (z = {:g}); allowed: z < 1",
                      *powers.dashpots, lambda, z));
    law.restitution = restitution_of(z);
  }
  return law;
}

std::int64_t scaled_count(std::int64_t reference_count, double lambda) {
  const double count = static_cast<double>(reference_count) / (lambda * lambda * lambda);
  return std::max<std::int64_t>(1, std::llround(count));
}

std::vector<std::string> scaling_overrides(const Case& base, const ScalingPowers& powers, double lambda) {
  std::vector<std::string> out;
  if (lambda == 1.0) return out;
  if (!base.particles.file.empty())
    throw std::domain_error(
        "spheres from a file cannot be scaled; allowed: a base case with radius or sizes, and fill");
  const PairLaw& before = base.particles.law;
  const PairLaw after = scaled_law(before, powers, lambda);
  scale_sizes(base.particles.sizes, lambda, out);
  out.push_back("particles.count=" + std::to_string(scaled_count(base.particles.count, lambda)));
  // Unchanged ones too: the case may give them by material data, which would be worked out for the new radius.
  set(out, "particles.law.k1", after.k1);
  set(out, "particles.law.k2", after.k2);
  set(out, "particles.law.k_adh", after.k_adh);
  set(out, "particles.law.f0", after.f0);
  if (after.restitution != before.restitution) set(out, "particles.law.restitution", after.restitution);
  if (base.time.step && powers.time_step != 0.0)
    set(out, "time.step", *base.time.step * std::pow(lambda, powers.time_step));
  return out;
}

double effective_modulus(double young_modulus, double poisson_ratio) {
  return young_modulus / (2.0 * (1.0 - poisson_ratio * poisson_ratio));
}

double stiffness_of_impact(double radius, double density, double young_modulus, double poisson_ratio, double speed) {
  const double E = effective_modulus(young_modulus, poisson_ratio);
  const double m = 0.5 * (4.0 / 3.0) * pi * radius * radius * radius * density;
  const double hertz = std::sqrt(0.5 * radius) * E;
  return 16.0 / 15.0 * hertz * std::pow(15.0 * m * speed * speed / (16.0 * hertz), 0.2);
}

double stiffness_of_contact(double radius, double young_modulus, double poisson_ratio) {
  return effective_modulus(young_modulus, poisson_ratio) * radius;
}

double stiffness_of_modulus(double radius, double young_modulus) { return 0.5 * pi * radius * young_modulus; }

double f0_of_surface_energy(double radius, double surface_energy, AdhesionModel model, double flattening) {
  const double R = 0.5 * radius;
  switch (model) {
    case AdhesionModel::dmt:
      return -4.0 * pi * surface_energy * R;
    case AdhesionModel::jkr:
      return -3.0 * pi * surface_energy * R;
    case AdhesionModel::plastic_jkr:
      return -3.0 * pi * surface_energy * R * flattening;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

double f0_of_hamaker(double radius, double hamaker_constant, double distance) {
  return -hamaker_constant * 0.5 * radius / (6.0 * distance * distance);
}

double f0_of_tensile_strength(double radius, double tensile_strength, double solid_fraction,
                              double coordination_number) {
  return -4.0 * pi * radius * radius * tensile_strength / (solid_fraction * coordination_number);
}

double bond_number(double f0, double radius, double density, double gravity) {
  return std::abs(f0) / (4.0 / 3.0 * pi * radius * radius * radius * density * gravity);
}

double f0_of_bond_number(double radius, double bond_number, double density, double gravity) {
  return -bond_number * (4.0 / 3.0 * pi * radius * radius * radius * density * gravity);
}

}  // namespace platen
