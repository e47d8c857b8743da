// What every bench needs: a clock, variants run in turn, medians, and results for people and for machines.
//
// Two figures measured one after the other on a shared machine say little about each other. So whatever is compared runs
// in turn, round after round, in alternating order; a round in which the hypervisor took time away (steal in /proc/stat)
// is dropped and run again; the figure is the median of the rounds.
#pragma once

#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace platen::bench {

double seconds_now();          // monotonic [s]
std::uint64_t stolen_ticks();  // all processors; 0 where the system does not say
double seconds_of(const std::function<void()>& work);
double median(std::vector<double> values);  // NaN without any
double resident_bytes();       // of this process, after freed memory went back to the system; NaN where unknown
std::string processor_name();  // model name of /proc/cpuinfo

struct Variant {
  std::string name;
  std::function<double()> run;  // one block; returns the seconds that count
};

struct Timing {
  std::vector<double> seconds;  // of the rounds that count
  int dropped = 0;              // rounds with steal
  bool steal_kept = false;      // every round had steal: they were kept all the same
  double typical() const { return median(seconds); }
  double best() const;
};

// Runs every variant once a round until `rounds` rounds are free of steal, or three times as many were tried. The
// entries of different variants at the same index belong to the same round.
std::vector<Timing> run_in_turn(const std::vector<Variant>& variants, int rounds);

// Median over the rounds of (time of a)/(time of b).
double median_ratio(const Timing& a, const Timing& b);

// A table printed row by row as it grows; the rows, with everything in them, are kept for the JSON file.
struct Column {
  std::string key;  // of the row's JSON object
  std::string heading;
  int width = 10;
  int digits = 2;  // behind the point, of numbers that are not integers
};

class Table {
 public:
  Table(std::string title, std::vector<Column> columns);
  void add(nlohmann::json row);  // prints it
  const nlohmann::json& rows() const { return rows_; }
  const std::string& title() const { return title_; }

 private:
  std::string title_;
  std::vector<Column> columns_;
  nlohmann::json rows_ = nlohmann::json::array();
};

// {bench, processor, compiler, date, title, rows}. Does nothing for an empty path; throws std::runtime_error.
void write_json(const std::string& path, const std::string& bench, const Table& table);

}  // namespace platen::bench
