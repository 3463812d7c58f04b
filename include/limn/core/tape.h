#pragma once
// Reverse-mode derivatives: a scalar that writes down how it was made, so that one sweep back over
// what was written gives the derivative of one number with respect to all that it depends on.
//
// A node is a number that depends on some parameter; node 0 stands for all constants and writes
// nothing. A leaf is a node that belongs to a slot, a place in the gradient. A statement makes one
// node of some others with known partial derivatives; a composite statement makes several nodes at
// once and brings its own adjoint.
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "limn/core/dual.h"
#include "limn/core/vec.h"

namespace limn {

struct SceneSlots;

// What a sweep adds to a slot of the gradient.
struct Contribution {
  uint32_t slot;
  double value;
};

class Tape {
 public:
  // A statement with several outputs, the nodes from `first` on, and an adjoint written by hand.
  // What it needs to know is kept with it; nothing here looks at it.
  struct Composite {
    uint32_t first, outputs;
    void (*pull)(Tape& tape, const Composite& statement);
    uint32_t shape, part;
    std::array<uint32_t, 6> nodes;  // of its inputs
    std::array<double, 6> values;
  };

  // slots: of the scene that is traced; must outlive the tape. May be null where nothing asks.
  explicit Tape(const SceneSlots* slots = nullptr) : slots_(slots) { clear(); }
  Tape(const Tape&) = delete;
  Tape& operator=(const Tape&) = delete;

  const SceneSlots* slots() const { return slots_; }

  // Forgets everything but its memory.
  void clear() {
    ends_.clear();
    ends_.push_back(0);
    entries_.clear();
    leaves_.clear();
    composites_.clear();
    contributions_.clear();
  }
  // A new node that belongs to the slot; the constant for slot 0.
  uint32_t leaf(uint32_t slot) {
    if (slot == 0) return 0;
    const uint32_t node = end();
    leaves_.push_back({node, slot});
    return node;
  }
  // The parts of a statement: d(result)/d(node), for each node, then the result.
  void entry(uint32_t node, double weight) {
    if (node != 0) entries_.push_back({node, weight});
  }
  uint32_t end() {
    ends_.push_back(static_cast<uint32_t>(entries_.size()));
    return static_cast<uint32_t>(ends_.size() - 1);
  }
  // Makes the outputs of a composite statement, all fields but `first` given. Returns the first.
  uint32_t add(Composite statement) {
    statement.first = static_cast<uint32_t>(ends_.size());
    ends_.insert(ends_.end(), statement.outputs, static_cast<uint32_t>(entries_.size()));
    composites_.push_back(statement);
    return statement.first;
  }

  // Adjoints are set between start() and sweep(), those of node 0 are of no account. After the
  // sweep contributions() holds what it found, and what composite statements and contribute()
  // added.
  void start() { adjoints_.assign(ends_.size(), 0.0); }
  double& adjoint(uint32_t node) { return adjoints_[node]; }
  void contribute(uint32_t slot, double value) {
    if (slot != 0 && value != 0) contributions_.push_back({slot, value});
  }
  void sweep();
  const std::vector<Contribution>& contributions() const { return contributions_; }

  // What is in use.
  size_t bytes() const {
    return ends_.size() * (sizeof(uint32_t) + sizeof(double)) + entries_.size() * sizeof(Entry) +
           leaves_.size() * sizeof(Leaf) + composites_.size() * sizeof(Composite) +
           contributions_.size() * sizeof(Contribution);
  }

  // Where this thread writes; null where no scope is open.
  static Tape* current() { return current_; }

 private:
  friend class TapeScope;
  struct Entry {
    uint32_t node;
    double weight;
  };
  struct Leaf {
    uint32_t node, slot;
  };
  void sweep(uint32_t begin, uint32_t end);

  // The one thread-local object of inner loops: in a shared library it would cost a call each time.
  [[gnu::tls_model("initial-exec")]] static inline constinit thread_local Tape* current_ = nullptr;
  const SceneSlots* slots_;
  std::vector<uint32_t> ends_;  // of the entries of each node
  std::vector<Entry> entries_;
  std::vector<double> adjoints_;
  std::vector<Leaf> leaves_;
  std::vector<Composite> composites_;
  std::vector<Contribution> contributions_;
};

inline void Tape::sweep(uint32_t begin, uint32_t end) {
  for (uint32_t i = end; i-- > begin;) {
    const double a = adjoints_[i];
    if (a == 0) continue;
    for (uint32_t e = ends_[i - 1]; e < ends_[i]; ++e) {
      adjoints_[entries_[e].node] += entries_[e].weight * a;
    }
  }
}

inline void Tape::sweep() {
  auto end = static_cast<uint32_t>(ends_.size());
  for (size_t i = composites_.size(); i-- > 0;) {
    const Composite& statement = composites_[i];
    sweep(statement.first + statement.outputs, end);
    statement.pull(*this, statement);
    end = statement.first;
  }
  sweep(1, end);
  for (const Leaf& leaf : leaves_) contribute(leaf.slot, adjoints_[leaf.node]);
}

// While it lives, Var writes to this tape in this thread.
class TapeScope {
 public:
  explicit TapeScope(Tape& tape) : before_(Tape::current_) { Tape::current_ = &tape; }
  ~TapeScope() { Tape::current_ = before_; }
  TapeScope(const TapeScope&) = delete;
  TapeScope& operator=(const TapeScope&) = delete;

 private:
  Tape* before_;
};

// A number and its node.
struct Var {
  double v = 0;
  uint32_t node = 0;

