// Means and variances from batches, and sums over blocks of pixels.
#include "limn/integrators/moments.h"

#include <cmath>
#include <limits>

namespace limn {

void Moments::add_batch(const std::vector<double>& sums, int64_t samples) {
  // Step by step (West 1979): a difference of two large sums would have lost small variances.
  const auto n = static_cast<double>(samples);
  squared_samples_ += n * n;
  const double share = n * n / squared_samples_;
  for (size_t i = 0; i < sums.size(); ++i) {
    sums_[i] += sums[i];
    const double before = sums[i] / n - centers_[i];
    centers_[i] += share * before;
    squares_[i] += n * n * (1 - share) * before * before;
  }
  samples_ += samples;
  ++batches_;
  if (keep_) kept_.push_back({sums, samples});
}

double Moments::variance(size_t i) const {
  if (batches_ < 2) return std::numeric_limits<double>::quiet_NaN();
  const double aside = centers_[i] - mean(i);
  const auto all = static_cast<double>(samples_);
  return (squares_[i] + squared_samples_ * aside * aside) / (all * all - squared_samples_);
}

double Moments::degrees() const {
  const auto all = static_cast<double>(samples_);
  return batches_ > 0 ? all * all / squared_samples_ - 1 : 0;
}

std::vector<double> means(const Moments& moments) {
  std::vector<double> values(moments.size());
  for (size_t i = 0; i < values.size(); ++i) values[i] = moments.mean(i);
  return values;
}

std::vector<double> variances(const Moments& moments) {
  std::vector<double> values(moments.size());
  for (size_t i = 0; i < values.size(); ++i) values[i] = moments.variance(i);
  return values;
}

Image mean_image(const Moments& moments, int width, int height) {
  Image image(width, height, 3);
  for (size_t i = 0; i < moments.size(); ++i) image.data[i] = static_cast<float>(moments.mean(i));
  return image;
}

Image standard_error_image(const Moments& moments, int width, int height) {
  Image image(width, height, 3);
  for (size_t i = 0; i < moments.size(); ++i) {
    image.data[i] = static_cast<float>(std::sqrt(moments.variance(i)));
  }
  return image;
}

size_t block_count(int width, int height, int block) {
  const size_t columns = (width + block - 1) / block;
  const size_t rows = (height + block - 1) / block;
  return columns * rows;
}

std::vector<double> sum_blocks(const std::vector<double>& values, int width, int height,
                               int block) {
  const int columns = (width + block - 1) / block;
  std::vector<double> sums(block_count(width, height, block));
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < 3; ++c) {
        sums[static_cast<size_t>(y / block) * columns + x / block] +=
            values[(static_cast<size_t>(y) * width + x) * 3 + c];
      }
    }
  }
  return sums;
}

}  // namespace limn
