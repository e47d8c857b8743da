// Reading the keys of one table: types, units, ranges, unknown keys. Every key is named once, where it is read.
#pragma once

#include <initializer_list>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "protocol/case_document.h"
#include "protocol/units.h"

namespace platen {

// All that is wrong with a case, in the order of the file.
class Problems {
 public:
  // One line `where: key: what`; `key` may be empty.
  void add(const Position& where, const std::string& key, const std::string& what);
  void add_line(const std::string& message);  // a whole line, about another file
  bool empty() const { return found_.empty(); }
  std::string text() const;  // one a line: by line and column of the file, then overrides, then other files

 private:
  struct Problem {
    Position where;
    std::string message;
  };
  std::vector<Problem> found_;
};

// Allowed values, in SI units.
struct Range {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool with_low = true, with_high = true;  // are the ends allowed
  bool contains(double value) const;       // false for NaN and infinities
  std::string text() const;                // "> 0", ">= 0", "in (0, 1]"
};
inline constexpr double infinite = std::numeric_limits<double>::infinity();
inline constexpr Range positive{0.0, infinite, false, false};
inline constexpr Range not_negative{0.0, infinite, true, false};
inline constexpr Range not_positive{-infinite, 0.0, false, true};
inline constexpr Range fraction{0.0, 1.0, false, false};    // (0, 1)
inline constexpr Range proper_part{0.0, 1.0, false, true};  // (0, 1]
inline constexpr Range part_or_all{0.0, 1.0, true, true};   // [0, 1]

enum class Need { optional, required };

// The word of `known` that takes the fewest edits (insert, delete, replace, swap neighbours) to reach from `word`;
// empty if none is near enough to be what was meant.
std::string nearest_word(std::string_view word, const std::vector<std::string>& known);

// The name of each stage by position in the file: `name`, or the kind, numbered when repeated (compress, compress-2).
// Takes the list `stage` of the case; entries that are too broken to have a name get an empty one.
std::vector<std::string> stage_names(const CaseValue& stages);

// Each read function returns true if the key is there and good, and only then changes `out`; what is wrong goes to
// Problems. A table that is absent reads as one without keys.
class TableReader {
 public:
  // table may be nullptr; `missing` is the place that errors point at then.
  TableReader(const CaseValue* table, std::string path, Position missing, Problems& problems);

  bool present() const { return table_ != nullptr; }
  bool has(std::string_view key);
  const CaseEntry* entry(std::string_view key);  // nullptr if absent
  std::string path(std::string_view key) const;  // "particles.law.k1"
  Position where(std::string_view key) const;    // of the value, else of the table
  void error(std::string_view key, const std::string& what) { problems_->add(where(key), path(key), what); }

  bool quantity(std::string_view key, Quantity quantity, Range range, Need need, double& out);
  bool quantity(std::string_view key, Quantity quantity, Range range, Need need, std::optional<double>& out);
  // A quantity or one word that stands for "no value" ("auto", "off"), which empties `out`.
  bool quantity_or(std::string_view key, Quantity quantity, Range range, std::string_view word,
                   std::optional<double>& out);
  bool number(std::string_view key, Range range, Need need, double& out, const std::string& no_unit = "");
  bool number(std::string_view key, Range range, Need need, std::optional<double>& out);
  bool integer(std::string_view key, std::int64_t low, std::int64_t high, Need need, std::int64_t& out);
  bool integer_or(std::string_view key, std::int64_t low, std::int64_t high, std::string_view word,
                  std::optional<std::int64_t>& out);
  bool flag(std::string_view key, bool& out);
  bool text(std::string_view key, Need need, std::string& out);
  // One of the words; the index of the word found.
  bool word(std::string_view key, const std::vector<std::string>& words, Need need, std::size_t& out);
  bool quantities(std::string_view key, Quantity quantity, Range range, Need need, std::vector<double>& out);
  bool numbers(std::string_view key, Range range, Need need, std::vector<double>& out);
  // An inner table; a reader without keys if absent or (reported) of another type.
  TableReader table(std::string_view key, Need need = Need::optional);

  // Reports every key that nobody asked for. `who` names the table in words: "a compress stage".
  void refuse_unknown(const std::string& who);

 private:
  const CaseValue* look(std::string_view key, Need need, const std::string& wanted);
  void wrong(const CaseValue& value, std::string_view key, const std::string& what, const std::string& allowed);
  std::optional<double> convert(const CaseValue& value, std::string_view key, Quantity quantity, Range range);
  std::optional<double> plain(const CaseValue& value, std::string_view key, Range range, const std::string& no_unit);

  const CaseValue* table_;
  std::string path_;
  Position missing_;
  Problems* problems_;
  std::vector<std::string> known_;
};

}  // namespace platen
