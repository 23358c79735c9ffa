#pragma once

#include <set>
#include <string>
#include <vector>

#include "server/storage/job_record.h"
#include "server/storage/process_trace.h"

namespace isomatch {

/// Returns which of the jobs that `ran` took the process down whose last trace
/// this is. The first of these that applies:
///
///   1. Jobs were asked to stop and had not answered for a second: they. (Also
///      when they are terminal by now, and so not among those that ran: then it
///      is nobody else.)
///   2. More memory was resident than all that was reserved explains: the job
///      that had told of no progress for longest, if that is a second at
///      least; else the only one that ran.
///   3. Nobody: it was killed from outside, or crashed in a way that says
///      nothing about whose fault it was.
///
/// A job that the trace does not know with its attempt had just begun, and is
/// not to blame. JobManager::Begin says what follows from it.
std::set<std::string> JobsToBlame(const ProcessTrace& trace,
                                  const std::vector<JobRecord>& ran);

}  // namespace isomatch
