// series.csv, the live log of a run, and the same rows in memory for results.h5.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/output/files.h"
#include "protocol/records.h"

namespace platen {

// One output quantity: one row of the table in series_columns.cpp. Drives series.csv, /series of results.h5, the
// values of summary.json and `platen info`.
struct SeriesColumn {
  enum class Kind { real, count, stage };  // float64; whole number; name of the stage (an enumeration in HDF5)
  const char* name;
  const char* unit;  // "-" without dimension
  const char* description;
  Kind kind;
  double (*value)(const SeriesRow&);  // NaN: no meaning in this row; null for the stage column
};

std::span<const SeriesColumn> series_columns();
std::size_t series_column(std::string_view name);  // its place in the table; the name must exist

// Engineering strain (h0 - h) / h0, compression positive [-].
inline double engineering_strain(double h0, double h) { return (h0 - h) / h0; }

// Rows in memory.
struct SeriesTable {
  std::vector<int> stage;                    // per row, from 0
  std::vector<std::string> stage_names;      // by number of the stage
  std::vector<std::vector<double>> columns;  // as series_columns(); empty cells are NaN; that of the stage stays empty
  std::size_t bytes = 0;                     // of the file that these rows and the header take
  std::size_t rows() const { return stage.size(); }
  const std::vector<double>& column(std::string_view name) const { return columns[series_column(name)]; }
};

// Reads the first `rows` rows (empty: all whole rows; a torn last line is left out). Throws OutputError when there are
// fewer, when a row is damaged or the columns are others.
SeriesTable read_series(const std::filesystem::path& path, std::optional<std::size_t> rows = {});

class SeriesFile {
 public:
  // A new file with its header line. Throws OutputError, as all members do.
  static SeriesFile create(const std::filesystem::path& path);
  // Takes up an existing file: keeps what read_series gives and cuts off what follows.
  static SeriesFile reopen(const std::filesystem::path& path, std::optional<std::size_t> rows);

  // Adds one row; it is handed to the system before this returns. `stage` counts from 0.
  void append(const SeriesRow& row, int stage);
  void sync() { file_.sync(); }
  const SeriesTable& table() const { return table_; }

 private:
  SeriesFile(AppendFile file, SeriesTable table) : file_(std::move(file)), table_(std::move(table)) {}
  AppendFile file_;
  SeriesTable table_;
};

}  // namespace platen
