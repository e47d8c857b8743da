#include "protocol/case_reader.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

namespace platen {
namespace {

std::string join(const std::vector<std::string>& words) { return fmt::format("{}", fmt::join(words, ", ")); }

std::string shown(const CaseValue& value) {
  std::string text = to_toml_value(value);
  if (text.size() <= 60) return text;
  // Not inside a character: the text is UTF-8.
  std::size_t cut = 57;
  while (cut > 0 && (static_cast<unsigned char>(text[cut]) & 0xc0) == 0x80) --cut;
  return text.substr(0, cut) + "...";
}

std::string allowed_quantity(Quantity quantity, Range range) {
  const std::string bounds = range.text();
  return fmt::format("allowed: {}{}{}, a plain number in {} or a string with such a unit, as \"{}\"", name_of(quantity),
                     bounds.empty() ? "" : " ", bounds, si_unit_of(quantity), example_of(quantity));
}

std::string allowed_number(Range range) {
  const std::string bounds = range.text();
  return fmt::format("allowed: a plain number{}{}", bounds.empty() ? "" : " ", bounds);
}

}  // namespace

void Problems::add(const Position& where, const std::string& key, const std::string& what) {
  found_.push_back({where, to_string(where) + ": " + (key.empty() ? "" : key + ": ") + what});
}

void Problems::add_line(const std::string& message) { found_.push_back({Position(), message}); }

std::string Problems::text() const {
  std::vector<Problem> sorted = found_;
  std::stable_sort(sorted.begin(), sorted.end(), [](const Problem& a, const Problem& b) {
    if ((a.where.line == 0) != (b.where.line == 0)) return b.where.line == 0;
    return std::pair(a.where.line, a.where.column) < std::pair(b.where.line, b.where.column);
  });
  std::string out;
  for (const Problem& problem : sorted) out += (out.empty() ? "" : "\n") + problem.message;
  return out;
}

bool Range::contains(double value) const {
  return std::isfinite(value) && (with_low ? value >= low : value > low) && (with_high ? value <= high : value < high);
}

std::string Range::text() const {
  const bool has_low = std::isfinite(low), has_high = std::isfinite(high);
  if (has_low && has_high) return fmt::format("in {}{}, {}{}", with_low ? '[' : '(', low, high, with_high ? ']' : ')');
  if (has_low) return fmt::format("{} {}", with_low ? ">=" : ">", low);
  if (has_high) return fmt::format("{} {}", with_high ? "<=" : "<", high);
  return {};
}

std::string nearest_word(std::string_view word, const std::vector<std::string>& known) {
  std::string best;
  std::size_t best_distance = 0;
  for (const std::string& candidate : known) {
    // Optimal string alignment; rows of the usual table, of which the last three are needed.
    const std::size_t m = candidate.size();
    std::vector<std::size_t> older(m + 1), last(m + 1), now(m + 1);
    for (std::size_t j = 0; j <= m; ++j) last[j] = j;
    for (std::size_t i = 1; i <= word.size(); ++i) {
      now[0] = i;
      for (std::size_t j = 1; j <= m; ++j) {
        const std::size_t replace = last[j - 1] + (word[i - 1] == candidate[j - 1] ? 0 : 1);
        now[j] = std::min({last[j] + 1, now[j - 1] + 1, replace});
        if (i > 1 && j > 1 && word[i - 1] == candidate[j - 2] && word[i - 2] == candidate[j - 1]) {
          now[j] = std::min(now[j], older[j - 2] + 1);
        }
      }
      std::swap(older, last);
      std::swap(last, now);
    }
    if (best.empty() || last[m] < best_distance) {
      best = candidate;
      best_distance = last[m];
    }
  }
  // More edits than half the word: it was meant to be something else.
  return best_distance <= std::max<std::size_t>(1, (std::max(word.size(), best.size()) + 1) / 2) ? best : "";
}

std::vector<std::string> stage_names(const CaseValue& stages) {
  std::vector<std::string> names;
  std::map<std::string, int> repeats;
  for (const CaseValue& stage : stages.items) {
    const CaseEntry* const name = stage.find("name");
    const CaseEntry* const kind = stage.find("kind");
    if (name != nullptr) {
      names.push_back(name->value.type == CaseValue::Type::text ? name->value.text : "");
    } else if (kind != nullptr && kind->value.type == CaseValue::Type::text) {
      const int count = ++repeats[kind->value.text];
      names.push_back(count > 1 ? fmt::format("{}-{}", kind->value.text, count) : kind->value.text);
    } else {
      names.emplace_back();
    }
  }
  return names;
}

TableReader::TableReader(const CaseValue* table, std::string path, Position missing, Problems& problems)
    : table_(table), path_(std::move(path)), missing_(std::move(missing)), problems_(&problems) {}

bool TableReader::has(std::string_view key) {
  if (std::find(known_.begin(), known_.end(), key) == known_.end()) known_.emplace_back(key);
  return table_ != nullptr && table_->find(key) != nullptr;
}

const CaseEntry* TableReader::entry(std::string_view key) { return has(key) ? table_->find(key) : nullptr; }

std::string TableReader::path(std::string_view key) const {
  if (key.empty()) return path_;
  return path_.empty() ? std::string(key) : path_ + "." + std::string(key);
}

Position TableReader::where(std::string_view key) const {
  if (table_ == nullptr) return missing_;
  const CaseEntry* const entry = table_->find(key);
  return entry == nullptr ? table_->where : entry->value.where;
}

const CaseValue* TableReader::look(std::string_view key, Need need, const std::string& wanted) {
  if (has(key)) return &table_->find(key)->value;
  // Keys of an absent table are not missed one by one: that the table is missing is said once, where it is read.
  if (need == Need::required && table_ != nullptr) error(key, "is missing; " + wanted);
  return nullptr;
}

void TableReader::wrong(const CaseValue& value, std::string_view key, const std::string& what,
                        const std::string& allowed) {
  // An override without quotes was taken as a string: say so, the quotes may be what is missing.
  const std::string hint = value.guessed ? " (not valid TOML, so taken as a string; TOML strings need quotes)" : "";
  problems_->add(value.where, path(key), what + hint + "; " + allowed);
}

std::optional<double> TableReader::convert(const CaseValue& value, std::string_view key, Quantity quantity,
                                           Range range) {
  const std::string allowed = allowed_quantity(quantity, range);
  double x = 0.0;
  if (value.type == CaseValue::Type::integer) {
    x = static_cast<double>(value.integer);
  } else if (value.type == CaseValue::Type::real) {
    x = value.real;
  } else if (value.type == CaseValue::Type::text) {
    try {
      x = to_si(value.text, quantity);
    } catch (const UnitError& error) {
      // The part after the first semicolon repeats what is allowed, without the range.
      const std::string what = error.what();
      wrong(value, key, what.substr(0, what.rfind("; allowed:")), allowed);
      return std::nullopt;
    }
  } else {
    wrong(value, key, fmt::format("is {}, wrong type", type_name(value.type)), allowed);
    return std::nullopt;
  }
  if (!range.contains(x)) {
    wrong(value, key, fmt::format("{} is {}", shown(value), std::isfinite(x) ? "out of range" : "not a finite number"),
          allowed);
    return std::nullopt;
  }
  return x;
}

std::optional<double> TableReader::plain(const CaseValue& value, std::string_view key, Range range,
                                         const std::string& no_unit) {
  double x = 0.0;
  if (value.type == CaseValue::Type::integer) {
    x = static_cast<double>(value.integer);
  } else if (value.type == CaseValue::Type::real) {
    x = value.real;
  } else if (value.type == CaseValue::Type::text) {
    wrong(value, key,
          fmt::format("{} is a string, but {}", shown(value),
                      no_unit.empty() ? "this key has no dimension and takes no unit" : no_unit),
          allowed_number(range));
    return std::nullopt;
  } else {
    wrong(value, key, fmt::format("is {}, wrong type", type_name(value.type)), allowed_number(range));
    return std::nullopt;
  }
  if (!range.contains(x)) {
    wrong(value, key, fmt::format("{} is {}", shown(value), std::isfinite(x) ? "out of range" : "not a finite number"),
          allowed_number(range));
    return std::nullopt;
  }
  return x;
}

bool TableReader::quantity(std::string_view key, Quantity quantity, Range range, Need need, double& out) {
  const CaseValue* const value = look(key, need, allowed_quantity(quantity, range));
  if (value == nullptr) return false;
  const std::optional<double> x = convert(*value, key, quantity, range);
  if (x) out = *x;
  return x.has_value();
}

bool TableReader::quantity(std::string_view key, Quantity quantity, Range range, Need need,
                           std::optional<double>& out) {
  double x = 0.0;
  if (!this->quantity(key, quantity, range, need, x)) return false;
  out = x;
  return true;
}

bool TableReader::quantity_or(std::string_view key, Quantity quantity, Range range, std::string_view word,
                              std::optional<double>& out) {
  if (!has(key)) return false;
  const CaseValue& value = table_->find(key)->value;
  if (value.type == CaseValue::Type::text && value.text == word) {
    out.reset();
    return true;
  }
  // A word that is no number at all was meant to be the word that is known here.
  if (value.type == CaseValue::Type::text && value.text.find_first_of("0123456789") == std::string::npos) {
    wrong(value, key, fmt::format("{} is unknown", shown(value)),
          fmt::format("allowed: \"{}\" or {}", word, allowed_quantity(quantity, range).substr(9)));
    return false;
  }
  return this->quantity(key, quantity, range, Need::optional, out);
}

bool TableReader::number(std::string_view key, Range range, Need need, double& out, const std::string& no_unit) {
  const CaseValue* const value = look(key, need, allowed_number(range));
  if (value == nullptr) return false;
  const std::optional<double> x = plain(*value, key, range, no_unit);
  if (x) out = *x;
  return x.has_value();
}

bool TableReader::number(std::string_view key, Range range, Need need, std::optional<double>& out) {
  double x = 0.0;
  if (!number(key, range, need, x)) return false;
  out = x;
  return true;
}

bool TableReader::integer(std::string_view key, std::int64_t low, std::int64_t high, Need need, std::int64_t& out) {
  const std::string allowed = fmt::format("allowed: a whole number from {} to {}", low, high);
  const CaseValue* const value = look(key, need, allowed);
  if (value == nullptr) return false;
  if (value->type != CaseValue::Type::integer) {
    wrong(*value, key, fmt::format("is {}, wrong type", type_name(value->type)), allowed);
    return false;
  }
  if (value->integer < low || value->integer > high) {
    wrong(*value, key, fmt::format("{} is out of range", value->integer), allowed);
    return false;
  }
  out = value->integer;
  return true;
}

bool TableReader::integer_or(std::string_view key, std::int64_t low, std::int64_t high, std::string_view word,
                             std::optional<std::int64_t>& out) {
  if (!has(key)) return false;
  const CaseValue& value = table_->find(key)->value;
  if (value.type == CaseValue::Type::text) {
    if (value.text != word) {
      wrong(value, key, fmt::format("{} is unknown", shown(value)),
            fmt::format("allowed: \"{}\" or a whole number from {} to {}", word, low, high));
      return false;
    }
    out.reset();
    return true;
  }
  std::int64_t x = 0;
  if (!integer(key, low, high, Need::optional, x)) return false;
  out = x;
  return true;
}

bool TableReader::flag(std::string_view key, bool& out) {
  const CaseValue* const value = look(key, Need::optional, "");
  if (value == nullptr) return false;
  if (value->type != CaseValue::Type::boolean) {
    wrong(*value, key, fmt::format("is {}, wrong type", type_name(value->type)), "allowed: true or false");
    return false;
  }
  out = value->boolean;
  return true;
}

bool TableReader::text(std::string_view key, Need need, std::string& out) {
  const CaseValue* const value = look(key, need, "allowed: a string");
  if (value == nullptr) return false;
  if (value->type != CaseValue::Type::text) {
    wrong(*value, key, fmt::format("is {}, wrong type", type_name(value->type)), "allowed: a string");
    return false;
  }
  out = value->text;
  return true;
}

bool TableReader::word(std::string_view key, const std::vector<std::string>& words, Need need, std::size_t& out) {
  std::vector<std::string> quoted;
  for (const std::string& w : words) quoted.push_back("\"" + w + "\"");
  const std::string allowed = "allowed: " + join(quoted);
  const CaseValue* const value = look(key, need, allowed);
  if (value == nullptr) return false;
  if (value->type != CaseValue::Type::text) {
    wrong(*value, key, fmt::format("is {}, wrong type", type_name(value->type)), allowed);
    return false;
  }
  const auto found = std::find(words.begin(), words.end(), value->text);
  if (found == words.end()) {
    const std::string near = nearest_word(value->text, words);
    wrong(*value, key, fmt::format("{} is unknown", shown(*value)),
          allowed + (near.empty() ? "" : "; nearest known word: " + near));
    return false;
  }
  out = static_cast<std::size_t>(found - words.begin());
  return true;
}

bool TableReader::quantities(std::string_view key, Quantity quantity, Range range, Need need,
                             std::vector<double>& out) {
  const std::string allowed = "allowed: a list, each of " + allowed_quantity(quantity, range).substr(9);
  const CaseValue* const value = look(key, need, allowed);
  if (value == nullptr) return false;
  if (value->type != CaseValue::Type::list || value->items.empty()) {
    wrong(*value, key,
          value->type == CaseValue::Type::list ? "is empty" : fmt::format("is {}, wrong type", type_name(value->type)),
          allowed);
    return false;
  }
  std::vector<double> all;
  for (const CaseValue& item : value->items) {
    if (const std::optional<double> x = convert(item, key, quantity, range)) all.push_back(*x);
  }
  if (all.size() != value->items.size()) return false;
  out = std::move(all);
  return true;
}

bool TableReader::numbers(std::string_view key, Range range, Need need, std::vector<double>& out) {
  const std::string allowed = "allowed: a list, each of " + allowed_number(range).substr(9);
  const CaseValue* const value = look(key, need, allowed);
  if (value == nullptr) return false;
  if (value->type != CaseValue::Type::list || value->items.empty()) {
    wrong(*value, key,
          value->type == CaseValue::Type::list ? "is empty" : fmt::format("is {}, wrong type", type_name(value->type)),
          allowed);
    return false;
  }
  std::vector<double> all;
  for (const CaseValue& item : value->items) {
    if (const std::optional<double> x = plain(item, key, range, "")) all.push_back(*x);
  }
  if (all.size() != value->items.size()) return false;
  out = std::move(all);
  return true;
}

TableReader TableReader::table(std::string_view key, Need need) {
  const CaseValue* value = look(key, need, fmt::format("allowed: a table [{}]", path(key)));
  if (value != nullptr && value->type != CaseValue::Type::table) {
    wrong(*value, key, fmt::format("is {}, wrong type", type_name(value->type)), "allowed: a table");
    value = nullptr;
  }
  return TableReader(value, path(key), where(key), *problems_);
}

void TableReader::refuse_unknown(const std::string& who) {
  if (table_ == nullptr) return;
  for (const CaseEntry& entry : table_->entries) {
    if (std::find(known_.begin(), known_.end(), entry.key) != known_.end()) continue;
    const std::string near = nearest_word(entry.key, known_);
    problems_->add(entry.where, path(entry.key),
                   fmt::format("unknown key; allowed in {}: {}{}", who, join(known_),
                               near.empty() ? "" : "; nearest known key: " + near));
  }
}

}  // namespace platen
