#pragma once
// The tape of reverse-mode differentiation: records how Vars (var.h) are computed. One backward
// sweep gives the derivatives of one number with respect to all of its inputs.
//
// A node is a number that depends on a parameter; node 0 stands for all constants. A leaf is a
// node with a slot, an index into the gradient. A statement makes one node from others, given
// the partial derivatives. A composite statement makes several nodes and provides its own
// adjoint.
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace limn {

struct SceneSlots;

// An increment to one slot of the gradient.
struct Contribution {
  uint32_t slot;
  double value;
};

class Tape {
 public:
  // A statement with several outputs, the nodes from `first` on, and a hand-written adjoint. Its
  // data are opaque to the tape.
  struct Composite {
    uint32_t first, outputs;
    void (*pull)(Tape& tape, const Composite& statement);
    uint32_t shape, part;
    std::array<uint32_t, 6> nodes;  // of its inputs
    std::array<double, 6> values;
  };

  // slots: of the current scene; must outlive the tape. May be null if no function needs them.
  explicit Tape(const SceneSlots* slots = nullptr) : slots_(slots) { clear(); }
  Tape(const Tape&) = delete;
  Tape& operator=(const Tape&) = delete;

  const SceneSlots* slots() const { return slots_; }

  // Removes all nodes but keeps the memory.
  void clear() {
    ends_.clear();
    ends_.push_back(0);
    entries_.clear();
    leaves_.clear();
    composites_.clear();
    contributions_.clear();
  }
  // Adds a node with the given slot; returns the constant node for slot 0.
  uint32_t leaf(uint32_t slot) {
    if (slot == 0) return 0;
    const uint32_t node = end();
    leaves_.push_back({node, slot});
    return node;
  }
  // Statements are built from entries: d(result)/d(node) for each input node, then the result.
  void entry(uint32_t node, double weight) {
    if (node != 0) entries_.push_back({node, weight});
  }
  uint32_t end() {
    ends_.push_back(static_cast<uint32_t>(entries_.size()));
    return static_cast<uint32_t>(ends_.size() - 1);
  }
  // Adds the outputs of a composite statement (all fields but `first` are set). Returns the first.
  uint32_t add(Composite statement) {
    statement.first = static_cast<uint32_t>(ends_.size());
    ends_.insert(ends_.end(), statement.outputs, static_cast<uint32_t>(entries_.size()));
    composites_.push_back(statement);
    return statement.first;
  }

  // Set adjoints between start() and sweep(); that of node 0 is ignored. After the sweep,
  // contributions() holds all increments, including those of composite statements and
  // contribute().
  void start() { adjoints_.assign(ends_.size(), 0.0); }
  double& adjoint(uint32_t node) { return adjoints_[node]; }
  void contribute(uint32_t slot, double value) {
    if (slot != 0 && value != 0) contributions_.push_back({slot, value});
  }
  void sweep();
  const std::vector<Contribution>& contributions() const { return contributions_; }

  // Memory in use.
  size_t bytes() const {
    return ends_.size() * (sizeof(uint32_t) + sizeof(double)) + entries_.size() * sizeof(Entry) +
           leaves_.size() * sizeof(Leaf) + composites_.size() * sizeof(Composite) +
           contributions_.size() * sizeof(Contribution);
  }

  // The tape of this thread; null outside of any scope.
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

  // Not of the model initial-exec: by it a Python module takes the few bytes that loaders have for
  // all such libraries, and PyTorch's could not be loaded beside it.
  static inline constinit thread_local Tape* current_ = nullptr;
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

// While it exists, Vars of this thread are recorded on this tape.
class TapeScope {
 public:
  explicit TapeScope(Tape& tape) : before_(Tape::current_) { Tape::current_ = &tape; }
  ~TapeScope() { Tape::current_ = before_; }
  TapeScope(const TapeScope&) = delete;
  TapeScope& operator=(const TapeScope&) = delete;

 private:
  Tape* before_;
};

}  // namespace limn
