#pragma once

#include "core/pipeline/match_engine.h"

/// The core is compiled once for each instruction set (core/CMakeLists.txt);
/// ISOMATCH_MATCH_ENGINE names what it is entered by.
#ifndef ISOMATCH_MATCH_ENGINE
#define ISOMATCH_MATCH_ENGINE isomatch_match_engine_baseline
#endif

/// Returns the functions that were compiled with this file; those that
/// pipeline/matcher.h checks the arguments of expect checked ones.
extern "C" const isomatch::MatchEngine* ISOMATCH_MATCH_ENGINE();
