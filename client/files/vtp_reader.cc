#include "client/files/vtp_reader.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <pugixml.hpp>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "client/files/input_file.h"
#include "client/files/text_file.h"
#include "client/files/vtk_cells.h"
#include "client/files/vtp_array.h"
#include "client/files/word_cursor.h"

namespace isomatch {
namespace {

constexpr absl::string_view kAppended = "<AppendedData";

class VtpReader {
 public:
  VtpReader(absl::string_view bytes, PolygonSoup* soup)
      : bytes_(bytes), soup_(soup) {}

  std::optional<MeshFault> Read() {
    soup_->format = "VTK XML";
    if (auto fault = Parse()) return fault;
    const pugi::xml_node file = document_.child("VTKFile");
    if (auto fault = ReadEncoding(file)) return fault;
    std::size_t piece = 0;
    for (const pugi::xml_node node : file.child("PolyData").children("Piece")) {
      if (auto fault = ReadPiece(node)) {
        fault->where =
            absl::StrCat("piece ", piece, " (0-based)",
                         fault->where.empty() ? "" : ", ", fault->where);
        return fault;
      }
      ++piece;
    }
    if (left_out_ > 0) {
      soup_->warnings.push_back(
          absl::StrCat(left_out_, " cells that are no polygons are left out"));
    }
    return std::nullopt;
  }

 private:
  // Raw appended bytes are no XML: what stands before them is parsed.
  std::optional<MeshFault> Parse() {
    const std::size_t end = bytes_.find(kAppended);
    std::string xml(bytes_.substr(0, end));
    if (end != absl::string_view::npos) {
      const absl::string_view rest = bytes_.substr(end);
      const std::size_t tag = rest.find('>');
      const std::size_t mark =
          tag == absl::string_view::npos ? tag : rest.find('_', tag);
      if (mark == absl::string_view::npos) {
        return MeshFault{absl::StrCat("byte ", end),
                         "AppendedData has no _, expected one before its "
                         "bytes"};
      }
      encoding_.is_appended_base64 =
          absl::StrContains(rest.substr(0, tag), "base64");
      encoding_.appended = rest.substr(mark + 1);
      absl::StrAppend(&xml, "</VTKFile>");
    }
    const pugi::xml_parse_result result =
        document_.load_buffer(xml.data(), xml.size());
    if (result) return std::nullopt;
    return MeshFault{absl::StrCat("byte ", result.offset),
                     absl::StrCat("not XML (", result.description(),
                                  "), expected a VTKFile")};
  }

  std::optional<MeshFault> ReadEncoding(const pugi::xml_node& file) {
    const std::string type = file.attribute("type").as_string();
    if (type != "PolyData") {
      return MeshFault{"", absl::StrCat("its type is ", Quoted(type),
                                        ", expected VTKFile of PolyData")};
    }
    encoding_.is_big_endian = absl::EqualsIgnoreCase(
        file.attribute("byte_order").as_string(), "BigEndian");
    const std::string header =
        file.attribute("header_type").as_string("UInt32");
    encoding_.header_bytes = header == "UInt64" ? 8 : 4;
    const std::string compressor = file.attribute("compressor").as_string();
    encoding_.is_zlib = compressor == "vtkZLibDataCompressor";
    if (compressor.empty() || encoding_.is_zlib) return std::nullopt;
    return MeshFault{"", absl::StrCat("its compressor is ", Quoted(compressor),
                                      ", expected vtkZLibDataCompressor or "
                                      "none")};
  }

  std::optional<MeshFault> ReadPiece(const pugi::xml_node& piece) {
    const std::size_t first = soup_->points.size();
    std::int64_t points = 0;
    if (auto fault = Count(piece, "NumberOfPoints", &points)) return fault;
    std::vector<double> numbers;
    if (auto fault = ReadArray(piece.child("Points").child("DataArray"),
                               3 * points, &numbers)) {
      fault->where = "Points";
      return fault;
    }
    if (auto fault = AddVtkPoints(numbers, soup_)) return fault;
    for (const char* const loose : {"NumberOfVerts", "NumberOfLines"}) {
      std::int64_t cells = 0;
      if (auto fault = Count(piece, loose, &cells)) return fault;
      left_out_ += cells;
    }
    if (auto fault = ReadCells(piece, "NumberOfPolys", "Polys",
                               {VtkUse::kPolygon, first})) {
      return fault;
    }
    return ReadCells(piece, "NumberOfStrips", "Strips",
                     {VtkUse::kStrip, first});
  }

  struct CellPlan {
    VtkUse use;
    std::size_t first_point;
  };

