#include "protocol/study/observables.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>
#include <stdexcept>

#include "protocol/output/hdf5_file.h"
#include "protocol/output/results_h5.h"
#include "protocol/output/series_csv.h"
#include "protocol/sphere_facts.h"
#include "protocol/stages.h"
#include "protocol/study/settled_sample.h"

namespace platen {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double half_window = 2.5e-3;  // [s] of the centred means
constexpr double largest_low = 1e3;     // curves over stress begin at 1 kPa at the latest, below is the rough surface

// The rows of one stage, means over the window taken.
struct StageRows {
  std::vector<double> time, height, stress_top, stress_bottom, porosity, coordination, inertial;
  bool empty() const { return time.empty(); }
};

std::vector<double> centred(const std::vector<double>& time, const std::vector<double>& value) {
  std::vector<double> out(value.size());
  std::size_t a = 0, b = 0;
  for (std::size_t i = 0; i < value.size(); ++i) {
    // The window shrinks on both sides alike near the ends: a lopsided one would shift the curve.
    const double half = std::min({half_window, time[i] - time.front(), time.back() - time[i]});
    while (time[a] < time[i] - half) ++a;
    b = std::max(b, i);
    while (b + 1 < time.size() && time[b + 1] <= time[i] + half) ++b;
    double sum = 0.0;
    for (std::size_t k = a; k <= b; ++k) sum += value[k];
    out[i] = sum / static_cast<double>(b - a + 1);
  }
  return out;
}

StageRows rows_of(const SeriesTable& series, const std::string& stage) {
  StageRows rows;
  const auto number = std::find(series.stage_names.begin(), series.stage_names.end(), stage);
  if (stage.empty() || number == series.stage_names.end()) return rows;
  const int wanted = static_cast<int>(number - series.stage_names.begin());
  const auto pick = [&](const char* name) {
    std::vector<double> out;
    const std::vector<double>& column = series.column(name);
    for (std::size_t r = 0; r < series.rows(); ++r)
      if (series.stage[r] == wanted) out.push_back(column[r]);
    return out;
  };
  rows.time = pick("time");
  const auto mean = [&](const char* name) { return centred(rows.time, pick(name)); };
  rows.height = mean("height");
  rows.stress_top = mean("stress_top");
  rows.stress_bottom = mean("stress_bottom");
  rows.porosity = mean("porosity");
  rows.coordination = mean("coordination_number");
  rows.inertial = pick("inertial_number");
  return rows;
}

// Mean of the last 5 ms.
double at_end(const StageRows& rows, const std::vector<double>& value) {
  double sum = 0.0;
  int count = 0;
  for (std::size_t i = rows.time.size(); i-- > 0 && rows.time[i] >= rows.time.back() - 2.0 * half_window; ++count)
    sum += value[i];
  return sum / count;
}

// value over stress by first passage, upwards (sign 1) or downwards (sign -1).
Curve branch(const StageRows& rows, const std::vector<double>& value, double sign, double low) {
  Curve curve;
  double reached = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < rows.time.size(); ++i) {
    const double stress = rows.stress_top[i];
    if (!(sign * stress > reached) || !std::isfinite(value[i])) continue;
    reached = sign * stress;
    curve.x.push_back(stress);
    curve.y.push_back(value[i]);
  }
  if (sign < 0.0) {
    std::reverse(curve.x.begin(), curve.x.end());
    std::reverse(curve.y.begin(), curve.y.end());
  }
  // Starts exactly at `low`.
  const double first = value_at(curve, low);
  std::size_t k = 0;
  while (k < curve.x.size() && curve.x[k] <= low) ++k;
  curve.x.erase(curve.x.begin(), curve.x.begin() + static_cast<std::ptrdiff_t>(k));
  curve.y.erase(curve.y.begin(), curve.y.begin() + static_cast<std::ptrdiff_t>(k));
  if (std::isfinite(first)) {
    curve.x.insert(curve.x.begin(), low);
    curve.y.insert(curve.y.begin(), first);
  }
  return curve;
}

std::string first_stage(const Case& c, StageKind kind) {
  for (const StageSpec& stage : c.stages)
    if (stage.kind == kind) return stage.name;
  return {};
}

const StageSpec* stage_spec(const Case& c, const std::string& name) {
  for (const StageSpec& stage : c.stages)
    if (stage.name == name) return &stage;
  return nullptr;
}

