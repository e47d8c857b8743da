// Numbers with units: what users write, what must be refused, and that units do not cost a bit of precision.
#include <gtest/gtest.h>

#include <charconv>
#include <cmath>
#include <random>
#include <string>

#include "protocol/units.h"

namespace platen {
namespace {

std::string refusal(const std::string& text, Quantity quantity) {
  try {
    const double value = to_si(text, quantity);
    return "accepted as " + std::to_string(value);
  } catch (const UnitError& error) {
    return error.what();
  }
}

TEST(Units, SpellingsThatUsersWrite) {
  EXPECT_EQ(to_si("2.5 mm", Quantity::length), 2.5e-3);
  EXPECT_EQ(to_si("1 um", Quantity::length), 1e-6);
  EXPECT_EQ(to_si("1 µm", Quantity::length), 1e-6);
  EXPECT_EQ(to_si("0.3m", Quantity::length), 0.3);
  EXPECT_EQ(to_si("5 kN/m", Quantity::stiffness), 5e3);
  EXPECT_EQ(to_si("5 N/mm", Quantity::stiffness), 5e3);
  EXPECT_EQ(to_si("40 kPa", Quantity::stress), 40e3);
  EXPECT_EQ(to_si("25 GPa", Quantity::stress), 25e9);
  EXPECT_EQ(to_si("2000 kg/m3", Quantity::density), 2000.0);
  EXPECT_EQ(to_si("2000 kg/m^3", Quantity::density), 2000.0);
  EXPECT_EQ(to_si("2 g/cm3", Quantity::density), 2000.0);
  EXPECT_EQ(to_si("9.81 m/s2", Quantity::acceleration), 9.81);
  EXPECT_EQ(to_si("9.81 m s-2", Quantity::acceleration), 9.81);
  EXPECT_EQ(to_si("10 mm/s", Quantity::speed), 10e-3);
  EXPECT_EQ(to_si("60 Hz", Quantity::frequency), 60.0);
  EXPECT_EQ(to_si("60 1/s", Quantity::frequency), 60.0);
  EXPECT_EQ(to_si("60 /s", Quantity::frequency), 60.0);
  EXPECT_EQ(to_si("1e-5 s", Quantity::time), 1e-5);
  EXPECT_EQ(to_si("2 min", Quantity::time), 120.0);
  EXPECT_EQ(to_si("-0.4 N", Quantity::force), -0.4);
  EXPECT_EQ(to_si("  +5e3  mN ", Quantity::force), 5.0);
}

TEST(Units, AnotherDimensionIsRefused) {
  for (const char* text : {"2.5 kg", "2.5 mm2", "2.5 m/s", "3 s", "2 N", "5 %", "1 rad"}) {
    EXPECT_NE(refusal(text, Quantity::length).find("wrong dimension, it is not a length"), std::string::npos) << text;
  }
  EXPECT_NE(refusal("2.5 kg", Quantity::length).find("\"2.5 mm\""), std::string::npos) << "an example is shown";
}

// UDUNITS-2 converts a time to a frequency, and revolutions to radians, without a word.
TEST(Units, ReciprocalsAndAnglesAreRefused) {
  for (const char* text : {"0.1 s", "60 rpm", "60 rad/s", "1 degree/s"}) {
    EXPECT_NE(refusal(text, Quantity::frequency).find("wrong dimension"), std::string::npos) << text;
  }
  EXPECT_NE(refusal("60 Hz", Quantity::time).find("wrong dimension"), std::string::npos);
}

TEST(Units, WhatIsNotANumberWithAUnitIsRefused) {
  const auto says = [](const char* text, const char* what) {
    const std::string said = refusal(text, Quantity::length);
    EXPECT_NE(said.find(what), std::string::npos) << text << " -> " << said;
  };
  says("", "does not begin with a number");
  says("mm", "does not begin with a number");
  says("2.5", "has no unit");
  says("2.5 furlongz", "unknown unit");
  says("2.5 MM", "upper and lower case matter");
  says("2,5 mm", "not one number followed by one unit");
  says("2 500 mm", "not one number followed by one unit");
  says("2.5.1 mm", "not one number followed by one unit");
  says("2 -3 mm", "not one number followed by one unit");
  says("inf mm", "not a finite number");
  says("nan mm", "not a finite number");
  says("1e999 mm", "not a finite number");
  says("1e308 km", "too large");
  says("5 m @ 3", "offset");
}

TEST(Units, AnyBytesAreSafe) {
  std::mt19937 random(1);
  for (int i = 0; i < 20000; ++i) {
    std::string text = i % 2 == 0 ? "1 " : "";
    for (std::size_t n = random() % 12; n > 0; --n) text += static_cast<char>(random() % 256);
    try {
      EXPECT_TRUE(std::isfinite(to_si(text, static_cast<Quantity>(random() % 9))));
    } catch (const UnitError&) {}
  }
}

// Property: a decimal number with a power-of-ten unit has the bits of the SI number written out.
TEST(Units, PowersOfTenCostNoPrecision) {
  struct Row {
    const char* unit;
    Quantity quantity;
    int power;
  };
  constexpr Row rows[] = {
      {"mm", Quantity::length, -3},    {"um", Quantity::length, -6},     {"nm", Quantity::length, -9},
      {"cm", Quantity::length, -2},    {"kN/m", Quantity::stiffness, 3}, {"kPa", Quantity::stress, 3},
      {"MPa", Quantity::stress, 6},    {"GPa", Quantity::stress, 9},     {"us", Quantity::time, -6},
      {"ms", Quantity::time, -3},      {"mm/s", Quantity::speed, -3},    {"mN", Quantity::force, -3},
      {"kHz", Quantity::frequency, 3}, {"g/cm3", Quantity::density, 3},  {"mm/s2", Quantity::acceleration, -3}};
  std::mt19937_64 random(7);
  for (int i = 0; i < 5000; ++i) {
    const Row& row = rows[random() % std::size(rows)];
    const int digits_after = static_cast<int>(random() % 6), exponent = static_cast<int>(random() % 13) - 6;
    std::string number = std::to_string(random() % 1000) + "." +
                         std::to_string(random() % 1000000).substr(0, 1u + static_cast<unsigned>(digits_after));
    const std::string written = exponent == 0 ? number : number + "e" + std::to_string(exponent);
    const std::string si = number + "e" + std::to_string(exponent + row.power);
    EXPECT_EQ(to_si(written + " " + row.unit, row.quantity), std::stod(si)) << written << " " << row.unit;
  }
}

// Property: converting is linear, also for units that are no power of ten.
TEST(Units, OtherUnitsScale) {
  std::mt19937_64 random(3);
  for (int i = 0; i < 1000; ++i) {
    const double x = static_cast<double>(random() % 1000000) / 64.0;  // exact in decimals
    const std::string number = std::to_string(x);
    // One rounding in the factor, one in the product.
    EXPECT_NEAR(to_si(number + " inch", Quantity::length), x * 0.0254, 4e-16 * x * 0.0254);
    EXPECT_NEAR(to_si(number + " h", Quantity::time), x * 3600.0, 4e-16 * x * 3600.0);
  }
}

}  // namespace
}  // namespace platen
