#include "server/storage/process_trace.h"

#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::IsEmpty;
using testing::SizeIs;

TEST(TraceFileTest, TheNextProcessReadsWhatTheLastOneWrote) {
  const TemporaryFolder folder;
  const std::string path = folder.Path("running.json");
  {
    TraceFile file(path);
    EXPECT_THAT(file.Read().jobs, IsEmpty());
    file.Write({1, 2, {{"longer", 3, absl::Seconds(4)}, {"b", 5}}});
    file.Write({10,
                20,
                {{"a", 3, absl::Milliseconds(4500), absl::Milliseconds(250),
                  true, 7}}});
  }
  const ProcessTrace trace = TraceFile(path).Read();
  EXPECT_EQ(trace.resident_bytes, 10);
  EXPECT_EQ(trace.expected_bytes, 20);
  ASSERT_THAT(trace.jobs, SizeIs(1));
  EXPECT_EQ(trace.jobs[0].id, "a");
  EXPECT_EQ(trace.jobs[0].attempt, 3);
  EXPECT_EQ(trace.jobs[0].silent, absl::Milliseconds(4500));
  EXPECT_EQ(trace.jobs[0].unanswered, absl::Milliseconds(250));
  EXPECT_TRUE(trace.jobs[0].is_stuck);
  EXPECT_EQ(trace.jobs[0].resident_at_begin, 7);
}

TEST(TraceFileTest, OneOfAnEarlierVersionTellsLess) {
  const TemporaryFolder folder;
  TraceFile file(folder.Write(
      "trace", R"({"resident_bytes":1,"expected_bytes":2,"jobs":[)"
               R"({"id":"a","attempt":3,"silent_seconds":4.5}]})"));
  const ProcessTrace trace = file.Read();
  ASSERT_THAT(trace.jobs, SizeIs(1));
  EXPECT_FALSE(trace.jobs[0].is_stuck);
  EXPECT_EQ(trace.jobs[0].resident_at_begin, 0);
}

TEST(TraceFileTest, AShorterTraceCoversOneOfAnEarlierProcess) {
  const TemporaryFolder folder;
  const std::string path = folder.Path("running.json");
  TraceFile(path).Write({1, 2, {{"a", 3, absl::Seconds(4)}}});
  TraceFile next(path);
  EXPECT_THAT(next.Read().jobs, SizeIs(1));
  next.Write({});
  EXPECT_THAT(TraceFile(path).Read().jobs, IsEmpty());
}

TEST(TraceFileTest, WhatCannotBeReadSaysNothing) {
  const TemporaryFolder folder;
  for (const char* bytes : {"", "{\"resident_bytes\":1,", "[]", "\xff{}",
                            "{\"resident_bytes\":\"much\"}"}) {
    EXPECT_THAT(TraceFile(folder.Write("trace", bytes)).Read().jobs, IsEmpty());
  }
  TraceFile nowhere(folder.Path("no/such/folder"));
  nowhere.Write({1, 2, {{"a"}}});
  EXPECT_THAT(nowhere.Read().jobs, IsEmpty());
}

}  // namespace
}  // namespace isomatch