Curve height_profile(const Hdf5Group& root, const std::string& stage) {
  Curve curve;
  if (!root.has("profiles")) return curve;
  const Hdf5Group profiles = root.group("profiles");
  const std::string name = stage_group_name(stage);
  if (!profiles.has(name)) return curve;
  curve.y = profiles.group(name).read<double>("porosity");
  // Equal slabs from plate to plate.
  for (std::size_t k = 0; k < curve.y.size(); ++k)
    curve.x.push_back((static_cast<double>(k) + 0.5) / static_cast<double>(curve.y.size()));
  return curve;
}

// Largest overlap that a contact still there has ever had, from its history: delta_p^n = (1 - k1/k2) delta_max^n, over the
// diameter of its smaller sphere.
double largest_overlap(const Hdf5Group& root, const Case& c) {
  if (!root.has("contacts")) return nan;
  const Hdf5Group contacts = root.group("contacts"), particles = root.group("particles");
  const PairLaw& law = c.particles.law;
  const std::vector<std::int64_t> ids = particles.read<std::int64_t>("id"), pairs = contacts.read<std::int64_t>("pair");
  const std::vector<double> radii = particles.read<double>("radius"), overlaps = contacts.read<double>("overlap"), plastic = contacts.read<double>("plastic_overlap");
  const auto radius_of = [&](std::int64_t id) { return radii[static_cast<std::size_t>(std::ranges::lower_bound(ids, id) - ids.begin())]; };
  const double kept = std::pow(1.0 - law.k1 / law.k2, 1.0 / law.exponent);
  double largest = 0.0;
  for (std::size_t k = 0; k < overlaps.size(); ++k) {
    const double ever = kept > 0.0 ? std::max(overlaps[k], plastic[k] / kept) : overlaps[k];
    largest = std::max(largest, ever / (2.0 * std::min(radius_of(pairs[2 * k]), radius_of(pairs[2 * k + 1]))));
  }
  return largest;
}

// Mean over the rows with an inertial number below 1e-4: only where loading is quasi-static do both plates tell the weight.
double quasi_static_difference(const StageRows& rows) {
  double sum = 0.0;
  int count = 0;
  for (std::size_t i = 0; i < rows.time.size(); ++i)
    if (rows.inertial[i] < 1e-4) sum += rows.stress_bottom[i] - rows.stress_top[i], ++count;
  return count > 0 ? sum / count : nan;
}

void put(RunMeasures& out, const char* name, double value) {
  if (std::isfinite(value)) out.scalars[name] = value;
}

std::vector<double> strain_of(const StageRows& rows, double h0) {
  std::vector<double> strain;
  for (const double h : rows.height) strain.push_back(engineering_strain(h0, h));
  return strain;
}

void measure_compression(const SeriesTable& series, const Case& c, std::optional<double> wanted_zero,
                         RunMeasures& out) {
  const std::string name = first_stage(c, StageKind::compress);
  const StageRows rows = rows_of(series, name);
  if (rows.empty()) return;
  const double zero = wanted_zero.value_or(stage_spec(c, name)->strain_zero);
  const double low = std::min(zero, largest_low);
  out.curves["porosity"] = branch(rows, rows.porosity, 1.0, low);
  out.curves["coordination"] = branch(rows, rows.coordination, 1.0, low);
  put(out, "porosity_start", value_at(out.curves["porosity"], low));
  put(out, "porosity_at_100_pa", value_at(branch(rows, rows.porosity, 1.0, 100.0), 100.0));
  put(out, "porosity_at_zero", value_at(out.curves["porosity"], zero));
  put(out, "porosity_peak", at_end(rows, rows.porosity));
  put(out, "coordination_peak", at_end(rows, rows.coordination));
  const double peak_stress = at_end(rows, rows.stress_top);
  put(out, "stress_peak", peak_stress);
  put(out, "stress_difference", quasi_static_difference(rows));
  put(out, "strain_rate", stage_spec(c, name)->speed / *std::min_element(rows.height.begin(), rows.height.end()));
  // The stress from which on the inertial number stays below 1e-4.
  double quasi_static = rows.stress_top.back();
  for (std::size_t i = rows.time.size(); i-- > 0 && rows.inertial[i] < 1e-4;) quasi_static = rows.stress_top[i];
  put(out, "quasi_static_stress", rows.inertial.back() < 1e-4 ? quasi_static : nan);
  put(out, "inertial_start", value_at(branch(rows, rows.inertial, 1.0, low), low));
  put(out, "inertial_peak", rows.inertial.back());

  const Curve height = branch(rows, rows.height, 1.0, zero);
  const double h0 = value_at(height, zero);
  if (!std::isfinite(h0)) return;
  const std::vector<double> strain = strain_of(rows, h0);
  out.curves["stress_strain"] = branch(rows, strain, 1.0, zero);
  put(out, "strain_peak", at_end(rows, strain));

  const StageRows up = rows_of(series, first_stage(c, StageKind::unload));
  if (up.empty()) return;
  const std::vector<double> strain_up = strain_of(up, h0);
  out.curves["stress_strain_unloading"] = branch(up, strain_up, -1.0, low);
  out.curves["porosity_unloading"] = branch(up, up.porosity, -1.0, low);
  out.curves["coordination_unloading"] = branch(up, up.coordination, -1.0, low);
  put(out, "strain_residual", strain_up.back());
  put(out, "porosity_residual", up.porosity.back());
  put(out, "coordination_unloaded", up.coordination.back());
  put(out, "stress_difference_unloaded", quasi_static_difference(up));
  if (stage_spec(c, first_stage(c, StageKind::unload))->until.stress == 0.0) put(out, "stress_top_unloaded", up.stress_top.back());
}

