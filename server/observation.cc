#include "server/observation.h"

#include <cstdint>
#include <map>
#include <string>

#include "absl/strings/str_cat.h"

namespace isomatch {
namespace {

/// The watchdog looks five times a second.
constexpr absl::Duration kLongestUnwatched = absl::Seconds(10);

/// Counts the queued jobs of a priority below, at and above 0.
void SetQueued(const std::map<std::int32_t, int>& queued_by_priority,
               LoadFigures& figures) {
  for (const auto& [priority, count] : queued_by_priority) {
    int& level = priority < 0    ? figures.queued_low
                 : priority == 0 ? figures.queued_normal
                                 : figures.queued_high;
    level += count;
  }
}

}  // namespace

LoadFigures FiguresOf(JobManager& manager) {
  const JobLoad load = manager.local_load();
  LoadFigures figures;
  figures.held_for_storage = load.held_for_storage;
  figures.held_for_inputs = load.held_jobs;
  figures.running_jobs = load.running_jobs;
  figures.stuck_workers = load.stuck_jobs;
  figures.watchers = manager.watchers().size();
  if (const auto cluster = manager.cluster()) {
    SetCluster(*cluster, figures);
  } else {
    SetQueued(manager.queued_by_priority(), figures);
  }
  return figures;
}

Probes ProbesOf(const JobManager& manager) {
  return {.health = [&manager] { return HealthOf(manager.SinceWatched()); },
          .readiness =
              [&manager] {
                const auto cluster = manager.cluster();
                return ReadinessOf(manager.local_load().draining,
                                   cluster ? cluster->store : absl::OkStatus());
              }};
}

void SetCluster(const ClusterView& view, LoadFigures& figures) {
  figures.cluster = {.is_database_up = !absl::IsUnavailable(view.store),
                     .database_errors = view.store_errors};
  if (!view.told) return;
  const ClusterView::Told& told = *view.told;
  SetQueued(told.queue.queued_by_priority, figures);
  figures.stored_bytes = told.stored_bytes;
  if (!view.is_recent) return;
  figures.cluster->told = {.queued_jobs = told.queue.queued,
                           .running_jobs = told.queue.running,
                           .oldest_queued = told.queue.oldest_queued,
                           .workers = told.workers,
                           .live_rows = told.store.live_rows,
                           .dead_rows = told.store.dead_rows,
                           .table_bytes = told.store.table_bytes,
                           .oldest_transaction = told.store.oldest_transaction};
}

ProbeAnswer HealthOf(absl::Duration since_watched) {
  if (since_watched <= kLongestUnwatched) return {true, "ok"};
  return {false, absl::StrCat("the watchdog of jobs has not run for ",
                              since_watched / absl::Seconds(1), " s")};
}

ProbeAnswer ReadinessOf(bool is_draining, const absl::Status& store) {
  if (is_draining) return {false, "draining"};
  if (!store.ok()) return {false, std::string(store.message())};
  return {true, "ready"};
}

}  // namespace isomatch
