// Smooth steps of vertices: the sparse matrix I + lambda L and its Cholesky factors.
#include "limn/integrators/large_steps.h"

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <algorithm>
#include <span>
#include <utility>

#include "limn/core/check.h"

namespace limn {

namespace {

using Matrix = Eigen::SparseMatrix<double>;
using Rows = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
using Column = Eigen::VectorXd;

template <class Matrix>
Eigen::Map<const Matrix> rows(const std::vector<double>& x, size_t n) {
  constexpr int kColumns = Matrix::ColsAtCompileTime;
  CHECK_EQ(x.size(), kColumns * n);
  return {x.data(), static_cast<Eigen::Index>(n), kColumns};
}

template <class Matrix>
std::vector<double> numbers(const Matrix& x) {
  return {x.data(), x.data() + x.size()};
}

// Pairs of welded vertices, each once, in order; welded: what stands for each vertex.
std::vector<std::pair<uint32_t, uint32_t>> edges_of(const Mesh& mesh,
                                                    std::span<const uint32_t> welded) {
  std::vector<std::pair<uint32_t, uint32_t>> edges;
  for (const FaceIndices& face : mesh.faces) {
    for (int k = 0; k < 3; ++k) {
      const auto [a, b] = std::minmax({welded[face[k]], welded[face[(k + 1) % 3]]});
      edges.emplace_back(a, b);
    }
  }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  return edges;
}

}  // namespace

double mean_edge_length(const Mesh& mesh) {
  double sum = 0;
  const auto edges = edges_of(mesh, mesh.weld);
  for (const auto& [a, b] : edges) {
    sum += length(cast<double>(mesh.positions[a]) - cast<double>(mesh.positions[b]));
  }
  return sum / static_cast<double>(edges.size());
}

struct LargeSteps::Factors {
  Matrix matrix;
  Eigen::SimplicialLDLT<Matrix> cholesky;
};

LargeSteps::LargeSteps(const Mesh& mesh, double lambda) : lambda_(lambda) {
  welded_.resize(mesh.positions.size());
  for (uint32_t v = 0; v < welded_.size(); ++v) {
    if (mesh.weld[v] == v) {
      welded_[v] = static_cast<uint32_t>(first_.size());
      first_.push_back(v);
    }
  }
  for (uint32_t v = 0; v < welded_.size(); ++v) welded_[v] = welded_[mesh.weld[v]];
  if (lambda == 0) return;
  const auto edges = edges_of(mesh, welded_);
  std::vector<Eigen::Triplet<double>> entries;
  for (uint32_t i = 0; i < first_.size(); ++i) entries.emplace_back(i, i, 1.0);
  for (const auto& [a, b] : edges) {
    entries.emplace_back(a, a, lambda_);
    entries.emplace_back(b, b, lambda_);
    entries.emplace_back(a, b, -lambda_);
    entries.emplace_back(b, a, -lambda_);
  }
  factors_ = std::make_unique<Factors>();
  const auto n = static_cast<Eigen::Index>(first_.size());
  factors_->matrix.resize(n, n);
  factors_->matrix.setFromTriplets(entries.begin(), entries.end());
  factors_->cholesky.compute(factors_->matrix);
  // All eigenvalues are 1 at least.
  CHECK(factors_->cholesky.info() == Eigen::Success);
}

LargeSteps::~LargeSteps() = default;
LargeSteps::LargeSteps(LargeSteps&&) noexcept = default;

std::vector<double> LargeSteps::apply(const std::vector<double>& x) const {
  if (!factors_) return x;
  if (x.size() == size()) return numbers<Column>(factors_->matrix * rows<Column>(x, size()));
  return numbers<Rows>(factors_->matrix * rows<Rows>(x, size()));
}

std::vector<double> LargeSteps::solve(const std::vector<double>& x) const {
  if (!factors_) return x;
  if (x.size() == size()) return numbers<Column>(factors_->cholesky.solve(rows<Column>(x, size())));
  return numbers<Rows>(factors_->cholesky.solve(rows<Rows>(x, size())));
}

}  // namespace limn
