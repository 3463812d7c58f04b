#pragma once
// Preconditions that only a bug in the program can violate. A failure prints the condition, its
// operands and its source location to stderr, and aborts. Errors that a user can cause are
// InputErrors instead (error.h).
// CHECK is always on. DCHECK is on in debug builds only (without NDEBUG), for costly checks and
// inner loops.
//
// These names are common in other libraries, too. Therefore no public header includes this file.
#include <iomanip>
#include <limits>
#include <sstream>
#include <string>

namespace limn::detail {

[[noreturn]] void check_failed(const char* file, int line, const std::string& what);

template <class A, class B>
[[noreturn]] void check_failed(const char* file, int line, const char* condition, const A& a,
                               const B& b) {
  std::ostringstream text;
  text << std::setprecision(std::numeric_limits<double>::max_digits10);
  text << condition << " (" << a << " and " << b << ")";
  check_failed(file, line, text.str());
}

}  // namespace limn::detail

#define CHECK(condition) \
  ((condition) ? void() : ::limn::detail::check_failed(__FILE__, __LINE__, #condition))

#define LIMN_CHECK_TWO(a, op, b)                                                           \
  do {                                                                                     \
    const auto& limn_a = (a);                                                              \
    const auto& limn_b = (b);                                                              \
    if (!(limn_a op limn_b)) {                                                             \
      ::limn::detail::check_failed(__FILE__, __LINE__, #a " " #op " " #b, limn_a, limn_b); \
    }                                                                                      \
  } while (false)

#define CHECK_EQ(a, b) LIMN_CHECK_TWO(a, ==, b)
#define CHECK_LT(a, b) LIMN_CHECK_TWO(a, <, b)
#define CHECK_LE(a, b) LIMN_CHECK_TWO(a, <=, b)

// In a release build the operands are compiled but not evaluated.
#ifdef NDEBUG
#define LIMN_DCHECK_ON false
#else
#define LIMN_DCHECK_ON true
#endif
#define DCHECK(condition)                 \
  do {                                    \
    if (LIMN_DCHECK_ON) CHECK(condition); \
  } while (false)
#define DCHECK_EQ(a, b)                 \
  do {                                  \
    if (LIMN_DCHECK_ON) CHECK_EQ(a, b); \
  } while (false)
#define DCHECK_LT(a, b)                 \
  do {                                  \
    if (LIMN_DCHECK_ON) CHECK_LT(a, b); \
  } while (false)
#define DCHECK_LE(a, b)                 \
  do {                                  \
    if (LIMN_DCHECK_ON) CHECK_LE(a, b); \
  } while (false)