  std::optional<MeshFault> ReadCells(const pugi::xml_node& piece,
                                     const char* count_name, const char* name,
                                     const CellPlan& plan) {
    std::int64_t count = 0;
    if (auto fault = Count(piece, count_name, &count)) return fault;
    if (count == 0) return std::nullopt;
    const pugi::xml_node node = piece.child(name);
    VtkCells cells;
    const auto array = [&](const char* of) {
      return node.find_child_by_attribute("DataArray", "Name", of);
    };
    auto fault = ReadArray(array("offsets"), count, &cells.ends);
    if (!fault) {
      const double corners = cells.ends.back();
      constexpr double kMost = 1e15;
      if (!(corners >= 0 && corners < kMost)) {
        return MeshFault{name, absl::StrCat("the last offset is ", corners,
                                            ", expected the number of "
                                            "vertices of all cells")};
      }
      fault = ReadArray(array("connectivity"),
                        static_cast<std::int64_t>(corners), &cells.vertices);
    }
    if (!fault) {
      fault = AddVtkCells(cells, {plan.use}, plan.first_point, soup_);
    }
    if (!fault) return std::nullopt;
    fault->where =
        absl::StrCat(name, fault->where.empty() ? "" : ", ", fault->where);
    return fault;
  }

  static std::optional<MeshFault> Count(const pugi::xml_node& piece,
                                        const char* name, std::int64_t* count) {
    const auto found =
        ParseHeaderCount(piece.attribute(name).as_string("0"), name);
    if (!found.ok()) {
      return MeshFault{"", std::string(found.status().message())};
    }
    *count = *found;
    return std::nullopt;
  }

  std::optional<MeshFault> ReadArray(const pugi::xml_node& array,
                                     std::int64_t count,
                                     std::vector<double>* numbers) {
    const auto type = VtkTypeOf(array.attribute("type").as_string());
    if (!type) {
      return MeshFault{"",
                       absl::StrCat("the type of a DataArray is ",
                                    Quoted(array.attribute("type").as_string()),
                                    ", expected one of numbers, as Float32")};
    }
    const std::string format = array.attribute("format").as_string("ascii");
    const absl::string_view text = array.child_value();
    if (format == "ascii") return ReadText(text, count, numbers);
    const auto size = count * static_cast<std::int64_t>(type->bytes);
    if (auto fault = CheckRoom(size)) return fault;
    std::string block;
    if (format == "binary") {
      if (auto fault = DecodeVtpBlock(text, /*is_base64=*/true, encoding_,
                                      static_cast<std::size_t>(size), &block)) {
        return fault;
      }
    } else if (auto fault = ReadAppended(array, size, &block)) {
      return fault;
    }
    *numbers = VtkNumbers(block, *type, encoding_.is_big_endian);
    return std::nullopt;
  }

  // Whether arrays of `more` bytes besides those before may be read: even
  // packed, a byte holds no more, and two arrays may be one in the file.
  std::optional<MeshFault> CheckRoom(std::int64_t more) {
    constexpr std::int64_t kMostOfAByte = 1040;
    // What is made of them takes more than they do.
    constexpr std::int64_t kShare = 4;
    const auto held = static_cast<std::int64_t>(bytes_.size());
    const std::int64_t most = std::max(
        held, std::min(kMostOfAByte * held, MostUnpackedBytes() / kShare));
    if (more <= most - taken_bytes_) {
      taken_bytes_ += more;
      return std::nullopt;
    }
    return MeshFault{
        "", absl::StrCat("a DataArray of ", more, " bytes is claimed after ",
                         taken_bytes_, ", expected at most ", most,
                         " of a file of ", held)};
  }

  std::optional<MeshFault> ReadAppended(const pugi::xml_node& array,
                                        std::int64_t size,
                                        std::string* block) const {
    const std::string offset = array.attribute("offset").as_string();
    std::int64_t at = 0;
    if (!absl::SimpleAtoi(offset, &at) || at < 0 ||
        at >= static_cast<std::int64_t>(encoding_.appended.size())) {
      return MeshFault{
          "",
          absl::StrCat("a DataArray is appended at ", Quoted(offset),
                       ", expected 0 to below ", encoding_.appended.size())};
    }
    return DecodeVtpBlock(
        encoding_.appended.substr(static_cast<std::size_t>(at)),
        encoding_.is_appended_base64, encoding_, static_cast<std::size_t>(size),
        block);
  }

  static std::optional<MeshFault> ReadText(absl::string_view text,
                                           std::int64_t count,
                                           std::vector<double>* numbers) {
    if (count > static_cast<std::int64_t>(text.size() / 2 + 1)) {
      return MeshFault{"", absl::StrCat(count,
                                        " numbers are claimed, but the "
                                        "DataArray has ",
                                        text.size(), " letters")};
    }
    WordCursor words(text);
    for (std::int64_t i = 0; i < count; ++i) {
      const absl::string_view word = words.Take();
      if (ReadFinite(word, &numbers->emplace_back())) continue;
      return MeshFault{
          "", absl::StrCat("number ", i, " (0-based) is ", Quoted(word),
                           ", expected a finite number")};
    }
    return std::nullopt;
  }

  const absl::string_view bytes_;
  PolygonSoup* const soup_;
  pugi::xml_document document_;
  VtpEncoding encoding_;
  std::int64_t taken_bytes_ = 0;
  std::int64_t left_out_ = 0;
};

}  // namespace

std::optional<MeshFault> ReadVtpSoup(absl::string_view bytes,
                                     PolygonSoup* soup) {
  return VtpReader(bytes, soup).Read();
}

}  // namespace isomatch
