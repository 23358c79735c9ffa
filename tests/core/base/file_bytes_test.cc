#include "core/base/file_bytes.h"

#include <unistd.h>

#include <array>
#include <cerrno>
#include <string>
#include <thread>

#include <gtest/gtest.h>

namespace isomatch {
namespace {

TEST(FileBytesTest, WritesMoreThanAPipeTakesAtOnce) {
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

TEST(FileBytesTest, ReadsWhatComesInPiecesAndNoMoreThanWanted) {
  std::array<int, 2> ends;
  ASSERT_EQ(pipe(ends.data()), 0);
  const std::string sent(200'000, 'x');  // more than a pipe holds
  std::thread writer([&] {
    WriteAll(ends[1], sent);
    close(ends[1]);
  });
  std::string bytes = "what was there";
  EXPECT_EQ(ReadUpTo(150'000, ends[0], &bytes), 0);
  EXPECT_EQ(bytes, sent.substr(0, 150'000));
  EXPECT_EQ(ReadUpTo(150'000, ends[0], &bytes), 0);
  EXPECT_EQ(bytes, sent.substr(150'000));
  writer.join();
  close(ends[0]);
}

TEST(FileBytesTest, ReturnsTheSystemsError) {
  EXPECT_EQ(WriteAll(-1, "x"), EBADF);
  EXPECT_EQ(WriteAll(-1, ""), 0);
  std::string bytes;
  EXPECT_EQ(ReadUpTo(1, -1, &bytes), EBADF);
}

}  // namespace
}  // namespace isomatch
