#include "protocol/study/analysis.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>
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
                      const fs::path& folder, std::set<std::string>& damaged) {
  MeasuredCurve out;
  out.planned = &planned;
  for (std::size_t k = 0; k < planned.jobs.size(); ++k) {
    const Job& job = plan.jobs[planned.jobs[k]];
    if (!is_done(folder, job)) continue;
    const fs::path run = run_folder(folder, job);
    try {
      out.runs.push_back(measure_run(run, job.c, part.study->strain_zero));
    } catch (const std::exception& error) {  // damaged since: the others count all the same
      damaged.insert(fmt::format("{}: {}; remove this folder, and the same command makes the run again", run.string(), error.what()));
      continue;
    }
    out.seeds.push_back(planned.seeds[k]);
    out.jobs.push_back(planned.jobs[k]);
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
      const ScanData data = data_of(curves, std::get<0>(group), std::get<3>(group));
      std::vector<std::vector<std::size_t>> choices;
      std::vector<std::size_t> all;
      for (std::size_t o = 0; o < data.observables.size(); ++o) choices.push_back({o}), all.push_back(o);
      if (all.size() > 1) choices.push_back(all);
      for (const std::vector<std::size_t>& which : choices) {
        ScanResult one;
        one.power = spec_.power;
        one.radius = std::get<0>(group);
        one.other_power = std::get<1>(group);
        one.varied = std::get<2>(group);
        one.reference = part_.curves[std::get<3>(group)].planned->label;
        one.observable = which.size() > 1 ? "all" : data.observables[which.front()].name;
        one.powers = data.powers;
        one.seeds = static_cast<int>(data.observables[which.front()].of_power.front().size());
        constexpr std::size_t none = std::numeric_limits<std::size_t>::max();
        one.errors.assign(one.powers.size(), 0.0);
        for (const std::size_t o : which) {
          const std::vector<double> squares = data.squares(o, none, none);
          for (std::size_t p = 0; p < squares.size(); ++p) one.errors[p] += squares[p] / static_cast<double>(which.size());
        }
        for (double& e : one.errors) e = std::sqrt(e);
        const auto least = std::min_element(one.errors.begin(), one.errors.end());
        one.best_tried = one.powers[static_cast<std::size_t>(least - one.errors.begin())];
        one.minimum = data.minimum(which);
        out.push_back(std::move(one));
      }
    }
    return out;
  }

 private:
  bool stiffness() const { return spec_.power == ScanSpec::Power::stiffness; }
  double power(const PlannedCurve& c) const { return stiffness() ? c.powers.stiffness : c.powers.adhesion; }
  double other(const PlannedCurve& c) const { return stiffness() ? c.powers.adhesion : c.powers.stiffness; }

  // Observables that every power has, of the seeds that are there at every power.
  ScanData data_of(const std::map<double, std::size_t>& curves, double radius, std::size_t reference) const {
    ScanData data;
    data.ratio = radius / part_.plan->reference_radius;
    std::set<std::uint64_t> seeds;
    for (const auto& [power, k] : curves) {
      data.powers.push_back(power);
      const std::set<std::uint64_t> own(part_.curves[k].seeds.begin(), part_.curves[k].seeds.end());
      if (data.powers.size() == 1) seeds = own;
      else std::erase_if(seeds, [&](std::uint64_t seed) { return !own.contains(seed); });
    }
    for (const std::string& name : part_.plan->study->observables) {
      if (!chosen(spec_.observables, name)) continue;
      ScanObservable one;
      one.name = name;
      one.reference = part_.curves[reference].curves(name);
      one.scale = common_scale(part_.curves[reference], name);
      std::vector<Curve> all = one.reference;
      bool complete = !one.reference.empty() && !seeds.empty() && one.scale > 0.0;
      for (const auto& [power, k] : curves) {
        const MeasuredCurve& curve = part_.curves[k];
        std::vector<Curve>& own = one.of_power.emplace_back();
        for (std::size_t r = 0; r < curve.runs.size(); ++r) {
          const auto found = curve.runs[r].curves.find(name);
          if (seeds.contains(curve.seeds[r]) && found != curve.runs[r].curves.end()) own.push_back(found->second);
        }
        complete = complete && own.size() == seeds.size();
        all.insert(all.end(), own.begin(), own.end());
      }
      const auto range = complete ? common_range(all) : std::nullopt;
      if (!range) continue;
      one.x = grid(*range);
      data.observables.push_back(std::move(one));
    }
    return data;
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

std::vector<PartResults> analyse(const StudyPlan& plan, const fs::path& folder, std::set<std::string>& damaged) {
  std::vector<PartResults> all;
  for (const PlannedPart& part : plan.parts) {
    PartResults results;
    results.plan = &part;
    for (const PlannedCurve& curve : part.curves) results.curves.push_back(measure(plan, part, curve, folder, damaged));
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
