// Law parameters from material data instead of numbers: k1 = { young_modulus = ... }, f0 = { surface_energy = ... }.
// The formulas are those of scaling.h; the radius is that of the case.
#pragma once

#include "protocol/case_file.h"
#include "protocol/case_reader.h"

namespace platen {

// Whether `key` of the table is a table itself.
bool is_table(TableReader& table, std::string_view key);

// { young_modulus }, { young_modulus, poisson_ratio } or { young_modulus, poisson_ratio, impact_speed }, for exponent 1 and spheres of one radius; the
// latter needs the density. Returns true and sets `out` [N/m] and the formula where all is well; what is wrong goes to the problems.
bool read_stiffness_alternative(TableReader& law, std::string_view key, const ParticleSpec& particles, double exponent,
                                double& out, std::string& formula);

// { surface_energy, model = "dmt" | "jkr" | "plastic_jkr", flattening }, { hamaker_constant, distance },
// { tensile_strength, solid_fraction, coordination_number } or { bond_number }; the last needs the density and gravity [m/s2]. As above; f0 <= 0 [N].
bool read_f0_alternative(TableReader& law, std::string_view key, const ParticleSpec& particles, double gravity, double& out, std::string& formula);

}  // namespace platen
