#include "protocol/study/analysis.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <string_view>
#include <tuple>

#include "protocol/output/files.h"

namespace platen {
namespace {

namespace fs = std::filesystem;

nlohmann::json json_of(const fs::path& file) {
  std::error_code ignored;
  if (!fs::is_regular_file(file, ignored)) return nlohmann::json::object();
  nlohmann::json json = nlohmann::json::parse(read_whole_file(file), nullptr, false);
  return json.is_object() ? json : nlohmann::json::object();
}

MeasuredCurve measure(const StudyPlan& plan, const PlannedPart& part, const PlannedCurve& planned,
                      const fs::path& folder) {
  MeasuredCurve out;
  out.planned = &planned;
  for (std::size_t k = 0; k < planned.jobs.size(); ++k) {
    const Job& job = plan.jobs[planned.jobs[k]];
    if (!is_done(folder, job)) continue;
    const fs::path run = run_folder(folder, job);
    out.seeds.push_back(planned.seeds[k]);
    out.jobs.push_back(planned.jobs[k]);
    out.runs.push_back(measure_run(run, job.c, part.study->strain_zero));
    const nlohmann::json performance = json_of(run / "summary.json").value("performance", nlohmann::json::object());
    out.wall_seconds.push_back(performance.value("wall_seconds", std::numeric_limits<double>::quiet_NaN()));
    out.steal_seconds.push_back(json_of(run / "timing.json").value("steal_seconds", 0.0));
  }
  return out;
}

bool chosen(const std::vector<std::string>& names, const std::string& name) {
  return names.empty() || std::find(names.begin(), names.end(), name) != names.end();
}

double range_of(const std::vector<Curve>& curves) {
  const Band band = band_of(curves);
  if (band.mean.empty()) return 0.0;
  const auto [low, high] = std::minmax_element(band.mean.begin(), band.mean.end());
  return *high - *low;
}

// Little happens on an unloading branch: its distances are seen against the range of loading too, else the smallest shift
// would count for more than a wrong loading curve.
double common_scale(const MeasuredCurve& reference, const std::string& observable) {
  constexpr std::string_view ending = "_unloading";
  double scale = range_of(reference.curves(observable));
  if (observable.ends_with(ending))
    scale = std::max(scale, range_of(reference.curves(observable.substr(0, observable.size() - ending.size()))));
  return scale;
}

// Curves that differ in the scanned power alone, one scan for each radius, other power and set of varied keys.
class Scanner {
 public:
  Scanner(const PartResults& part, const ScanSpec& spec) : part_(part), spec_(spec) {}

  std::vector<ScanResult> run() const {
    using Group = std::tuple<double, double, std::map<std::string, std::string>, std::size_t>;
    std::map<Group, std::map<double, std::size_t>> groups;  // power -> curve
    for (std::size_t k = 0; k < part_.curves.size(); ++k) {
      const PlannedCurve& curve = *part_.curves[k].planned;
      if (!chosen(spec_.curves, curve.block) || curve.radius == part_.plan->reference_radius ||
          part_.curves[k].runs.empty())
        continue;
      groups[{curve.radius, other(curve), curve.varied, curve.reference}].emplace(power(curve), k);
    }
    std::vector<ScanResult> out;
    for (const auto& [group, curves] : groups) {
      if (curves.size() < 3) continue;
      std::vector<ScanResult> parts;
      for (const std::string& observable : part_.plan->study->observables) {
        if (!chosen(spec_.observables, observable)) continue;
        if (auto one = scan(curves, observable)) parts.push_back(std::move(*one));
      }
      if (parts.size() > 1) parts.push_back(together(parts));
      for (ScanResult& one : parts) {
        one.power = spec_.power;
        one.radius = std::get<0>(group);
        one.other_power = std::get<1>(group);
        const auto least = std::min_element(one.errors.begin(), one.errors.end());
        one.best_tried = one.powers[static_cast<std::size_t>(least - one.errors.begin())];
        one.minimum = least_error(one.powers, one.each);
        out.push_back(std::move(one));
      }
    }
    return out;
  }

