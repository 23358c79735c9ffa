#pragma once

#include <set>
#include <string>
#include <vector>

#include "server/storage/job_record.h"
#include "server/storage/process_trace.h"

namespace isomatch {

/// Which jobs took a process down.
struct Blame {
  /// A job did it, though perhaps none of those that ran then.
  bool is_known = false;
  /// The jobs that did it.
  std::set<std::string> jobs = {};
};

/// Returns which of the jobs that `ran` took the process down whose last trace
/// this is. The first of these that applies:
///
///   1. Workers were given up: their jobs. What the others did then was to be
///      stopped for them.
///   2. Jobs were asked to stop and had not answered for a second: they. (In
///      both cases also when they are terminal or QUEUED by now, and so not
///      among those that ran: then it is nobody else.)
///   3. More memory was resident than what was reserved and what there was
///      without jobs explain: the job that had told of no progress for longest,
///      if that is a second at least; else the only one that ran, if memory has
///      grown by more than it was to take since it began.
///   4. Nobody: it was killed from outside, or crashed in a way that says
///      nothing about whose fault it was.
///
/// A job that the trace does not know with its attempt had just begun, and is
/// not to blame. JobManager::Begin says what follows from it.
Blame WhoIsToBlame(const ProcessTrace& trace,
                   const std::vector<JobRecord>& ran);

}  // namespace isomatch
