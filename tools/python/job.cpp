// Runs: settings, a thread of their own, signals; and how they tell what went wrong.
#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>

#include "limn/core/error.h"
#include "limn/core/parallel.h"
#include "tools/python/bindings.h"

namespace limn::python {

namespace {

constexpr auto kPoll = std::chrono::milliseconds(50);

// A job on a thread, and what came of it.
class Worker {
 public:
  explicit Worker(std::function<void()> job)
      : thread_([this, job = std::move(job)] {
          std::exception_ptr error;
          try {
            job();
          } catch (...) {
            error = std::current_exception();
          }
          const std::scoped_lock lock(mutex_);
          error_ = error;
          done_ = true;
          ended_.notify_one();
        }) {}

  // True once the job has ended; waits no longer than kPoll.
  bool wait() {
    std::unique_lock lock(mutex_);
    return ended_.wait_for(lock, kPoll, [this] { return done_; });
  }
  void join() { thread_.join(); }
  void rethrow() const {
    if (error_) std::rethrow_exception(error_);
  }

 private:
  std::mutex mutex_;
  std::condition_variable ended_;
  bool done_ = false;
  std::exception_ptr error_;
  std::thread thread_;  // last, since it uses the others
};

// Signals and progress, with the GIL held; throws what Python raises.
void attend(const nb::object& progress, double done, double& shown) {
  if (PyErr_CheckSignals() != 0) throw nb::python_error();
  if (progress.is_none() || done <= shown) return;
  shown = done;
  progress(done);
}

}  // namespace

void run_job(RunSettings settings, const nb::object& progress,
             const std::function<void(const RunSettings&)>& job) {
  std::atomic<bool> interrupted{false};
  std::atomic<double> done{0};
  settings.interrupted = &interrupted;
  settings.progress = [&done](double fraction) { done = fraction; };
  std::optional<nb::python_error> raised;
  double shown = 0;
  const auto look = [&] {
    try {
      attend(progress, done, shown);
    } catch (nb::python_error& error) {
      raised.emplace(std::move(error));
      interrupted = true;
    }
  };
  Worker worker([&] { job(settings); });
  {
    const nb::gil_scoped_release release;
    while (!worker.wait()) {
      const nb::gil_scoped_acquire gil;
      if (!raised) look();
    }
    worker.join();
  }
  if (!raised) look();
  if (raised) throw nb::python_error(std::move(*raised));
  worker.rethrow();
}

void warn_all(const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings) {
    if (PyErr_WarnEx(PyExc_UserWarning, warning.c_str(), 1) != 0) throw nb::python_error();
  }
}

void check_finite(const NonFinite& bad, const nb::object& result) {
  if (bad.count == 0) return;
  const nb::object type = nb::module_::import_("limn.errors").attr("NonFiniteError");
  const nb::object error = type(bad.message());
  error.attr("result") = result;
  PyErr_SetObject(type.ptr(), error.ptr());
  throw nb::python_error();
}

}  // namespace limn::python
