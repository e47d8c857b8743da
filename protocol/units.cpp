#include "protocol/units.h"

#include <udunits2.h>

#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <memory>

namespace platen {
namespace {

struct QuantityRow {
  const char* name;
  const char* unit;
  const char* example;
};

// In the order of enum Quantity.
constexpr std::array<QuantityRow, 9> quantity_rows{{
    {"a length", "m", "2.5 mm"},
    {"a time", "s", "0.1 s"},
    {"a density", "kg/m3", "2000 kg/m3"},
    {"a stress", "Pa", "40 kPa"},
    {"a force", "N", "-0.4 N"},
    {"a stiffness", "N/m", "5 kN/m"},
    {"a speed", "m/s", "10 mm/s"},
    {"an acceleration", "m/s2", "9.81 m/s2"},
    {"a frequency", "Hz", "60 Hz"},
}};

const QuantityRow& row(Quantity quantity) { return quantity_rows[static_cast<std::size_t>(quantity)]; }

struct FreeUnit {
  void operator()(ut_unit* unit) const { ut_free(unit); }
};
using Unit = std::unique_ptr<ut_unit, FreeUnit>;

struct FreeConverter {
  void operator()(cv_converter* converter) const { cv_free(converter); }
};
using Converter = std::unique_ptr<cv_converter, FreeConverter>;

// The unit database, read once. It is never freed: it lives as long as the program.
ut_system* unit_system() {
  static ut_system* const system = [] {
    ut_set_error_message_handler(ut_ignore);  // our own messages are better and go where they belong
    return ut_read_xml(nullptr);
  }();
  if (system == nullptr) {
    throw std::runtime_error("the unit database of UDUNITS-2 cannot be read (Debian package libudunits2-data)");
  }
  return system;
}

bool is_space(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }

std::string_view trim(std::string_view text) {
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
  return text;
}

std::string quoted(std::string_view text) {
  std::string out(1, '"');
  out += text;
  out += '"';
  return out;
}

std::string wanted(Quantity quantity) {
  return std::string("allowed: a plain number in ") + row(quantity).unit + " or a string with such a unit, as " +
         quoted(row(quantity).example);
}

// number * 10^power with a single rounding: the decimal point is moved in the text.
double shift_decimal(std::string_view number, int power) {
  const std::size_t mark = number.find_first_of("eE");
  int exponent = 0;
  if (mark != std::string_view::npos) {
    std::string_view digits = number.substr(mark + 1);
    if (!digits.empty() && digits.front() == '+') digits.remove_prefix(1);
    std::from_chars(digits.data(), digits.data() + digits.size(), exponent);
  }
  const std::string shifted = std::string(number.substr(0, mark)) + "e" + std::to_string(exponent + power);
  double value = std::numeric_limits<double>::quiet_NaN();
  const auto [end, error] = std::from_chars(shifted.data(), shifted.data() + shifted.size(), value);
  if (error == std::errc::result_out_of_range) return std::numeric_limits<double>::infinity();
  return value;
}

// Radians are a dimensionless base unit of UDUNITS-2 and would pass as 1: "60 rpm" would read as 6.28 Hz.
bool counts_angles(const ut_unit* unit) {
  std::array<char, 256> text{};
  const int length = ut_format(unit, text.data(), text.size() - 1, UT_ASCII | UT_DEFINITION);
  return length > 0 && std::string_view(text.data()).find("rad") != std::string_view::npos;
}

}  // namespace

const char* name_of(Quantity quantity) { return row(quantity).name; }
const char* si_unit_of(Quantity quantity) { return row(quantity).unit; }
const char* example_of(Quantity quantity) { return row(quantity).example; }

double to_si(std::string_view text, Quantity quantity) {
  const std::string_view whole = trim(text);
  std::string_view rest = whole;
  const bool plus = !rest.empty() && rest.front() == '+';
  if (plus) rest.remove_prefix(1);
  double number = 0.0;
  const auto [end, error] = std::from_chars(rest.data(), rest.data() + rest.size(), number);
  if (error == std::errc::invalid_argument || (plus && !rest.empty() && rest.front() == '-')) {
    throw UnitError(quoted(whole) + " does not begin with a number; " + wanted(quantity));
  }
  if (error == std::errc::result_out_of_range || !std::isfinite(number)) {
    throw UnitError(quoted(whole) + " is not a finite number; " + wanted(quantity));
  }
  const std::string_view digits(rest.data(), static_cast<std::size_t>(end - rest.data()));
  rest = trim(rest.substr(digits.size()));
  if (rest.empty()) throw UnitError(quoted(whole) + " has no unit; " + wanted(quantity));

  // "60 /s" and "60 1/s" are one over a second. Any other digit or sign here belongs to a number that was not
  // understood ("2.5.1 mm", "2 500 mm"); UDUNITS-2 would multiply the two.
  std::string unit_text;
  if (rest.front() == '/') unit_text += '1';
  unit_text += rest;
  const bool is_reciprocal = unit_text.starts_with("1/");
  if (!is_reciprocal && std::string_view("0123456789.,+-*^").find(unit_text.front()) != std::string_view::npos) {
    throw UnitError(quoted(whole) + " is not one number followed by one unit; " + wanted(quantity));
  }
  if (unit_text.find('\0') != std::string::npos) throw UnitError("the text holds a zero byte; " + wanted(quantity));

  ut_system* const system = unit_system();
  const Unit unit(ut_parse(system, unit_text.c_str(), UT_UTF8));
  if (!unit) {
    throw UnitError(quoted(whole) + " has an unknown unit " + quoted(rest) + " (upper and lower case matter); " +
                    wanted(quantity));
  }
  // Convertible is not enough: UDUNITS-2 converts between reciprocals. The quotient must be dimensionless.
  const Unit si(ut_parse(system, row(quantity).unit, UT_UTF8));
  const Unit quotient(ut_divide(unit.get(), si.get()));
  const Unit one(ut_get_dimensionless_unit_one(system));
  if (!quotient || ut_are_convertible(quotient.get(), one.get()) == 0 || counts_angles(unit.get())) {
    throw UnitError(quoted(whole) + " has the wrong dimension, it is not " + row(quantity).name + "; " +
                    wanted(quantity));
  }
  const Converter converter(ut_get_converter(unit.get(), si.get()));
  if (!converter) throw UnitError(quoted(whole) + " cannot be converted; " + wanted(quantity));
  const double factor = cv_convert_double(converter.get(), 1.0);
  const bool linear = cv_convert_double(converter.get(), 0.0) == 0.0 &&
                      std::abs(cv_convert_double(converter.get(), 2.0) - 2.0 * factor) <= 1e-12 * std::abs(factor);
  if (!linear) {
    throw UnitError(quoted(whole) + " has a unit with an offset or a logarithm; " + wanted(quantity));
  }
  const double power = std::round(std::log10(factor));
  const bool is_power_of_ten =
      std::abs(power) < 30.0 && std::abs(factor - std::pow(10.0, power)) <= 1e-14 * std::abs(factor);
  const double value = is_power_of_ten ? shift_decimal(digits, static_cast<int>(power)) : number * factor;
  if (!std::isfinite(value)) throw UnitError(quoted(whole) + " is too large; " + wanted(quantity));
  return value;
}

}  // namespace platen
