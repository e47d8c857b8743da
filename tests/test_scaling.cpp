// Scaling laws and the formulas that reference values come from.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>
#include <vector>

#include "protocol/case_file.h"
#include "protocol/scaling.h"
#include "tests/reference_data.h"

namespace platen {
namespace {

constexpr double pi = std::numbers::pi;
constexpr double rounding = 1e-14;  // a handful of operations, each with 1.1e-16

// gtest's ratio test reads better than a tolerance of changing size.
::testing::AssertionResult same(double value, double expected, double relative = rounding) {
  return reference::close(value, expected, relative, 0.0);
}

const std::string base_text = R"(
[particles]
radius = "2.5 mm"
density = "2000 kg/m3"
count = 17213
[particles.law]
k1 = "5 kN/m"
k2 = "25 kN/m"
k_adh = "5 kN/m"
f0 = "-0.4 N"
restitution = 0.4
[box]
width = "150 mm"
depth = "50 mm"
height = "300 mm"
[time]
step = "10 us"
[[stage]]
kind = "fill"
)";

Case base_case(const std::vector<std::string>& changes = {}) { return parse_case(base_text, "base.toml", {}, changes); }

double beta_n(const PairLaw& law, double m_eff) {
  const double q = pi / std::log(law.restitution);
  return std::sqrt(4.0 * m_eff * law.k1 / (1.0 + q * q));
}

TEST(Scaling, WorkedExample) {
  const reference::Record r = reference::read_record("closed_forms", "scaling");
  PairLaw law;
  law.k1 = r.inputs.at("k1");
  law.k2 = r.inputs.at("k2");
  law.k_adh = r.inputs.at("kadh");
  law.f0 = r.inputs.at("f0");
  const double lambda = r.inputs.at("R").get<double>() / r.inputs.at("R_ref").get<double>();
  const char* names[] = {"f0_linear", "f0_quadratic", "f0_cubic"};
  for (int b = 1; b <= 3; ++b) {
    const PairLaw scaled = scaled_law(law, {.stiffness = 1.0, .adhesion = double(b)}, lambda);
    EXPECT_TRUE(reference::close(scaled.k1, r.expected.at("k1"), r.rel, r.abs));
    EXPECT_TRUE(reference::close(scaled.k2, r.expected.at("k2"), r.rel, r.abs));
    EXPECT_TRUE(reference::close(scaled.k_adh, r.expected.at("kadh"), r.rel, r.abs));
    EXPECT_TRUE(reference::close(scaled.tangential_ratio * scaled.k1, r.expected.at("kt"), r.rel, r.abs));
    EXPECT_TRUE(reference::close(scaled.f0, r.expected.at(names[b - 1]), r.rel, r.abs));
    const double masses = r.expected.at("m_ratio");
    EXPECT_TRUE(
        reference::close(beta_n(scaled, masses) / beta_n(law, 1.0), r.expected.at("beta_n_ratio"), r.rel, r.abs));
  }
}

TEST(Scaling, PowersOfTwoAreExact) {
  const Case c = base_case();
  const PairLaw law = scaled_law(c.particles.law, {.stiffness = 1.0, .adhesion = 2.0}, 2.0);
  EXPECT_EQ(law.k1, 2.0 * c.particles.law.k1);
  EXPECT_EQ(law.k2, 2.0 * c.particles.law.k2);
  EXPECT_EQ(law.k_adh, 2.0 * c.particles.law.k_adh);
  EXPECT_EQ(law.f0, 4.0 * c.particles.law.f0);
  EXPECT_EQ(law.restitution, c.particles.law.restitution);
  EXPECT_EQ(law.friction, c.particles.law.friction);
}

TEST(Scaling, DashpotsFollowTheirPower) {
  const PairLaw law = base_case().particles.law;
  for (const double lambda : {0.8, 1.2, 1.5}) {
    const PairLaw scaled = scaled_law(law, {.stiffness = 1.0, .adhesion = 2.0, .dashpots = 1.0}, lambda);
    EXPECT_TRUE(same(beta_n(scaled, lambda * lambda * lambda) / beta_n(law, 1.0), lambda, 1e-12));
    // The power that restitution 0.4 has by itself.
    EXPECT_TRUE(same(scaled_law(law, {.dashpots = 2.0}, lambda).restitution, law.restitution, 1e-12));
  }
  // z = 0.08 at e = 0.4; 10^2 times as much is more than critical.
  EXPECT_THROW(scaled_law(law, {.dashpots = 3.0}, 10.0), std::domain_error);
}

TEST(Scaling, CountsOfThePaper) {
  EXPECT_EQ(scaled_count(17213, 1.0), 17213);
  EXPECT_EQ(scaled_count(17213, 3.0 / 2.5), 9961);
  EXPECT_EQ(scaled_count(17213, 3.75 / 2.5), 5100);
  EXPECT_EQ(scaled_count(17213, 2.0 / 2.5), 33619);
  EXPECT_EQ(scaled_count(10, 100.0), 1);
}

TEST(Scaling, OverridesMakeTheScaledCase) {
  const Case base = base_case();
  EXPECT_TRUE(scaling_overrides(base, {}, 1.0).empty());
  const Case c = base_case(scaling_overrides(base, {.stiffness = 0.5, .adhesion = 3.0, .time_step = 1.0}, 1.5));
  EXPECT_EQ(c.particles.sizes.radius, 1.5 * base.particles.sizes.radius);
  EXPECT_EQ(c.particles.count, 5100);
  EXPECT_TRUE(same(c.particles.law.k1, 5e3 * std::sqrt(1.5)));
  EXPECT_TRUE(same(c.particles.law.k2, 25e3 * std::sqrt(1.5)));
  EXPECT_TRUE(same(c.particles.law.f0, -0.4 * 3.375));
  EXPECT_TRUE(same(*c.time.step, 1.5e-5));
  EXPECT_EQ(c.particles.density, base.particles.density);
}

TEST(Scaling, SizeDistributionsAreStretched) {
  const std::string normal =
      "particles.sizes={ kind = \"normal\", median = 0.003, sigma = 0.0005, min = 0.002, max = 0.004 }";
  std::string text = base_text;
  text.replace(text.find("radius = \"2.5 mm\"\n"), 18, "");
  const Case base = parse_case(text, "base.toml", {}, {normal});
  std::vector<std::string> all{normal};
  for (const std::string& change : scaling_overrides(base, {}, 2.0)) all.push_back(change);
  const Case c = parse_case(text, "base.toml", {}, all);
  EXPECT_EQ(c.particles.sizes.kind, SizeDistribution::Kind::normal);
  EXPECT_EQ(c.particles.sizes.median, 0.006);
  EXPECT_EQ(c.particles.sizes.sigma, 0.001);
  EXPECT_EQ(c.particles.sizes.min, 0.004);
  EXPECT_EQ(c.particles.sizes.max, 0.008);
}

TEST(Scaling, DistributionsOfVolumeStaySo) {
  std::string text = base_text;
  text.replace(text.find("radius = \"2.5 mm\"\n"), 18, "");
  for (const std::string sizes : {"kind = \"normal\", mean = 0.003, sigma = 0.0005, min = 0.002, max = 0.004", "kind = \"uniform\", min = 0.002, max = 0.004",
                                  "kind = \"list\", radii = [0.002, 0.004]", "kind = \"cumulative\", radii = [0.002, 0.004], below = [0, 1]"}) {
    std::vector<std::string> all{"particles.sizes={ basis = \"volume\", " + sizes + " }"};
    for (const std::string& change : scaling_overrides(parse_case(text, "base.toml", {}, all), {}, 2.0)) all.push_back(change);
    const SizeDistribution scaled = parse_case(text, "base.toml", {}, all).particles.sizes;
    EXPECT_EQ(scaled.basis, SizeDistribution::Basis::volume) << sizes;
    EXPECT_EQ(scaled.smallest(), 0.004) << sizes;
    EXPECT_EQ(scaled.largest(), 0.008) << sizes;
  }
}

// The spring that stores the energy of a Hertz impact: both sides computed from the closed form of the largest overlap.
TEST(Scaling, ImpactStiffnessStoresTheEnergyOfHertz) {
  const double R = 2.5e-3, rho = 2000.0, E = 7e7, nu = 0.3, V = 0.3;
  const double k = stiffness_of_impact(R, rho, E, nu, V);
  const double m = 0.5 * 4.0 / 3.0 * pi * R * R * R * rho, hertz = effective_modulus(E, nu) * std::sqrt(0.5 * R);
  const double delta_max = std::pow(15.0 * m * V * V / (16.0 * hertz), 0.4);
  EXPECT_TRUE(same(0.5 * k * delta_max * delta_max, 0.5 * m * V * V, 1e-13));
  EXPECT_TRUE(same(stiffness_of_impact(2.0 * R, rho, E, nu, V) / k, 2.0, 1e-13));   // ~ R at equal speed
  EXPECT_TRUE(same(stiffness_of_impact(R, rho, E, nu, 32.0 * V) / k, 4.0, 1e-13));  // ~ V^(2/5)
  EXPECT_TRUE(same(stiffness_of_modulus(2.0 * R, E) / stiffness_of_modulus(R, E), 2.0));
}

TEST(Scaling, PullOffForces) {
  const double R = 1e-3, gamma = 0.05;
  EXPECT_TRUE(same(f0_of_surface_energy(R, gamma, AdhesionModel::dmt), -4.0 * pi * gamma * 0.5e-3));
  EXPECT_TRUE(same(f0_of_surface_energy(R, gamma, AdhesionModel::jkr), -3.0 * pi * gamma * 0.5e-3));
  EXPECT_TRUE(same(f0_of_surface_energy(R, gamma, AdhesionModel::plastic_jkr),
                   2.0 * f0_of_surface_energy(R, gamma, AdhesionModel::jkr)));
  EXPECT_TRUE(same(f0_of_hamaker(R, 6.5e-20, 4e-10), -6.5e-20 * 0.5e-3 / (6.0 * 16e-20)));
  // Rumpf there and back, and f0 ~ R^2 at equal strength.
  const double f0 = f0_of_tensile_strength(R, 500.0, 0.6, 5.0);
  EXPECT_TRUE(same(0.6 * 5.0 * -f0 / (4.0 * pi * R * R), 500.0));
  EXPECT_TRUE(same(f0_of_tensile_strength(3.0 * R, 500.0, 0.6, 5.0) / f0, 9.0));
  // A constant Bond number needs the cube.
  const PairLaw law = base_case().particles.law;
  const PairLaw cubic = scaled_law(law, {.adhesion = 3.0}, 1.5);
  EXPECT_TRUE(same(bond_number(cubic.f0, 3.75e-3, 2000.0, 9.81), bond_number(law.f0, 2.5e-3, 2000.0, 9.81)));
  EXPECT_NEAR(bond_number(law.f0, 2.5e-3, 2000.0, 9.81), 311.5, 0.1);  // 0.4 N over 1.284e-3 N
}

// ---- the same formulas as keys of a case

TEST(Scaling, CasesByMaterialData) {
  const Case c = base_case({"particles.law.k1={ young_modulus = \"0.7 MPa\" }",
                            "particles.law.f0={ surface_energy = \"0.05 J/m2\", model = \"jkr\" }"});
  EXPECT_TRUE(same(c.particles.law.k1, stiffness_of_modulus(2.5e-3, 7e5)));
  // 2 E* R* = E / (1 - nu^2) R / 2 [Thakur2016, Eq. 14].
  EXPECT_TRUE(same(base_case({"particles.law.k1={ young_modulus = \"0.7 MPa\", poisson_ratio = 0.3 }"}).particles.law.k1, 7e5 / (1.0 - 0.09) * 1.25e-3));
  EXPECT_TRUE(same(c.particles.law.f0, f0_of_surface_energy(2.5e-3, 0.05, AdhesionModel::jkr)));
  const Case impact =
      base_case({"particles.law.k1={ young_modulus = \"7 MPa\", poisson_ratio = 0.3, impact_speed = \"0.3 m/s\" }"});
  EXPECT_TRUE(same(impact.particles.law.k1, stiffness_of_impact(2.5e-3, 2000.0, 7e6, 0.3, 0.3)));
  EXPECT_TRUE(
      same(base_case({"particles.law.f0={ hamaker_constant = 6.5e-20, distance = \"0.4 nm\" }"}).particles.law.f0,
           f0_of_hamaker(2.5e-3, 6.5e-20, 4e-10), 1e-13));
  EXPECT_TRUE(same(
      base_case({"particles.law.f0={ tensile_strength = \"500 Pa\", solid_fraction = 0.6, coordination_number = 5 }"})
          .particles.law.f0,
      f0_of_tensile_strength(2.5e-3, 500.0, 0.6, 5.0)));
  // Gravity counts wherever it stands in the file.
  EXPECT_TRUE(same(base_case({"particles.law.f0={ bond_number = 300 }", "environment.gravity=\"4.905 m/s2\""}).particles.law.f0,
                   -300.0 * 4.0 / 3.0 * pi * std::pow(2.5e-3, 3) * 2000.0 * 4.905));
  // Unequal spheres: at the radius that the data name.
  const std::string sizes = "particles.sizes={ kind = \"uniform\", min = \"2 mm\", max = \"3 mm\" }";
  std::string no_radius = base_text;
  no_radius.erase(no_radius.find("radius ="), std::string("radius = \"2.5 mm\"").size());
  const Case unequal = parse_case(no_radius, "base.toml", {},
                                  {sizes, "particles.law.k1={ young_modulus = \"0.7 MPa\", radius = \"2.2 mm\" }",
                                   "particles.law.f0={ surface_energy = 0.05, model = \"jkr\", radius = \"2.4 mm\" }"});
  EXPECT_TRUE(same(unequal.particles.law.k1, stiffness_of_modulus(2.2e-3, 7e5)));
  EXPECT_TRUE(same(unequal.particles.law.f0, f0_of_surface_energy(2.4e-3, 0.05, AdhesionModel::jkr)));
  EXPECT_NE(unequal.particles.law_origins.front().second.find("R = 2.2 mm"), std::string::npos);
  // Scaled, they are the reference's numbers times the power, not worked out anew: f0 kept here, not ~ R.
  std::vector<std::string> changes{"particles.law.f0={ surface_energy = 0.05, model = \"dmt\" }"};
  const Case reference = base_case(changes);
  for (const std::string& change : scaling_overrides(reference, {.stiffness = 1.0, .adhesion = 0.0}, 1.5))
    changes.push_back(change);
  EXPECT_EQ(base_case(changes).particles.law.f0, reference.particles.law.f0);
}

TEST(Scaling, WrongMaterialDataIsSaid) {
  struct {
    const char *change, *expected;
  } cases[] = {
      {"particles.law.f0={ model = \"jkr\" }", "exactly one of surface_energy, hamaker_constant, tensile_strength"},
      {"particles.law.f0={ surface_energy = 0.05, model = \"jrk\" }", "nearest known word: jkr"},
      {"particles.law.f0={ surface_energy = 0.05, modle = \"jkr\" }", "nearest known key: model"},
      {"particles.law.f0={ surface_energy = 0.05, hamaker_constant = 1e-20, model = \"jkr\" }", "exactly one of"},
      {"particles.law.f0={ bond_number = 300, model = \"jkr\" }", "model"},
      {"particles.law.f0={ bond_number = -1 }", "bond_number"},
      {"particles.law.k1={ young_modulus = \"1 kg\" }", "particles.law.k1.young_modulus"},
      {"particles.law.k1={ young_modulus = 1e6, impact_speed = 0.3 }", "poisson_ratio: is missing"},
      {"particles.law.k1={ young_modulus = \"1 GPa\" }", "is smaller than k1"},
  };
  for (const auto& c : cases) {
    try {
      base_case({c.change});
      ADD_FAILURE() << c.change;
    } catch (const CaseError& error) {
      EXPECT_NE(std::string(error.what()).find(c.expected), std::string::npos) << c.change << "\n" << error.what();
    }
  }
  try {
    base_case({"particles.law.f0={ bond_number = 300 }", "environment.gravity=0", "stage.fill.method=grow", "stage.fill.porosity=0.5"});
    ADD_FAILURE() << "a Bond number without gravity";
  } catch (const CaseError& error) {
    EXPECT_NE(std::string(error.what()).find("needs particles.density and environment.gravity"), std::string::npos) << error.what();
  }
  EXPECT_THROW(base_case({"particles.law.exponent=1.5", "particles.law.k1={ young_modulus = 1e6 }"}), CaseError);
}

}  // namespace
}  // namespace platen