// Whether the sample lost its shape when its sides went, and with it the strength that the crush looks for.
bool fell(const StageRows& release) { return !release.empty() && release.height.back() < standing * release.height.front(); }

void measure_crush(const SeriesTable& series, const Case& c, RunMeasures& out) {
  const StageRows release = rows_of(series, first_stage(c, StageKind::release));
  if (!release.empty()) {
    put(out, "coordination_released", release.coordination.back());
    put(out, "stress_bottom_released", at_end(release, release.stress_bottom));
  }
  if (fell(release)) return;
  const std::string name = first_stage(c, StageKind::crush);
  const StageRows rows = rows_of(series, name);
  if (rows.empty()) return;
  // From the first touch of at least the strain zero, which falls between two rows.
  const double zero = stage_spec(c, name)->strain_zero;
  std::size_t first = 0;
  while (first < rows.time.size() && rows.stress_top[first] < zero) ++first;
  if (first == rows.time.size()) return;
  Curve& curve = out.curves["unconfined"];
  for (std::size_t i = first; i < rows.time.size(); ++i) {
    const double strain = engineering_strain(rows.height[first], rows.height[i]);
    if (!curve.x.empty() && strain <= curve.x.back()) continue;
    curve.x.push_back(strain);
    curve.y.push_back(rows.stress_top[i]);
  }
}

}  // namespace

double value_at(const Curve& curve, double x) {
  if (curve.x.empty() || !(x >= curve.x.front()) || !(x <= curve.x.back())) return nan;
  const auto right = std::lower_bound(curve.x.begin(), curve.x.end(), x);
  const auto k = static_cast<std::size_t>(right - curve.x.begin());
  if (*right == x) return curve.y[k];
  const double t = (x - curve.x[k - 1]) / (curve.x[k] - curve.x[k - 1]);
  return curve.y[k - 1] + t * (curve.y[k] - curve.y[k - 1]);
}

const std::vector<ObservableKind>& observable_kinds() {
  static const std::vector<ObservableKind> kinds{
      {"stress_strain", "axial stress", "Pa", "axial strain", "-", "strain over stress while loading"},
      {"stress_strain_unloading", "axial stress", "Pa", "axial strain", "-", "strain over stress while unloading"},
      {"porosity", "axial stress", "Pa", "porosity", "-", "porosity over stress while loading"},
      {"porosity_unloading", "axial stress", "Pa", "porosity", "-", "porosity over stress while unloading"},
      {"coordination", "axial stress", "Pa", "coordination number", "-",
       "coordination number over stress while loading"},
      {"coordination_unloading", "axial stress", "Pa", "coordination number", "-",
       "coordination number over stress while unloading"},
      {"porosity_height", "height / bed height", "-", "porosity of the slab", "-",
       "porosity of slabs over height at the end of the compression"},
      {"unconfined", "axial strain", "-", "axial stress", "Pa", "stress over strain without sides"},
  };
  return kinds;
}

