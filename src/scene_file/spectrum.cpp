// Spectra to linear Rec.709: the CIE 1931 observer, the illuminant D65, lists and files of samples.
#include "src/scene_file/spectrum.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "src/base/text.h"

namespace limn {

namespace {

constexpr double kFirst = 360, kLast = 830;  // nm, of the tables
constexpr size_t kEntries = 95;
using Table = std::array<double, kEntries>;

// The CIE 1931 standard observer (2 degrees) and the relative power of D65, every 5 nm.
constexpr Table kX = {
    0.0001299,   0.0002321,   0.0004149,   0.0007416,   0.001368,    0.002236,    0.004243,
    0.00765,     0.01431,     0.02319,     0.04351,     0.07763,     0.13438,     0.21477,
    0.2839,      0.3285,      0.34828,     0.34806,     0.3362,      0.3187,      0.2908,
    0.2511,      0.19536,     0.1421,      0.09564,     0.05795,     0.03201,     0.0147,
    0.0049,      0.0024,      0.0093,      0.0291,      0.06327,     0.1096,      0.1655,
    0.22575,     0.2904,      0.3597,      0.43345,     0.51205,     0.5945,      0.6784,
    0.7621,      0.8425,      0.9163,      0.9786,      1.0263,      1.0567,      1.0622,
    1.0456,      1.0026,      0.9384,      0.85445,     0.7514,      0.6424,      0.5419,
    0.4479,      0.3608,      0.2835,      0.2187,      0.1649,      0.1212,      0.0874,
    0.0636,      0.04677,     0.0329,      0.0227,      0.01584,     0.0113592,   0.00811092,
    0.00579035,  0.00410946,  0.00289933,  0.00204919,  0.00143997,  0.000999949, 0.000690079,
    0.000476021, 0.000332301, 0.000234826, 0.000166151, 0.000117413, 8.30753e-05, 5.87065e-05,
    4.15099e-05, 2.93533e-05, 2.06738e-05, 1.45598e-05, 1.0254e-05,  7.22146e-06, 5.08587e-06,
    3.58165e-06, 2.52253e-06, 1.77651e-06, 1.25114e-06};
constexpr Table kY = {
    3.917e-06,  6.965e-06,  1.239e-05,  2.202e-05,  3.9e-05,    6.4e-05,    0.00012,    0.000217,
    0.000396,   0.00064,    0.00121,    0.00218,    0.004,      0.0073,     0.0116,     0.01684,
    0.023,      0.0298,     0.038,      0.048,      0.06,       0.0739,     0.09098,    0.1126,
    0.13902,    0.1693,     0.20802,    0.2586,     0.323,      0.4073,     0.503,      0.6082,
    0.71,       0.7932,     0.862,      0.91485,    0.954,      0.9803,     0.99495,    1,
    0.995,      0.9786,     0.952,      0.9154,     0.87,       0.8163,     0.757,      0.6949,
    0.631,      0.5668,     0.503,      0.4412,     0.381,      0.321,      0.265,      0.217,
    0.175,      0.1382,     0.107,      0.0816,     0.061,      0.04458,    0.032,      0.0232,
    0.017,      0.01192,    0.00821,    0.005723,   0.004102,   0.002929,   0.002091,   0.001484,
    0.001047,   0.00074,    0.00052,    0.0003611,  0.0002492,  0.0001719,  0.00012,    8.48e-05,
    6e-05,      4.24e-05,   3e-05,      2.12e-05,   1.499e-05,  1.06e-05,   7.4657e-06, 5.2578e-06,
    3.7029e-06, 2.6078e-06, 1.8366e-06, 1.2934e-06, 9.1093e-07, 6.4153e-07, 4.5181e-07};
constexpr Table kZ = {
    0.0006061, 0.001086, 0.001946, 0.003486, 0.00645, 0.01055, 0.02005, 0.03621, 0.06785, 0.1102,
    0.2074,    0.3713,   0.6456,   1.03905,  1.3856,  1.62296, 1.74706, 1.7826,  1.77211, 1.7441,
    1.6692,    1.5281,   1.28764,  1.0419,   0.81295, 0.6162,  0.46518, 0.3533,  0.272,   0.2123,
    0.1582,    0.1117,   0.07825,  0.05725,  0.04216, 0.02984, 0.0203,  0.0134,  0.00875, 0.00575,
    0.0039,    0.00275,  0.0021,   0.0018,   0.00165, 0.0014,  0.0011,  0.001,   0.0008,  0.0006,
    0.00034,   0.00024,  0.00019,  0.0001,   5e-05,   3e-05,   2e-05,   1e-05,   0,       0,
    0,         0,        0,        0,        0,       0,       0,       0,       0,       0,
    0,         0,        0,        0,        0,       0,       0,       0,       0,       0,
    0,         0,        0,        0,        0,       0,       0,       0,       0,       0,
    0,         0,        0,        0,        0};
constexpr Table kD65 = {
    46.6383, 49.3637, 52.0891, 51.0323, 49.9755, 52.3118, 54.6482, 68.7015, 82.7549, 87.1204,
    91.486,  92.4589, 93.4318, 90.057,  86.6823, 95.7736, 104.865, 110.936, 117.008, 117.41,
    117.812, 116.336, 114.861, 115.392, 115.923, 112.367, 108.811, 109.082, 109.354, 108.578,
    107.802, 106.296, 104.79,  106.239, 107.689, 106.047, 104.405, 104.225, 104.046, 102.023,
    100,     98.1671, 96.3342, 96.0611, 95.788,  92.2368, 88.6856, 89.3459, 90.0062, 89.8026,
    89.5991, 88.6489, 87.6987, 85.4936, 83.2886, 83.4939, 83.6992, 81.863,  80.0268, 80.1207,
    80.2146, 81.2462, 82.2778, 80.281,  78.2842, 74.0027, 69.7213, 70.6652, 71.6091, 72.979,
    74.349,  67.9765, 61.604,  65.7448, 69.8856, 72.4863, 75.087,  69.3398, 63.5927, 55.0054,
    46.4182, 56.6118, 66.8054, 65.0941, 63.3828, 63.8434, 64.304,  61.8779, 59.4519, 55.7054,
    51.959,  54.6998, 57.4406, 58.8765, 60.3125};

// Mitsuba's constants: the integral of kY, and the mean of kD65 weighed by it.
constexpr double kIntegralOfY = 106.7502593994140625;
constexpr double kMeanOfD65 = 98.99741751876255;

double look_up(const Table& table, double wavelength) {
  const double position =
      std::clamp((wavelength - kFirst) / (kLast - kFirst), 0.0, 1.0) * (kEntries - 1);
  const size_t below = std::min(static_cast<size_t>(position), kEntries - 2);
  return std::lerp(table[below], table[below + 1], position - static_cast<double>(below));
}

double look_up(std::span<const SpectrumSample> samples, double wavelength) {
  const auto above = std::upper_bound(
      samples.begin(), samples.end(), wavelength,
      [](double w, const SpectrumSample& sample) { return w < sample.wavelength; });
  if (above == samples.begin()) return 0;
  const SpectrumSample& a = *(above - 1);
  if (above == samples.end()) return wavelength == a.wavelength ? a.value : 0;
  return std::lerp(a.value, above->value,
                   (wavelength - a.wavelength) / (above->wavelength - a.wavelength));
}

// Linear Rec.709 from XYZ.
Rgb<double> from_xyz(double x, double y, double z) {
  return {3.240479 * x - 1.53715 * y - 0.498535 * z, -0.969256 * x + 1.875991 * y + 0.041556 * z,
          0.055648 * x - 0.204043 * y + 1.057311 * z};
}

Rgb<double> clamped(Rgb<double> c, ColourUse use) {
  const double most = use == ColourUse::kReflectance ? 1 : std::numeric_limits<double>::infinity();
  for (int i = 0; i < 3; ++i) c[i] = std::clamp(c[i], 0.0, most);
  return c;
}

// The integral of `value`, a function of the wavelength [nm], by Mitsuba's 1000 points.
template <class Value>
Rgb<double> integrate(const Value& value, ColourUse use) {
  constexpr int kPoints = 1000;
  double sums[3] = {0, 0, 0};
  for (int i = 0; i < kPoints; ++i) {
    const double wavelength = kFirst + (kLast - kFirst) * i / (kPoints - 1);
    double v = value(wavelength);
    if (use != ColourUse::kEmission) v *= look_up(kD65, wavelength) / kMeanOfD65;
    sums[0] += v * look_up(kX, wavelength);
    sums[1] += v * look_up(kY, wavelength);
    sums[2] += v * look_up(kZ, wavelength);
  }
  const double scale = (kLast - kFirst) / (kPoints * kIntegralOfY);
  return clamped(from_xyz(sums[0] * scale, sums[1] * scale, sums[2] * scale), use);
}

double number_of(std::string_view word, const SourceLocation& where) {
  const std::optional<double> number = parse_double(word);
  if (!number || !(std::fabs(*number) <= std::numeric_limits<float>::max())) {
    throw InputError(where,
                     "a spectrum has wavelengths and values that are finite numbers, not \"" +
                         std::string(word.substr(0, 32)) + "\"");
  }
  return *number;
}

void check(const std::vector<SpectrumSample>& samples, const SourceLocation& where) {
  if (samples.size() < 2) throw InputError(where, "a spectrum needs two wavelengths at least");
  if (samples.size() > kMaxSpectrumSamples) {
    throw InputError(where, "a spectrum has more than 100000 wavelengths");
  }
  for (size_t i = 1; i < samples.size(); ++i) {
    if (samples[i - 1].wavelength < samples[i].wavelength) continue;
    throw InputError(where, "the wavelengths of a spectrum must increase");
  }
}

}  // namespace

Rgb<double> integrate_spectrum(std::span<const SpectrumSample> samples, ColourUse use) {
  return integrate([&](double wavelength) { return look_up(samples, wavelength); }, use);
}

Rgb<double> constant_spectrum(double value, ColourUse use) {
  if (use != ColourUse::kEmission) return grey(value);
  const Rgb<double> white = from_xyz(1, 1, 1);
  return {white.r * value, white.g * value, white.b * value};
}

// Planck's law.
Rgb<double> blackbody(double temperature) {
  constexpr double kPlanck = 6.62607015e-34, kLight = 299792458, kBoltzmann = 1.380649e-23;
  const auto radiance = [&](double nanometres) {
    const double w = nanometres * 1e-9;
    const double exponent = kPlanck * kLight / (w * kBoltzmann * temperature);
    return 2e-9 * kPlanck * kLight * kLight / (std::pow(w, 5) * std::expm1(exponent));
  };
  return integrate(radiance, ColourUse::kEmission);
}

std::vector<SpectrumSample> parse_spectrum(const std::string& text, const SourceLocation& where) {
  std::vector<SpectrumSample> samples;
  for (std::string_view word : split(text, ", \t\r\n")) {
    const size_t colon = word.find(':');
    if (colon == word.npos) {
      throw InputError(where, "a spectrum is one number or \"400:0.5, 500:0.6\", not \"" +
                                  text.substr(0, 64) + "\"");
    }
    samples.push_back(
        {number_of(word.substr(0, colon), where), number_of(word.substr(colon + 1), where)});
  }
  check(samples, where);
  return samples;
}

std::vector<SpectrumSample> read_spectrum_file(const std::string& file) {
  const std::string text = read_whole_file(file);
  std::vector<SpectrumSample> samples;
  std::string_view rest = text;
  for (int line = 1; !rest.empty(); ++line) {
    const size_t end = std::min(rest.find('\n'), rest.size());
    const std::string_view content = rest.substr(0, std::min(end, rest.find('#')));
    rest.remove_prefix(std::min(end + 1, rest.size()));
    const std::vector<std::string_view> words = split(content, ", \t\r");
    if (words.empty()) continue;
    const SourceLocation where{file, line, 1};
    if (words.size() != 2 || samples.size() > kMaxSpectrumSamples) {
      throw InputError(where, "a line of a spectrum is \"WAVELENGTH VALUE\"");
    }
    samples.push_back({number_of(words[0], where), number_of(words[1], where)});
  }
  check(samples, {file});
  return samples;
}

std::vector<SpectrumSample> make_spectrum(const std::vector<double>& wavelengths,
                                          const std::vector<double>& values,
                                          const SourceLocation& where) {
  const bool regular = wavelengths.size() == 2 && values.size() > 2;
  if (!regular && wavelengths.size() != values.size()) {
    throw InputError(where, "a spectrum of " + std::to_string(wavelengths.size()) +
                                " wavelengths and " + std::to_string(values.size()) + " values");
  }
  std::vector<SpectrumSample> samples;
  for (size_t i = 0; i < values.size(); ++i) {
    const double share = static_cast<double>(i) / static_cast<double>(values.size() - 1);
    samples.push_back(
        {regular ? std::lerp(wavelengths[0], wavelengths[1], share) : wavelengths[i], values[i]});
  }
  check(samples, where);
  return samples;
}

}  // namespace limn
