#include "client/viewer/explanations.h"

#include <algorithm>
#include <iterator>

namespace isomatch {
namespace {

struct LabelText {
  absl::string_view label;
  absl::string_view text;
};

constexpr LabelText kExplanations[] = {
    {"verdict",
     "What the figures say together: a good map can be used as it is, a "
     "doubtful one wants a look, and a bad one is not to be used. It is judged "
     "without knowing the truth."},
    {"symmetry confidence (0 to 1)",
     "How clearly this map is better than the others that were found, such as "
     "the one with left and right exchanged. Below 0.2 look whether it is "
     "mirrored; one pair of landmarks decides it."},
    {"mean confidence (0 to 1)",
     "The mean over all vertices of how far each can be trusted, of overlaps "
     "without those that are matched only since both shapes go on there. Good "
     "maps have 0.7 or more, bad ones 0.2 or less."},
    {"mean confidence",
     "The mean over the vertices of X with an image of how far each can be "
     "trusted, 0 to 1. "
     "Good maps have 0.7 or more, bad ones 0.2 or less."},
    {"geodesic distortion / sqrt(area)",
     "How much distances along the surface change from X to Y, on average. 0 "
     "is none; 0.02 is usual for two poses of one body."},
    {"area distortion, mean |ln|",
     "How much areas change: the mean size of ln(area on Y / area on X). 0 is "
     "none, 0.1 about a tenth."},
    {"coverage of Y's area",
     "The part of Y's surface that X is mapped onto. Little of it is missed "
     "where both are whole; less is right where X lacks a part of Y."},
    {"embedding error",
     "How far the eigenfunctions of both shapes disagree under the map (Eq. 8 "
     "of the paper). 0 is best."},
    {"orientation (-1 to 1)",
     "1: the map keeps left and right, -1: it exchanges them, as a mirror "
     "does. Near 0 it cannot be told."},
    {"vertices of X without a counterpart",
     "They are on no face or, where Y is a part of X or both overlap, on what "
     "Y lacks."},
    {"maps that were not chosen",
     "Other maps, mostly with sides exchanged, that came near and were "
     "rejected."},
    {"vertices of X with an image",
     "The others are on no face, or Y has no counterpart of them; they are "
     "gray."},
    {"vertices of Y that are images",
     "Vertices of Y that some vertex of X goes to. It is less than all where "
     "Y is finer than X, or where the map piles vertices up."},
    {"vertices of Y with a counterpart",
     "Those that the mask of the result has; the others, which X has nothing "
     "for, are gray."},
    {"distortion, mean over vertices of |ln|",
     "How much areas change around vertices: the mean size of ln(area of the "
     "image / area on X), as the layer Distortion shows it."},
    {"vertices compared", "Vertices of X whose true image is known."},
    {"without a match",
     "Vertices of X that have a true image, but none in the map."},
    {"mean / diameter of Y",
     "The mean distance along Y from the true image, where 1 is the longest "
     "way across Y. 0.01 is a hundredth of it."},
    {"largest / diameter of Y",
     "The largest distance along Y from the true image, where 1 is the longest "
     "way across Y."},
    {"mean against the mirrored truth",
     "The same mean if left and right were exchanged. When this one is the "
     "smaller, the map is mirrored."},
    {"IoU of the overlap, by area of X",
     "How well the part of X with an image is the part that truly has a "
     "counterpart: the area of both by that of either. 1 is best."},
    {"total time", "From the start of the job until its result was there."},
    {"peak memory of the process",
     "The most memory that the process held which matched, whatever else it "
     "did."},
    {"memory reserved",
     "The upper bound that was computed before the job started."},
    {"profile",
     "default: what measured best. paper: the method as it was published."},
};

}  // namespace

absl::string_view Explanation(absl::string_view label) {
  constexpr absl::string_view kWithin =
      "The part of the vertices that lie no farther than this from their true "
      "image, as a fraction of Y's diameter.";
  if (label.substr(0, 7) == "within ") return kWithin;
  const auto* const found = std::find_if(
      std::begin(kExplanations), std::end(kExplanations),
      [&](const LabelText& entry) { return entry.label == label; });
  return found == std::end(kExplanations) ? "" : found->text;
}

}  // namespace isomatch
