#include "client/files/npy_file.h"

#include <cstdlib>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "client/files/text_file.h"
#include "tests/support/matchers.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

/// A file of version 1 with this header and these numbers.
std::string Npy(std::string header, const std::string& numbers) {
  header += '\n';
  std::string bytes("\x93NUMPY\x01\x00", 8);
  bytes += static_cast<char>(header.size() & 0xff);
  bytes += static_cast<char>(header.size() >> 8);
  return bytes + header + numbers;
}

std::string Header(const std::string& type, const std::string& shape) {
  return absl::StrCat("{'descr': ", type,
                      ", 'fortran_order': False, 'shape': ", shape, ", }");
}

void ExpectRefused(const std::string& bytes, const std::string& why) {
  EXPECT_THAT(ParseNpy("m.npy", bytes),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(why)));
}

/// Runs Debian's Python: another one in PATH need not have NumPy.
int RunPython(const std::string& folder, const std::string& program) {
  return std::system(
      absl::StrCat("cd '", folder, "' && /usr/bin/python3 -c \"", program, "\"")
          .c_str());
}

TEST(NpyFileTest, NumbersComeBack) {
  const std::vector<std::int64_t> numbers = {
      0,
      -1,
      7,
      1'000'000,
      std::numeric_limits<std::int64_t>::min(),
      std::numeric_limits<std::int64_t>::max()};
  EXPECT_EQ(*ParseNpy("m.npy", FormatNpy(numbers)), numbers);
  EXPECT_TRUE(ParseNpy("m.npy", FormatNpy({}))->empty());
}

TEST(NpyFileTest, NumbersBeginWhereNumpyWantsThem) {
  for (const std::size_t count : {0, 9, 10, 999, 100'000}) {
    const std::vector<std::int64_t> numbers(count, 3);
    EXPECT_EQ((FormatNpy(numbers).size() - 8 * count) % 64, 0u) << count;
  }
}

TEST(NpyFileTest, NumpyReadsWhatWeWrite) {
  const TemporaryFolder folder;
  folder.Write("m.npy", FormatNpy(std::vector<std::int64_t>{4, -1, 0}));
  EXPECT_EQ(RunPython(folder.Path(""),
                      "import numpy; m = numpy.load('m.npy'); "
                      "assert m.dtype == numpy.int64 and m.shape == (3,), m; "
                      "assert m.tolist() == [4, -1, 0], m"),
            0);
}

TEST(NpyFileTest, WeReadWhatNumpyWrites) {
  const TemporaryFolder folder;
  ASSERT_EQ(RunPython(folder.Path(""),
                      "import numpy as n; "
                      "n.save('a.npy', n.array([4, -1, 0])); "
                      "n.save('b.npy', n.array([4, -1, 0], n.int32)); "
                      "n.save('c.npy', n.array([4, 255, 0], n.uint8)); "
                      "n.save('d.npy', n.array([4.5])); "
                      "n.save('e.npy', n.zeros((2, 2), int)); "
                      "n.save('f.npy', n.array([4, -1], '>i8'))"),
            0);
  const auto read = [&](const char* name) {
    return ParseNpy(name, *ReadFile(folder.Path(name), "numbers"));
  };
  EXPECT_THAT(*read("a.npy"), ElementsAre(4, -1, 0));
  EXPECT_THAT(*read("b.npy"), ElementsAre(4, -1, 0));
  EXPECT_THAT(*read("c.npy"), ElementsAre(4, 255, 0));
  EXPECT_THAT(read("d.npy"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("the array's type is '<f8', expected '<i8'")));
  EXPECT_THAT(read("e.npy"), StatusIs(absl::StatusCode::kInvalidArgument,
                                      HasSubstr("shape is (2, 2), expected")));
  EXPECT_THAT(read("f.npy"), StatusIs(absl::StatusCode::kInvalidArgument,
                                      HasSubstr("type is '>i8'")));
}

TEST(NpyFileTest, WhatIsNoNumpyFileIsRefused) {
  ExpectRefused("", "byte 0: expected a NumPy file");
  ExpectRefused("1\n2\n3\n4\n5\n6\n7\n", "byte 0: expected a NumPy file");
  ExpectRefused(Npy("{}", ""), "the array's type is ");
  ExpectRefused(Npy(Header("[('a', '<i8')]", "(1,)"), "12345678"),
                "the array's type is [");
  ExpectRefused(Npy(Header("'<i8'", "()"), "12345678"), "shape is ()");
  ExpectRefused(Npy(Header("'<i8'", ")"), ""), "shape is ()");
  ExpectRefused(Npy(Header("'<i8'", "("), ""), "shape is (");
  std::string future = FormatNpy({});
  future[6] = '\x09';
  ExpectRefused(future, "byte 6: the file's version is 9");
}

TEST(NpyFileTest, AFileThatClaimsMoreThanItHasIsRefused) {
  const std::string header = Header("'<i8'", "(1000000000000,)");
  ExpectRefused(Npy(header, "12345678"),
                "the file goes on for 8 bytes, expected 1000000000000 numbers");
  ExpectRefused(Npy(Header("'<i8'", "(1,)"), "1234567"), "for 7 bytes");
  std::string cut = FormatNpy(std::vector<std::int64_t>{1});
  ExpectRefused(cut.substr(0, 20), "byte 8: the header is");
}

TEST(NpyFileTest, ANumberTooLargeIsNamedByItsByte) {
  const std::string bytes =
      Npy(Header("'<u8'", "(1,)"), std::string(8, '\xff'));
  ExpectRefused(bytes, absl::StrCat("byte ", bytes.size() - 8,
                                    ": found 18446744073709551615"));
}

}  // namespace
}  // namespace isomatch
