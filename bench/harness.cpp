#include "bench/harness.h"

#include <fmt/format.h>
#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <fstream>
#include <limits>
#include <sstream>
#include <stdexcept>

namespace platen::bench {

double seconds_now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double seconds_of(const std::function<void()>& work) {
  const double start = seconds_now();
  work();
  return seconds_now() - start;
}

std::uint64_t stolen_ticks() {
  std::ifstream file("/proc/stat");
  std::string cpu;
  std::uint64_t value = 0;
  file >> cpu;
  for (int k = 0; k < 8; ++k) file >> value;  // user nice system idle iowait irq softirq steal
  return file ? value : 0;
}

double median(std::vector<double> values) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return n % 2 == 1 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
}

double resident_bytes() {
  malloc_trim(0);
  std::ifstream file("/proc/self/statm");
  double total = 0.0, resident = 0.0;
  if (!(file >> total >> resident)) return std::numeric_limits<double>::quiet_NaN();
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE));
}

std::string processor_name() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);)
    if (line.rfind("model name", 0) == 0) {
      const auto colon = line.find(':');
      if (colon != std::string::npos && colon + 2 < line.size()) return line.substr(colon + 2);
    }
  return "unknown processor";
}

double Timing::best() const {
  return seconds.empty() ? std::numeric_limits<double>::quiet_NaN() : *std::min_element(seconds.begin(), seconds.end());
}

std::vector<Timing> run_in_turn(const std::vector<Variant>& variants, int rounds) {
  std::vector<Timing> clean(variants.size()), all(variants.size());
  const std::size_t n = variants.size();
  int good = 0;
  for (int round = 0; round < 3 * rounds && good < rounds; ++round) {
    std::vector<double> taken(n);
    const std::uint64_t before = stolen_ticks();
    for (std::size_t k = 0; k < n; ++k) {
      const std::size_t which =
          round % 2 == 0 ? k : n - 1 - k;  // a b, b a, a b ...: no place in the row has an advantage
      taken[which] = variants[which].run();
    }
    const bool stolen = stolen_ticks() != before;
    for (std::size_t k = 0; k < n; ++k) {
      all[k].seconds.push_back(taken[k]);
      if (stolen)
        ++clean[k].dropped;
      else
        clean[k].seconds.push_back(taken[k]);
    }
    if (!stolen) ++good;
  }
  if (good > 0) return clean;
  for (Timing& timing : all) timing.steal_kept = true;
  return all;
}

double median_ratio(const Timing& a, const Timing& b) {
  std::vector<double> ratios;
  for (std::size_t k = 0; k < std::min(a.seconds.size(), b.seconds.size()); ++k)
    ratios.push_back(a.seconds[k] / b.seconds[k]);
  return median(ratios);
}

Table::Table(std::string title, std::vector<Column> columns) : title_(std::move(title)), columns_(std::move(columns)) {
  fmt::print("\n{}\n", title_);
  for (const Column& c : columns_) fmt::print("{:>{}}", c.heading, c.width);
  fmt::print("\n");
  std::fflush(stdout);
}

void Table::add(nlohmann::json row) {
  for (const Column& c : columns_) {
    std::string cell = "-";
    if (const auto it = row.find(c.key); it != row.end()) {
      if (it->is_number_float())
        cell = std::isnan(it->get<double>()) ? "-" : fmt::format("{:.{}f}", it->get<double>(), c.digits);
      else if (it->is_string())
        cell = it->get<std::string>();
      else if (!it->is_null())
        cell = it->dump();
    }
    fmt::print("{:>{}}", cell, c.width);
  }
  fmt::print("\n");
  std::fflush(stdout);
  rows_.push_back(std::move(row));
}

void write_json(const std::string& path, const std::string& bench, const Table& table) {
  if (path.empty()) return;
  std::ofstream file(path);
  char date[32];
  const std::time_t now = std::time(nullptr);
  std::strftime(date, sizeof date, "%Y-%m-%dT%H:%M:%SZ", std::gmtime(&now));
  const nlohmann::json all = {{"bench", bench},          {"title", table.title()}, {"processor", processor_name()},
                              {"compiler", __VERSION__}, {"date", date},           {"rows", table.rows()}};
  file << all.dump(1) << "\n";
  if (!file.flush()) throw std::runtime_error("cannot write " + path);
}

}  // namespace platen::bench
