#pragma once

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "server/jobs/cluster_member.h"
#include "server/jobs/job_manager.h"
#include "server/metrics/metrics.h"
#include "server/metrics/probes.h"

namespace isomatch {

/// Returns what jobs are doing, and `cluster`; asks no store.
LoadFigures FiguresOf(JobManager& manager);

/// Answers by HealthOf and ReadinessOf. `manager` outlives them.
Probes ProbesOf(const JobManager& manager);

// Of which they are made:

/// Sets `cluster`, and what else the store that is shared knows better.
void SetCluster(const ClusterView& view, LoadFigures& figures);

/// Not well when the watchdog has not looked for ten seconds: something hangs
/// that jobs need. That the store is away is no reason to start again.
ProbeAnswer HealthOf(absl::Duration since_watched);

/// Ready unless it is draining, or `store` (OK where none is shared) keeps it
/// from its work.
ProbeAnswer ReadinessOf(bool is_draining, const absl::Status& store);

}  // namespace isomatch
