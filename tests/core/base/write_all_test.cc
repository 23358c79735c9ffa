#include "core/base/write_all.h"

#include <unistd.h>

#include <array>
#include <cerrno>
#include <string>
#include <thread>

#include <gtest/gtest.h>

namespace isomatch {
namespace {

TEST(WriteAllTest, WritesMoreThanAPipeTakesAtOnce) {
  std::array<int, 2> ends;
  ASSERT_EQ(pipe(ends.data()), 0);
  std::string read_bytes;
  std::thread reader([&] {
    std::array<char, 1000> buffer;
    for (ssize_t got; (got = read(ends[0], buffer.data(), buffer.size())) > 0;)
      read_bytes.append(buffer.data(), static_cast<std::size_t>(got));
  });
  std::string bytes;
  for (int i = 0; i < 100'000; ++i) bytes += std::to_string(i);
  EXPECT_EQ(WriteAll(ends[1], bytes), 0);
  close(ends[1]);
  reader.join();
  close(ends[0]);
  EXPECT_EQ(read_bytes, bytes);
}

TEST(WriteAllTest, ReturnsTheSystemsError) {
  EXPECT_EQ(WriteAll(-1, "x"), EBADF);
  EXPECT_EQ(WriteAll(-1, ""), 0);
}

}  // namespace
}  // namespace isomatch