  Var() = default;
  Var(double value) : v(value) {}  // NOLINT: a constant is a Var, implicitly
  Var(double value, uint32_t index) : v(value), node(index) {}
};

namespace detail {
// The result of a statement of one or two Vars and their partial derivatives.
inline Var unary(double v, const Var& a, double da) {
  if (a.node == 0) return v;
  Tape& tape = *Tape::current();
  tape.entry(a.node, da);
  return {v, tape.end()};
}
inline Var binary(double v, const Var& a, double da, const Var& b, double db) {
  if ((a.node | b.node) == 0) return v;
  Tape& tape = *Tape::current();
  tape.entry(a.node, da);
  tape.entry(b.node, db);
  return {v, tape.end()};
}
}  // namespace detail

inline Var operator+(const Var& a, const Var& b) { return detail::binary(a.v + b.v, a, 1, b, 1); }
inline Var operator-(const Var& a, const Var& b) { return detail::binary(a.v - b.v, a, 1, b, -1); }
inline Var operator*(const Var& a, const Var& b) {
  return detail::binary(a.v * b.v, a, b.v, b, a.v);
}
inline Var operator/(const Var& a, const Var& b) {
  const double q = a.v / b.v;
  return detail::binary(q, a, 1 / b.v, b, -q / b.v);
}
inline Var operator+(const Var& a, double b) { return {a.v + b, a.node}; }
inline Var operator+(double a, const Var& b) { return {a + b.v, b.node}; }
inline Var operator-(const Var& a, double b) { return {a.v - b, a.node}; }
inline Var operator-(double a, const Var& b) { return detail::unary(a - b.v, b, -1); }
inline Var operator*(const Var& a, double b) { return detail::unary(a.v * b, a, b); }
inline Var operator*(double a, const Var& b) { return detail::unary(a * b.v, b, a); }
inline Var operator/(const Var& a, double b) { return detail::unary(a.v / b, a, 1 / b); }
inline Var operator/(double a, const Var& b) {
  const double q = a / b.v;
  return detail::unary(q, b, -q / b.v);
}
inline Var operator-(const Var& a) { return detail::unary(-a.v, a, -1); }
inline Var& operator+=(Var& a, const Var& b) { return a = a + b; }
inline Var& operator*=(Var& a, const Var& b) { return a = a * b; }

// Comparisons look at the value alone.
inline bool operator<(const Var& a, const Var& b) { return a.v < b.v; }
inline bool operator>(const Var& a, const Var& b) { return a.v > b.v; }
inline bool operator<=(const Var& a, const Var& b) { return a.v <= b.v; }
inline bool operator>=(const Var& a, const Var& b) { return a.v >= b.v; }
inline bool operator==(const Var& a, const Var& b) { return a.v == b.v; }

// Derivatives at the ends of their domains as for Dual.
inline Var sqrt(const Var& a) {
  const double r = std::sqrt(a.v);
  return detail::unary(r, a, r > 0 ? 0.5 / r : 0);
}
inline Var exp(const Var& a) {
  const double e = std::exp(a.v);
  return detail::unary(e, a, e);
}
inline Var sin(const Var& a) { return detail::unary(std::sin(a.v), a, std::cos(a.v)); }
inline Var cos(const Var& a) { return detail::unary(std::cos(a.v), a, -std::sin(a.v)); }
inline Var tan(const Var& a) {
  const double t = std::tan(a.v);
  return detail::unary(t, a, 1 + t * t);
}
inline Var acos(const Var& a) {
  const double s = std::sqrt(std::max(0.0, 1 - a.v * a.v));
  return detail::unary(std::acos(a.v), a, s > 0 ? -1 / s : 0);
}
inline Var atan2(const Var& y, const Var& x) {
  const double r2 = x.v * x.v + y.v * y.v;
  const double inverse = r2 > 0 ? 1 / r2 : 0;
  return detail::binary(std::atan2(y.v, x.v), y, x.v * inverse, x, -y.v * inverse);
}
inline Var max(const Var& a, const Var& b) { return a.v >= b.v ? a : b; }
inline Var min(const Var& a, const Var& b) { return a.v <= b.v ? a : b; }

inline double value(const Var& a) { return a.v; }
inline bool is_still(const Var& a) { return a.node == 0; }
inline bool is_still(const Vec3<Var>& a) { return (a.x.node | a.y.node | a.z.node) == 0; }
inline bool is_still(const Rgb<Var>& a) { return (a.r.node | a.g.node | a.b.node) == 0; }

// One statement each for a product of vectors and for a unit vector, in place of five and of ten.
inline Var dot(const Vec3<Var>& a, const Vec3<Var>& b) {
  const double v = dot(value(a), value(b));
  if (is_still(a) && is_still(b)) return v;
  Tape& tape = *Tape::current();
  for (int k = 0; k < 3; ++k) tape.entry(a[k].node, b[k].v);
  for (int k = 0; k < 3; ++k) tape.entry(b[k].node, a[k].v);
  return {v, tape.end()};
}
inline Var dot(const Vec3<Var>& a, const Vec3d& b) {
  const double v = dot(value(a), b);
  if (is_still(a)) return v;
  Tape& tape = *Tape::current();
  for (int k = 0; k < 3; ++k) tape.entry(a[k].node, b[k]);
  return {v, tape.end()};
}
inline Var dot(const Vec3d& a, const Vec3<Var>& b) { return dot(b, a); }
inline Vec3<Var> normalize(const Vec3<Var>& a) {
  const Vec3d v = value(a);
  const double size = length(v);
  const Vec3d u = v / size;
  if (is_still(a)) return {u.x, u.y, u.z};
  Tape& tape = *Tape::current();
  Vec3<Var> unit;
  for (int k = 0; k < 3; ++k) {
    for (int j = 0; j < 3; ++j) tape.entry(a[j].node, ((k == j) - u[k] * u[j]) / size);
    unit[k] = {u[k], tape.end()};
  }
  return unit;
}

}  // namespace limn
