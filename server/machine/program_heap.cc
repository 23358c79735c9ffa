// The heap of our programs. It is linked into them alone: a library leaves its
// process the heap that it has.
#include <jemalloc/jemalloc.h>

// Read as the process starts; the environment's MALLOC_CONF goes before it.
// - A match fills arrays of megabytes and gives them back, again and again. In
//   pages of 4 KiB a fifth of its time in a new process is the kernel's, which
//   hands them out.
// - What is free for ten seconds goes back to the system, also where nothing
//   is done in the process.
// - One arena: of several each keeps huge pages of its own, more than memory
//   estimates of jobs allow for (core/EXPERIMENTS.md).
const char* malloc_conf =
    "thp:always,background_thread:true,max_background_threads:1,narenas:1";