 private:
  bool stiffness() const { return spec_.power == ScanSpec::Power::stiffness; }
  double power(const PlannedCurve& c) const { return stiffness() ? c.powers.stiffness : c.powers.adhesion; }
  double other(const PlannedCurve& c) const { return stiffness() ? c.powers.adhesion : c.powers.stiffness; }

  std::optional<ScanResult> scan(const std::map<double, std::size_t>& curves, const std::string& observable) const {
    ScanResult out;
    out.observable = observable;
    for (const auto& [power, k] : curves) {
      const auto row = std::find_if(part_.collapse.begin(), part_.collapse.end(), [&, k = k](const CollapseRow& r) {
        return r.curve == k && r.observable == observable;
      });
      if (row == part_.collapse.end() || !(row->error.error > 0.0)) return std::nullopt;
      const double scale = row->error.relative / row->error.error;
      out.powers.push_back(power);
      out.errors.push_back(row->error.relative);
      out.each.resize(std::max(out.each.size(), row->error.each.size()));
      for (std::size_t s = 0; s < row->error.each.size(); ++s) out.each[s].push_back(scale * row->error.each[s]);
    }
    // A seed that is missing at one power is missing in the scan.
    std::erase_if(out.each, [&](const auto& one) { return one.size() != out.powers.size(); });
    return out;
  }

  ScanResult together(const std::vector<ScanResult>& parts) const {
    ScanResult out;
    out.observable = "all";
    out.powers = parts.front().powers;
    const auto n = static_cast<double>(parts.size());
    std::size_t seeds = parts.front().each.size();
    for (const ScanResult& part : parts) seeds = std::min(seeds, part.each.size());
    out.each.assign(seeds, std::vector<double>(out.powers.size(), 0.0));
    out.errors.assign(out.powers.size(), 0.0);
    for (std::size_t p = 0; p < out.powers.size(); ++p) {
      for (const ScanResult& part : parts) {
        out.errors[p] += part.errors[p] * part.errors[p] / n;
        for (std::size_t s = 0; s < seeds; ++s) out.each[s][p] += part.each[s][p] * part.each[s][p] / n;
      }
      out.errors[p] = std::sqrt(out.errors[p]);
      for (std::size_t s = 0; s < seeds; ++s) out.each[s][p] = std::sqrt(out.each[s][p]);
    }
    return out;
  }

  const PartResults& part_;
  const ScanSpec& spec_;
};

}  // namespace

std::vector<Curve> MeasuredCurve::curves(const std::string& observable) const {
  std::vector<Curve> out;
  for (const RunMeasures& run : runs)
    if (const auto found = run.curves.find(observable); found != run.curves.end()) out.push_back(found->second);
  return out;
}

std::vector<double> MeasuredCurve::values(const std::string& scalar) const {
  std::vector<double> out;
  for (const RunMeasures& run : runs)
    if (const auto found = run.scalars.find(scalar); found != run.scalars.end()) out.push_back(found->second);
  return out;
}

std::vector<PartResults> analyse(const StudyPlan& plan, const fs::path& folder) {
  std::vector<PartResults> all;
  for (const PlannedPart& part : plan.parts) {
    PartResults results;
    results.plan = &part;
    for (const PlannedCurve& curve : part.curves) results.curves.push_back(measure(plan, part, curve, folder));
    for (std::size_t k = 0; k < part.curves.size(); ++k) {
      const std::size_t reference = part.curves[k].reference;
      if (reference == k) continue;
      for (const std::string& observable : part.study->observables)
        if (auto error =
                collapse_error(results.curves[reference].curves(observable), results.curves[k].curves(observable))) {
          if (const double scale = common_scale(results.curves[reference], observable); scale > 0.0)
            error->relative = error->error / scale;
          results.collapse.push_back({k, reference, observable, std::move(*error)});
        }
    }
    for (const ScanSpec& spec : part.study->scans)
      for (ScanResult& scan : Scanner(results, spec).run()) results.scans.push_back(std::move(scan));
    all.push_back(std::move(results));
  }
  return all;
}

}  // namespace platen
