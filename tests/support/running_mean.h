#pragma once
// Means of samples with their standard errors.
#include <cmath>

namespace limn {

// Mean of independent samples, with the standard error of that mean.
class RunningMean {
 public:
  void add(double x) {
    ++count_;
    const double delta = x - mean_;
    mean_ += delta / count_;
    squares_ += delta * (x - mean_);
  }
  double mean() const { return mean_; }
  double standard_error() const { return std::sqrt(squares_ / (count_ * (count_ - 1))); }
  double z_score(double reference) const { return (mean_ - reference) / standard_error(); }

 private:
  double count_ = 0, mean_ = 0, squares_ = 0;
};

}  // namespace limn
