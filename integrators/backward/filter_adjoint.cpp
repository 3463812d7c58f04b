// The derivative of what filters weigh, for positions that follow what they see.
#include "integrators/backward/filter_adjoint.h"

#include <algorithm>
#include <cmath>

namespace limn {
namespace {

double magnitude(const Rgb<double>& a) { return std::fabs(a.r) + std::fabs(a.g) + std::fabs(a.b); }

// Of the filters of the crop's columns, or rows, that reach a place along their axis.
struct Reach {
  int first = 0;
  std::vector<double> weight, slope, pdf;  // pdf: of the pixel's samples
};

Reach reach(const Film& film, const FilterTable& table, double at, int begin, int count,
            bool columns) {
  const double radius = film.filter.radius;
  Reach result;
  result.first = std::max(begin, static_cast<int>(std::floor(at - 0.5 - radius)));
  const int last = std::min(begin + count - 1, static_cast<int>(std::ceil(at - 0.5 + radius)));
  for (int i = result.first; i <= last; ++i) {
    const auto range = columns ? film.range_x(i) : film.range_y(i);
    const double offset = at - (i + 0.5);
    const bool reaches = offset >= range.lower && offset <= range.upper;
    const double scale =
        reaches ? 1 / (film.filter.integral(range.upper) - film.filter.integral(range.lower)) : 0;
    result.weight.push_back(film.filter.eval(offset) * scale);
    result.slope.push_back(film.filter.slope(offset) * scale);
    result.pdf.push_back(reaches && film.filter.is_signed()
                             ? table.pdf(range.lower, range.upper, offset)
                             : result.weight.back());
  }
  return result;
}

}  // namespace

FilterAdjoint::FilterAdjoint(const Film& film, const FilmAdjoint& adjoint,
                             const PixelChoice& choice, const FilmField& field)
    : film_(film), table_(film.filter), adjoint_(adjoint), choice_(choice), field_(field) {
  add_lines();
}

// With other filters than a box, the density of all pixels' paths: neighbours' A nearly cancel.
void FilterAdjoint::add_path(const PixelSample& pixel, double paths, const FilmPosition& at,
                             const Rgb<double>& radiance, Tape& tape) const {
  const auto weigh = [&](int x, int y) {
    const Rgb<double>& a = adjoint_.of_pixel(x, y);
    return a.r * radiance.r + a.g * radiance.g + a.b * radiance.b;
  };
  const auto density = [&](int x, int y) {
    return paths * choice_.probability(static_cast<size_t>(y - film_.crop_y) * film_.crop_width +
                                       (x - film_.crop_x));
  };
  double a = 0, along_x = 0, along_y = 0, all = 0;
  if (film_.filter.kind == Filter::Kind::kBox) {
    a = weigh(pixel.x, pixel.y);
    all = density(pixel.x, pixel.y);
  } else {
    const Reach columns = reach(film_, table_, at.x, film_.crop_x, film_.crop_width, true);
    const Reach rows = reach(film_, table_, at.y, film_.crop_y, film_.crop_height, false);
    for (size_t j = 0; j < rows.weight.size(); ++j) {
      for (size_t i = 0; i < columns.weight.size(); ++i) {
        const int x = columns.first + static_cast<int>(i), y = rows.first + static_cast<int>(j);
        const double own = weigh(x, y), weight = columns.weight[i] * rows.weight[j];
        a += own * weight;
        along_x += own * columns.slope[i] * rows.weight[j];
        along_y += own * columns.weight[i] * rows.slope[j];
        all += density(x, y) * columns.pdf[i] * rows.pdf[j];
      }
    }
  }
  for (const FilmField::Corner& corner : field_.at(at)) {
    if (corner.slot == 0) continue;
    tape.contribute(corner.slot, (a * corner.dx + along_x * corner.phi) / all);
    tape.contribute(corner.slot + 1, (a * corner.dy + along_y * corner.phi) / all);
  }
}

void FilterAdjoint::add_lines() {
  const bool box = film_.filter.kind == Filter::Kind::kBox;
  if (!box && film_.sample_border) return;
  const int width = film_.crop_width, height = film_.crop_height;
  double total = 0;
  for (const auto& a : adjoint_.pixels()) total += magnitude(a);
  // A may differ across a line though not at its middle.
  const double even = box ? 0 : 0.25 * total / (static_cast<double>(width) * height);
  for (int x = 0; x <= width; x += box ? 1 : width) {
    for (int y = 0; y < height; ++y) add_line({x, y, true}, even);
  }
  for (int y = 0; y <= height; y += box ? 1 : height) {
    for (int x = 0; x < width; ++x) add_line({x, y, false}, even);
  }
  // As many as make lines about as noisy as the pixels' own part; not tuned.
  if (total > 0) line_samples_ = std::min(1.0, choice_of_line_.sum() / total);
}

void FilterAdjoint::add_line(const Line& line, double even) {
  if (field_.slot(line.column, line.row) == 0 &&
      field_.slot(line.column + !line.vertical, line.row + line.vertical) == 0) {
    return;
  }
  const double weight = magnitude(difference(line, 0.5)) + even;
  if (weight == 0) return;
  lines_.push_back(line);
  choice_of_line_.add(weight);
}

FilmPosition FilterAdjoint::place(const Line& line, double along) const {
  const double x = film_.crop_x + line.column, y = film_.crop_y + line.row;
  return line.vertical ? FilmPosition{x, y + along} : FilmPosition{x + along, y};
}

Rgb<double> FilterAdjoint::difference(const Line& line, double along) const {
  const int count = line.vertical ? film_.crop_width : film_.crop_height;
  const int number = line.vertical ? line.column : line.row;
  if (film_.filter.kind != Filter::Kind::kBox) {
    const FilmPosition at = place(line, along);
    return adjoint_.at(at.x, at.y) * (number == 0 ? 1.0 : -1.0);
  }
  const int x = film_.crop_x + line.column, y = film_.crop_y + line.row;
  Rgb<double> result;
  if (number < count) result += adjoint_.of_pixel(x, y);
  if (number > 0) result += adjoint_.of_pixel(x - line.vertical, y - !line.vertical) * -1.0;
  return result;
}

FilterAdjoint::LinePoint FilterAdjoint::line_point(double u) const {
  const DiscreteDistribution::Draw draw = choice_of_line_.sample(u);
  const Line& line = lines_[draw.index];
  const double along = draw.fraction;
  const uint32_t axis = line.vertical ? 0 : 1;
  LinePoint point{place(line, along), difference(line, along) * (1 / draw.probability), {}, {}};
  for (int k = 0; k < 2; ++k) {
    const uint32_t slot =
        field_.slot(line.column + (line.vertical ? 0 : k), line.row + (line.vertical ? k : 0));
    point.slots[k] = slot == 0 ? 0 : slot + axis;
    point.weights[k] = k == 0 ? 1 - along : along;
  }
  return point;
}

}  // namespace limn
