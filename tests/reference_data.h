// Reads the worked examples tests/data/*.json and applies their tolerances.
//
// A file is a list of records {id, kind, notes, inputs, expected, tolerance}: SI units, radians. A number passes when
// |x - expected| <= rel |expected| + abs; a vector is judged with its largest component as the scale.
#pragma once

#include <cmath>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "reference_bed.h"

namespace platen::reference {

using Json = nlohmann::json;

struct Record {
  std::string id, kind;
  Json inputs, expected;
  double rel = 0.0, abs = 0.0;
};

// All records of tests/data/<name>.json; throws if the file cannot be read or holds none.
inline std::vector<Record> read_records(const std::string& name) {
  const std::string path = std::string(PLATEN_SOURCE_DIR) + "/tests/data/" + name + ".json";
  std::ifstream file(path);
  if (!file) throw std::runtime_error("cannot open " + path);
  std::vector<Record> records;
  for (const Json& r : Json::parse(file))
    records.push_back({r.at("id"), r.at("kind"), r.at("inputs"), r.at("expected"), r.at("tolerance").at("rel"),
                       r.at("tolerance").at("abs")});
  if (records.empty()) throw std::runtime_error("no records in " + path);
  return records;
}

// The one record of that kind in a file of several kinds.
inline Record read_record(const std::string& name, const std::string& kind) {
  for (const Record& r : read_records(name))
    if (r.kind == kind) return r;
  throw std::runtime_error("no record of kind " + kind + " in " + name);
}

inline ::testing::AssertionResult close(double value, double expected, double rel, double abs) {
  const double allowed = rel * std::abs(expected) + abs;
  if (std::abs(value - expected) <= allowed) return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure() << ::testing::PrintToString(value) << " against " << expected << ", off by "
                                       << std::abs(value - expected) << ", allowed " << allowed;
}

inline ::testing::AssertionResult close(const std::vector<double>& value, const std::vector<double>& expected,
                                        double rel, double abs) {
  if (value.size() != expected.size())
    return ::testing::AssertionFailure() << value.size() << " components, " << expected.size() << " expected";
  double scale = 0.0;
  for (double x : expected) scale = std::max(scale, std::abs(x));
  for (std::size_t k = 0; k < value.size(); ++k)
    if (!(std::abs(value[k] - expected[k]) <= rel * scale + abs))
      return ::testing::AssertionFailure() << "component " << k << ": " << value[k] << " against " << expected[k]
                                           << ", allowed " << rel * scale + abs;
  return ::testing::AssertionSuccess();
}

// A result against the record's own expectation `key` and tolerance.
inline ::testing::AssertionResult meets(const Record& r, const std::string& key, double value) {
  return close(value, r.expected.at(key).get<double>(), r.rel, r.abs) << " (" << r.id << ", " << key << ")";
}
inline ::testing::AssertionResult meets(const Record& r, const std::string& key, const std::vector<double>& value) {
  const auto expected = r.expected.at(key).get<std::vector<double>>();
  return close(value, expected, r.rel, r.abs) << " (" << r.id << ", " << key << ")";
}
inline ::testing::AssertionResult meets(const Record& r, const std::string& key, Vec3 v) {
  return meets(r, key, std::vector<double>{v.x, v.y, v.z});
}

inline Vec3 vec3(const Json& j) { return {j.at(0), j.at(1), j.size() > 2 ? j.at(2).get<double>() : 0.0}; }

inline std::vector<Vec3> vec3_list(const Json& j) {
  std::vector<Vec3> list;
  for (const Json& v : j) list.push_back(vec3(v));
  return list;
}

// The pair law of a record; kt is given as a stiffness, the law wants its ratio to k1.
inline EepaLaw eepa_law(const Json& j) {
  EepaLaw law;
  law.k1 = j.at("k1");
  law.k2 = j.at("k2");
  law.kadh = j.at("kadh");
  law.f0 = j.at("f0");
  law.n = j.at("n");
  law.e = j.at("e");
  law.mu = j.at("mu");
  law.mu_r = j.at("mu_r");
  law.kt_ratio = j.at("kt").get<double>() / law.k1;
  return law;
}

// E and nu are [sphere, plate]; e and mu are left to the caller where the record does not name them.
inline HertzMindlinLaw hertz_mindlin_law(const Json& j, double mu_r) {
  HertzMindlinLaw law;
  law.E_s = j.at("E").at(0);
  law.E_p = j.at("E").at(1);
  law.nu_s = j.at("nu").at(0);
  law.nu_p = j.at("nu").at(1);
  law.e = j.value("e", 0.4);
  law.mu = j.value("mu", 0.3);
  law.mu_r = mu_r;
  return law;
}

// Density of a solid sphere of radius R and mass m [kg/m3].
inline double density_of(double R, double m) { return m / (4.0 / 3.0 * std::numbers::pi * R * R * R); }

// Two spheres of a record of kind head_on or oblique_pair(_3d), ready to start: sphere 0 is i, sphere 1 is j.
inline Bed two_spheres(const Record& r) {
  const Json& in = r.inputs;
  Bed bed;
  bed.pair_law = eepa_law(in.at("law"));
  if (r.kind == "head_on") {
    const double R = in.at("R"), v = in.at("v_relative").get<double>() / 2.0, rho = density_of(R, in.at("m"));
    bed.add({R, 0, 0}, {-v, 0, 0}, {}, R, rho);
    bed.add({-R, 0, 0}, {v, 0, 0}, {}, R, rho);
    return bed;
  }
  const double R_i = in.at("R").at(0), R_j = in.at("R").at(1);
  const double rho_i = density_of(R_i, in.at("m").at(0)), rho_j = density_of(R_j, in.at("m").at(1));
  if (r.kind == "oblique_pair") {
    const Vec3 n = vec3(in.at("normal_j_to_i"));
    bed.add(R_i * n, vec3(in.at("v_i")), {0, 0, in.at("w_i")}, R_i, rho_i);
    bed.add(-R_j * n, vec3(in.at("v_j")), {0, 0, in.at("w_j")}, R_j, rho_j);
  } else {
    bed.add(vec3(in.at("x_i")), vec3(in.at("vi")), vec3(in.at("wi")), R_i, rho_i);
    bed.add(vec3(in.at("x_j")), vec3(in.at("vj")), vec3(in.at("wj")), R_j, rho_j);
  }
  return bed;
}

// The record of kind many_body, ready to start.
inline Bed many_spheres(const Record& r) {
  const Json& in = r.inputs;
  Bed bed;
  bed.pair_law = eepa_law(in.at("law"));
  bed.plate_law = hertz_mindlin_law(in.at("plate"), bed.pair_law.mu_r);
  bed.g = in.at("g");
  bed.periodic = true;
  bed.Lx = in.at("Lx");
  bed.Ly = in.at("Ly");
  bed.add_bottom();
  bed.add_top(in.at("z_top"), -in.at("plate_speed_down").get<double>());
  const auto x = vec3_list(in.at("x")), v = vec3_list(in.at("v")), w = vec3_list(in.at("w"));
  for (std::size_t i = 0; i < x.size(); ++i) bed.add(x[i], v[i], w[i], in.at("R"), in.at("density"));
  return bed;
}

// Largest component of a - b over all spheres, x and y modulo the box if L > 0.
inline double largest_difference(const std::vector<Vec3>& a, const std::vector<Vec3>& b, double Lx = 0.0,
                                 double Ly = 0.0) {
  double largest = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const Vec3 d = a[i] - b[i];
    const double dx = Lx > 0.0 ? std::remainder(d.x, Lx) : d.x, dy = Ly > 0.0 ? std::remainder(d.y, Ly) : d.y;
    largest = std::max({largest, std::abs(dx), std::abs(dy), std::abs(d.z)});
  }
  return largest;
}

}  // namespace platen::reference
