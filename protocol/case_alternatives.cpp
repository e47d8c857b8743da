#include "protocol/case_alternatives.h"

#include <array>

#include <fmt/format.h>

#include "protocol/scaling.h"

namespace platen {
namespace {

// The radius that the data are worked out for: the one they name, else the one radius of the case; or a problem.
bool one_radius(TableReader& law, TableReader& data, std::string_view key, const ParticleSpec& particles, double& R) {
  if (data.has("radius")) return data.quantity("radius", Quantity::length, positive, Need::required, R);
  R = particles.sizes.radius;
  if (particles.sizes.kind == SizeDistribution::Kind::mono && R > 0.0) return true;
  law.error(key,
            "is given by material data, which needs a radius; allowed: spheres of one radius, or `radius` beside the data: the radius that "
            "the number, which is the same for every pair, is worked out for");
  return false;
}

std::string where(TableReader& data, double R) { return data.has("radius") ? fmt::format(", R = {:g} mm", 1e3 * R) : ""; }

}  // namespace

bool is_table(TableReader& table, std::string_view key) {
  const CaseEntry* const entry = table.entry(key);
  return entry != nullptr && entry->value.type == CaseValue::Type::table;
}

bool read_stiffness_alternative(TableReader& law, std::string_view key, const ParticleSpec& particles, double exponent,
                                double& out, std::string& formula) {
  TableReader data = law.table(key);
  double E = 0.0, nu = 0.0, V = 0.0, R = 0.0;
  bool good = data.quantity("young_modulus", Quantity::stress, positive, Need::required, E);
  const bool impact = data.has("impact_speed"), plane = data.has("poisson_ratio");
  if (impact) good &= data.quantity("impact_speed", Quantity::speed, positive, Need::required, V);
  if (impact || plane) {
    good &= data.number("poisson_ratio", Range{-1.0, 0.5, false, true}, Need::required, nu);
  }
  const bool sized = one_radius(law, data, key, particles, R);
  data.refuse_unknown("a stiffness by material data");
  if (exponent != 1.0) {
    law.error(key, "is given by material data, which needs exponent 1; allowed: a plain number in N/m^n");
    return false;
  }
  if (!sized || !good) return false;
  if (impact && !(particles.density > 0.0)) {
    law.error(key,
              "is given by an impact speed, which needs particles.density; allowed: leave impact_speed out");
    return false;
  }
  out = impact  ? stiffness_of_impact(R, particles.density, E, nu, V)
        : plane ? stiffness_of_contact(R, E, nu)
                : stiffness_of_modulus(R, E);
  formula = impact  ? "16/15 sqrt(R*) E* (15 m* V^2 / (16 sqrt(R*) E*))^(1/5) [Thakur2016, Eq. 12, 13]"
            : plane ? "2 E* R* [Thakur2016, Eq. 14]"
                    : "pi R E / 2 [Thakur2016, Eq. 15]";
  formula += where(data, R);
  return true;
}

bool read_f0_alternative(TableReader& law, std::string_view key, const ParticleSpec& particles, double gravity, double& out, std::string& formula) {
  TableReader data = law.table(key);
  const std::array sources{"surface_energy", "hamaker_constant", "tensile_strength", "bond_number"};
  int given = 0;
  for (const char* source : sources) given += data.has(source) ? 1 : 0;
  double R = 0.0;
  bool good = one_radius(law, data, key, particles, R);
  if (given != 1) {
    law.error(
        key,
        "says not where it comes from; allowed: exactly one of surface_energy, hamaker_constant, tensile_strength, "
        "bond_number, or a number");
    good = false;
  }
  if (data.has("surface_energy")) {
    // J/m2 is N/m.
    double gamma = 0.0, flattening = 2.0;
    std::size_t model = 0;
    good &= data.quantity("surface_energy", Quantity::stiffness, positive, Need::required, gamma);
    good &= data.word("model", {"dmt", "jkr", "plastic_jkr"}, Need::required, model);
    if (data.has("flattening")) good &= data.number("flattening", Range{1.0, infinite}, Need::optional, flattening);
    if (good && data.has("flattening") && model != 2) {
      data.error("flattening", "has no part in this model; allowed: with model = \"plastic_jkr\"");
      good = false;
    }
    if (good)
      out = f0_of_surface_energy(
          R, gamma, std::array{AdhesionModel::dmt, AdhesionModel::jkr, AdhesionModel::plastic_jkr}[model], flattening);
    formula = std::array{"-4 pi gamma R* [Thakur2016, Eq. 16]", "-3 pi gamma R* [Thakur2016, Eq. 17]",
                         "-3 pi gamma R* flattening [Thakur2016, Eq. 18]"}[model];
  } else if (data.has("hamaker_constant")) {
    double A = 0.0, z0 = 0.0;
    good &= data.number("hamaker_constant", positive, Need::required, A, "the Hamaker constant is a plain number in J");
    good &= data.quantity("distance", Quantity::length, positive, Need::required, z0);
    if (good) out = f0_of_hamaker(R, A, z0);
    formula = "-A R* / (6 z0^2) [Thakur2016, Eq. 19]";
  } else if (data.has("tensile_strength")) {
    double sigma_t = 0.0, phi = 0.0, CN = 0.0;
    good &= data.quantity("tensile_strength", Quantity::stress, positive, Need::required, sigma_t);
    good &= data.number("solid_fraction", fraction, Need::required, phi);
    good &= data.number("coordination_number", positive, Need::required, CN);
    if (good) out = f0_of_tensile_strength(R, sigma_t, phi, CN);
    formula = "-4 pi R^2 sigma_t / (phi CN) [Thakur2016, Eq. 20, 21]";
  } else if (data.has("bond_number")) {
    double Bo = 0.0;
    good &= data.number("bond_number", positive, Need::required, Bo);
    if (!(particles.density > 0.0) || !(gravity > 0.0)) {
      law.error(key, "is given by a Bond number, which needs particles.density and environment.gravity; allowed: both above 0");
      good = false;
    }
    if (good) out = f0_of_bond_number(R, Bo, particles.density, gravity);
    formula = "-Bo 4/3 pi R^3 rho g [Thakur2016, Eq. 22]";
  }
  formula += where(data, R);
  data.refuse_unknown("f0 by material data");
  return good;
}

}  // namespace platen
