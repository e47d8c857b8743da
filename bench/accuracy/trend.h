// What the step does to a quantity, from all runs at once. A bed is chaotic: two runs of the same seed with different steps
// differ as two packings do, so that the difference of two settings says little about either. A line through all steps,
// with a level of its own for each seed, uses every run: y = level(seed) + slope dt.
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "bench/accuracy/verdict.h"

namespace platen::bench {

struct Trend {
  double slope = std::nan(""), error = std::nan("");  // per dt_crit, with its standard error
  double scatter = std::nan("");                      // deviation of one packing, all settings together
  int runs = 0;
};

// Mean step of a setting during compression, over dt_crit.
inline double mean_share(const Figures& figures, const Setting& v, double dt_crit) { return moments(column(figures, v.name, "dt")).mean / dt_crit; }

inline Trend trend_over_steps(const std::vector<const Setting*>& settings, const Figures& figures, const char* key, double dt_crit) {
  struct Point {
    double x, y;
  };
  std::map<std::size_t, std::vector<Point>> by_seed;
  double variance = 0.0;
  int samples = 0;
  for (const Setting* v : settings) {
    const std::vector<double> y = column(figures, v->name, key), dt = column(figures, v->name, "dt");
    for (std::size_t seed = 0; seed < y.size(); ++seed)
      if (std::isfinite(y[seed])) by_seed[seed].push_back({dt[seed] / dt_crit, y[seed]});
    if (const Moments m = moments(y); m.n > 1) variance += m.deviation * m.deviation, ++samples;
  }
  Trend t;
  if (samples > 0) t.scatter = std::sqrt(variance / samples);
  double xx = 0.0, xy = 0.0, yy = 0.0;
  for (const auto& [seed, points] : by_seed) {
    double x0 = 0.0, y0 = 0.0;
    for (const Point& p : points) x0 += p.x / static_cast<double>(points.size()), y0 += p.y / static_cast<double>(points.size());
    for (const Point& p : points) xx += (p.x - x0) * (p.x - x0), xy += (p.x - x0) * (p.y - y0), yy += (p.y - y0) * (p.y - y0);
    t.runs += static_cast<int>(points.size());
  }
  const int free = t.runs - static_cast<int>(by_seed.size()) - 1;
  if (xx <= 0.0 || free < 1) return t;
  t.slope = xy / xx;
  t.error = std::sqrt(std::max(0.0, yy - t.slope * xy) / free / xx);
  return t;
}

// For every automatic step: the change that the trend gives between it and a step of zero.
inline std::string trend_table(const std::vector<const Setting*>& settings, const Figures& figures, bool crush, double dt_crit) {
  std::string lines = "| safety | mean step / dt_crit |", rule = "|---|---|";
  std::vector<Trend> trends;
  for (const Quantity& q : quantities) {
    if (!crush && std::string(q.key) == "strength") continue;
    trends.push_back(trend_over_steps(settings, figures, q.key, dt_crit));
    lines += fmt::format(" {}, scatter {:.2g} |", q.name, trends.back().scatter), rule += "---|";
  }
  lines += " bound / scatter |\n" + rule + "---|\n";
  for (const Setting* v : settings) {
    if (!v->automatic) continue;
    const double x = mean_share(figures, *v, dt_crit);
    lines += fmt::format("| {:g} | {:.3f} |", v->value, x);
    std::string bounds;
    for (const Trend& t : trends) {
      lines += fmt::format(" {:+.2g} ± {:.2g} |", t.slope * x, t.error * x);
      bounds += fmt::format("{}{:.2f}", bounds.empty() ? "" : ", ", (std::fabs(t.slope) + 2.0 * t.error) * x / t.scatter);
    }
    lines += " " + bounds + " |\n";
  }
  return lines + fmt::format("\n{} runs.\n", trends.empty() ? 0 : trends.front().runs);
}

}  // namespace platen::bench
