// What the runs of a bed say: differences to the reference of each part, against the scatter between seeds.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "bench/accuracy/bulk.h"

namespace platen::bench {

struct Quantity {
  const char *key, *name;
};
constexpr Quantity quantities[] = {{"strain", "strain at the end of compression"}, {"porosity", "porosity there"},
                                   {"coordination_number", "coordination number there"}, {"strength", "unconfined strength (Pa)"}};

using Figures = std::map<std::string, std::vector<std::map<std::string, double>>>;  // by setting, then seed

struct Moments {
  double mean = std::nan(""), deviation = std::nan("");  // deviation: of one seed
  int n = 0;
  double error() const { return n > 1 ? deviation / std::sqrt(n) : std::nan(""); }
};

inline Moments moments(const std::vector<double>& x) {
  Moments m;
  double sum = 0.0, squares = 0.0;
  for (const double v : x)
    if (std::isfinite(v)) sum += v, ++m.n;
  if (m.n > 0) m.mean = sum / m.n;
  for (const double v : x)
    if (std::isfinite(v)) squares += (v - m.mean) * (v - m.mean);
  if (m.n > 1) m.deviation = std::sqrt(squares / (m.n - 1));
  return m;
}

// One quantity of one setting.
struct Verdict {
  const Setting* setting = nullptr;
  const char* quantity = "";
  double mean = 0.0, difference = 0.0, error = 0.0, scatter = 0.0;  // error: standard error of the difference
  bool complete = false;                                            // no run failed
  double bound() const { return std::fabs(difference) + 2.0 * error; }
};

inline std::vector<double> column(const Figures& figures, const std::string& setting, const char* key, std::size_t seeds = 1000) {
  std::vector<double> x;
  for (const auto& run : figures.at(setting)) {
    if (x.size() == seeds) break;
    x.push_back(run.at(key));
  }
  return x;
}

// Differences of the settings of a part to `reference`: of the same seeds, in pairs, or of two means where the beds differ.
inline std::vector<Verdict> judge(const std::vector<const Setting*>& settings, const Setting& reference, const Figures& figures, bool crush, bool pairs) {
  std::vector<Verdict> verdicts;
  for (const Setting* v : settings)
    for (const Quantity& q : quantities) {
      if (!crush && std::string(q.key) == "strength") continue;
      const std::vector<double> x = column(figures, v->name, q.key), x0 = column(figures, reference.name, q.key);
      const Moments own = moments(x), first = moments(x0);
      bool complete = true;
      for (const double code : column(figures, v->name, "exit_code")) complete = complete && code == 0.0;
      Verdict r{v, q.key, own.mean, own.mean - first.mean, std::hypot(own.error(), first.error()), first.deviation, complete};
      if (pairs) {
        std::vector<double> d;
        for (std::size_t k = 0; k < std::min(x.size(), x0.size()); ++k) d.push_back(x[k] - x0[k]);
        const Moments m = moments(d);
        r.difference = m.mean, r.error = m.error();
      }
      if (v == &reference) r.difference = r.error = 0.0;
      verdicts.push_back(r);
    }
  return verdicts;
}

// What a setting costs: particle-steps, which unlike seconds do not depend on what else the machine does [1e9].
inline double work_of(const Figures& figures, const Setting& v) { return moments(column(figures, v.name, "work")).mean; }
inline Moments seconds_of(const Figures& figures, const Setting& v) { return moments(column(figures, v.name, "seconds")); }

// The same of the reference over the seeds that a row has.
inline double reference_work(const Figures& figures, const Setting& reference, const Setting& row) {
  return moments(column(figures, reference.name, "work", figures.at(row.name).size())).mean;
}

// The part's table; `value` prints what varies.
template <class Value>
std::string verdict_table(const std::string& head, const std::vector<Verdict>& verdicts, const Setting& reference, const Figures& figures, const Value& value) {
  std::string lines = "| " + head + " |", rule = "|---|";
  for (const Quantity& q : quantities)
    if (std::any_of(verdicts.begin(), verdicts.end(), [&](const Verdict& v) { return q.key == std::string(v.quantity); })) lines += fmt::format(" {} |", q.name), rule += "---|";
  lines += " bound / scatter | ledger residual / dissipated | 1e9 particle-steps | wall time (s) | below |\n" + rule + "---|---|---|---|---|\n";
  for (std::size_t k = 0; k < verdicts.size();) {
    const Setting& v = *verdicts[k].setting;
    lines += "| " + value(v) + " |";
    double worst = 0.0;
    bool complete = true;
    for (; k < verdicts.size() && verdicts[k].setting == &v; ++k) {
      const Verdict& r = verdicts[k];
      if (&v == &reference) lines += fmt::format(" {:.5g}, seeds ±{:.2g} |", r.mean, r.scatter);
      else lines += fmt::format(" {:+.2g} ± {:.2g} |", r.difference, r.error);
      if (const double share = r.bound() / r.scatter; !(share <= worst) && !std::isnan(worst)) worst = share;  // what is not known stays so
      complete = complete && r.complete;
    }
    const std::size_t seeds = figures.at(v.name).size();
    const std::string few = seeds < figures.at(reference.name).size() ? fmt::format(" (reference, the same {} seeds: {:.3f})", seeds, reference_work(figures, reference, v)) : "";
    lines += fmt::format(" {} | {:.1e} | {:.3f}{} | {:.1f} | {} |\n", &v == &reference ? "" : complete ? fmt::format("{:.2f}", worst) : "", moments(column(figures, v.name, "energy")).mean,
                         work_of(figures, v), few, seconds_of(figures, v).mean,
                         &v == &reference ? "reference" : !complete ? "runs failed" : worst < 0.2 ? "a fifth" : worst < 0.5 ? "half" : worst < 1.0 ? "the scatter" : std::isnan(worst) ? "not known" : "no");
  }
  return lines;
}

// For each quantity and each error that a user may accept: the fastest setting whose bound stays below it.
inline std::string recommendation_table(const std::vector<Verdict>& verdicts, const Figures& figures, bool crush) {
  std::string lines = "| quantity | error accepted | fastest setting | 1e9 particle-steps | bound of its error |\n|---|---|---|---|---|\n";
  for (const Quantity& q : quantities) {
    if (!crush && std::string(q.key) == "strength") continue;
    for (const double accepted : {0.005, 0.01, 0.02, 0.05}) {
      const Verdict* best = nullptr;
      for (const Verdict& v : verdicts) {
        if (q.key != std::string(v.quantity) || !v.complete || !(v.bound() <= accepted * std::fabs(v.mean))) continue;  // nor what is not known
        if (!best || work_of(figures, *v.setting) < work_of(figures, *best->setting)) best = &v;
      }
      if (!best) lines += fmt::format("| {} | {:g} % | none of those measured | | |\n", q.name, 100 * accepted);
      else lines += fmt::format("| {} | {:g} % | {}, plates at {:g} mm/s | {:.3f} | {:.2f} % |\n", q.name, 100 * accepted, best->setting->automatic ? fmt::format("safety {:g}", best->setting->share) : fmt::format("dt = {:g} dt_crit", best->setting->share), 1e3 * best->setting->speed,
                                work_of(figures, *best->setting), 100 * best->bound() / std::fabs(best->mean));
    }
  }
  return lines;
}

}  // namespace platen::bench