const ObservableKind& observable_kind(std::string_view name) {
  for (const ObservableKind& kind : observable_kinds())
    if (kind.name == name) return kind;
  throw std::logic_error("no observable " + std::string(name));
}

const std::vector<ScalarKind>& scalar_kinds() {
  static const std::vector<ScalarKind> kinds{
      {"porosity_filled", "-", "porosity at the end of fill"},
      {"porosity_settled", "-", "porosity of the settled sample when the compression begins, without its lowest and highest slab"},
      {"porosity_at_100_pa", "-", "porosity when the stress first reaches 0.1 kPa"},
      {"porosity_start", "-", "porosity when the stress first reaches 1 kPa, or the strain zero where that is lower"},
      {"porosity_at_zero", "-", "porosity at the strain zero"},
      {"porosity_peak", "-", "porosity at the end of the compression"},
      {"coordination_peak", "-", "coordination number at the end of the compression"},
      {"stress_peak", "Pa", "stress on the top plate at the end of the compression"},
      {"strain_peak", "-", "strain at the end of the compression, from the strain zero"},
      {"strain_residual", "-", "strain after unloading, from the same zero"},
      {"porosity_residual", "-", "porosity after unloading"},
      {"coordination_unloaded", "-", "coordination number after unloading"},
      {"coordination_released", "-", "coordination number at rest without sides"},
      {"strength", "Pa", "unconfined strength, the largest stress of the crushing"},
      {"strength_strain", "-", "strain at the strength"},
      {"initial_stiffness", "Pa", "largest tangent below half the strength"},
      {"stress_difference", "Pa", "bottom minus top stress, mean of the compression while the inertial number is below 1e-4"},
      {"stress_difference_unloaded", "Pa", "bottom minus top stress, mean of unloading while the inertial number is below 1e-4"},
      {"stress_top_unloaded", "Pa", "stress on the top plate at the end of unloading to nothing"},
      {"stress_bottom_released", "Pa", "stress on the bottom plate at rest without sides"},
      {"weight_over_area", "Pa", "weight of the spheres over the plate's area"},
      {"strain_rate", "1/s", "plate speed over the smallest height of the compression"},
      {"inertial_start", "-", "inertial number when the stress first reaches 1 kPa, or the strain zero where that is lower"},
      {"inertial_peak", "-", "inertial number at the end of the compression"},
      {"quasi_static_stress", "Pa", "stress from which on the inertial number stays below 1e-4"},
      {"largest_overlap", "-",
       "largest overlap of the contacts left at the end, over the diameter of the smaller sphere, from their history"},
  };
  return kinds;
}

RunMeasures measure_run(const std::filesystem::path& folder, const Case& c, std::optional<double> strain_zero) {
  RunMeasures out;
  const SeriesTable series = read_series(folder / "series.csv");
  const StageRows fill = rows_of(series, first_stage(c, StageKind::fill));
  if (!fill.empty()) put(out, "porosity_filled", fill.porosity.back());
  measure_compression(series, c, strain_zero, out);
  measure_crush(series, c, out);
  if (c.box.given) put(out, "weight_over_area", sphere_facts(c).mass_total * c.gravity / (c.box.width * c.box.depth));
  const auto results = Hdf5File::open(folder / "results.h5");
  out.curves["porosity_height"] = height_profile(results.root(), first_stage(c, StageKind::compress));
  put(out, "largest_overlap", largest_overlap(results.root(), c));
  put(out, "porosity_settled", settled_porosity(results.root(), c).value_or(nan));
  const nlohmann::json summary = nlohmann::json::parse(read_whole_file(folder / "summary.json"), nullptr, false);
  const std::string crush = fell(rows_of(series, first_stage(c, StageKind::release))) ? "" : first_stage(c, StageKind::crush);
  if (summary.is_object() && summary.contains("stages"))
    for (const auto& stage : summary["stages"]) {
      if (crush.empty() || stage.value("name", "") != crush) continue;
      for (const char* key : {"strength", "strength_strain", "initial_stiffness"})
        if (stage.contains(key)) put(out, key, stage[key].get<double>());
    }
  std::erase_if(out.curves, [](const auto& entry) { return entry.second.empty(); });
  return out;
}

}  // namespace platen
