// What the step, or the speed of the plates, does to a quantity, from all runs at once. A bed is chaotic: two runs of the same
// seed with different steps differ as two packings do, so that the difference of two settings says little about either. A
// line through all settings, with a level of its own for each seed, uses every run: y = level(seed) + slope x.
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "bench/accuracy/verdict.h"

namespace platen::bench {

struct Trend {
  double slope = std::nan(""), error = std::nan("");  // per unit of x, with its standard error
  double scatter = std::nan("");                      // deviation of one packing, all settings together
  int runs = 0;
};

// What varies: x of each run of a setting, and how tables call a setting and its x.
struct TrendAxis {
  std::string setting, x_name;
  std::function<std::vector<double>(const Setting&)> x;
  std::function<bool(const Setting&)> shown;
  std::function<std::string(const Setting&)> value;
};

inline Trend trend_of(const std::vector<const Setting*>& settings, const Figures& figures, const char* key, const TrendAxis& axis) {
  struct Point {
    double x, y;
  };
  std::map<std::size_t, std::vector<Point>> by_seed;
  double variance = 0.0;
  int samples = 0;
  for (const Setting* v : settings) {
    const std::vector<double> y = column(figures, v->name, key), x = axis.x(*v);
    for (std::size_t seed = 0; seed < y.size(); ++seed)
      if (std::isfinite(y[seed])) by_seed[seed].push_back({x[seed], y[seed]});
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

// For every setting that is shown: the change that the trend gives between it and one at x = 0.
inline std::string trend_table(const std::vector<const Setting*>& settings, const Figures& figures, bool crush, const TrendAxis& axis) {
  std::string lines = "| " + axis.setting + " |" + (axis.x_name.empty() ? "" : " " + axis.x_name + " |"), rule = axis.x_name.empty() ? "|---|" : "|---|---|";
  std::vector<Trend> trends;
  for (const Quantity& q : quantities) {
    if (!crush && std::string(q.key) == "strength") continue;
    trends.push_back(trend_of(settings, figures, q.key, axis));
    lines += fmt::format(" {}, scatter {:.2g} |", q.name, trends.back().scatter), rule += "---|";
  }
  lines += " bound / scatter |\n" + rule + "---|\n";
  for (const Setting* v : settings) {
    if (!axis.shown(*v)) continue;
    const double x = moments(axis.x(*v)).mean;
    lines += "| " + axis.value(*v) + " |" + (axis.x_name.empty() ? "" : fmt::format(" {:.3f} |", x));
    std::string bounds;
    for (const Trend& t : trends) {
      lines += fmt::format(" {:+.2g} ± {:.2g} |", t.slope * x, t.error * x);
      bounds += fmt::format("{}{:.2f}", bounds.empty() ? "" : ", ", (std::fabs(t.slope) + 2.0 * t.error) * x / t.scatter);
    }
    lines += " " + bounds + " |\n";
  }
  return lines + fmt::format("\n{} runs.\n", trends.empty() ? 0 : trends.front().runs);
}

// The mean step during compression, over dt_crit.
inline TrendAxis over_steps(const Figures& figures, double dt_crit) {
  return {"safety", "mean step / dt_crit",
          [&figures, dt_crit](const Setting& v) {
            std::vector<double> x = column(figures, v.name, "dt");
            for (double& dt : x) dt /= dt_crit;
            return x;
          },
          [](const Setting& v) { return v.automatic; }, [](const Setting& v) { return fmt::format("{:g}", v.value); }};
}

inline TrendAxis over_speeds(const Figures& figures) {
  return {"plate speed (mm/s)", "", [&figures](const Setting& v) { return std::vector<double>(figures.at(v.name).size(), v.speed); }, [](const Setting&) { return true; },
          [](const Setting& v) { return fmt::format("{:g}", 1e3 * v.speed); }};
}

}  // namespace platen::bench
