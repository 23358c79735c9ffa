#pragma once

#include <functional>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "server/metrics/metrics.h"
#include "server/metrics/probes.h"

namespace isomatch {

/// Metrics that Prometheus reads over HTTP; server/README.md lists them.
/// Thread-safe, except Listen and Close.
class PrometheusMetrics final : public Metrics {
 public:
  using ReadLoad = std::function<LoadFigures()>;

  /// `version` is that of the server, for isomatch_build_info. Only where
  /// others share the queue there are metrics of that.
  explicit PrometheusMetrics(const std::string& version,
                             bool is_shared = false);
  ~PrometheusMetrics() override;

  /// Answers GET /metrics, /healthz and /readyz at HOST:PORT, IPv4; port 0
  /// picks a free one. `read_load` is asked at every scrape, `probes` at every
  /// probe until Close. UNAVAILABLE: cannot listen there.
  absl::Status Listen(const std::string& address, ReadLoad read_load,
                      Probes probes = {});

  /// HOST:PORT with the port it really has; empty when it does not listen.
  std::string address() const;

  /// Ends the endpoint, after the scrapes under way.
  void Close();

  void JobStarted(absl::Duration waited) override;
  void JobEnded(const std::string& state, const std::string& reason) override;
  void JobRan(const std::string& state, absl::Duration ran) override;
  void StageRan(const std::string& stage, absl::Duration ran) override;
  void JobMeasured(double estimate_ratio) override;
  void Uploaded(std::int64_t bytes) override;
  void Claimed(int jobs, absl::Duration took) override;
  void ClaimFailed() override;
  void LeaseLost() override;
  void LeaseExpired() override;
  void CallHandled(const std::string& method, const std::string& code,
                   absl::Duration handled) override;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace isomatch
