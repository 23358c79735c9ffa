#include "tests/bench/option_overrides.h"

#include <functional>
#include <map>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/base/status_macros.h"

namespace isomatch::bench {
namespace {

using Setter = std::function<void(double, MatchOptions*)>;

template <typename T>
Setter SetMember(T MatchOptions::*member) {
  return [member](double value, MatchOptions* options) {
    options->*member = static_cast<T>(value);
  };
}

const std::map<std::string, Setter>& Setters() {
  using O = MatchOptions;
  static const auto& setters = *new std::map<std::string, Setter>{
      {"random_seed", SetMember(&O::random_seed)},
      {"kernel_width", SetMember(&O::kernel_width)},
      {"pool_size", SetMember(&O::pool_size)},
      {"seed_points", SetMember(&O::seed_points)},
      {"seed_matches", SetMember(&O::seed_matches)},
      {"max_seeds", SetMember(&O::max_seeds)},
      {"selection", SetMember(&O::selection)},
      {"orientation_from", SetMember(&O::orientation_from)},
      {"regrow_mirrored", SetMember(&O::regrow_mirrored)},
      {"curvature_weight", SetMember(&O::curvature_weight)},
      {"curvature_radius", SetMember(&O::curvature_radius)},
      {"first_stage_matches", SetMember(&O::first_stage_matches)},
      {"candidates_from_environments",
       SetMember(&O::candidates_from_environments)},
      {"swapping", SetMember(&O::swapping)},
      {"swap_interval", SetMember(&O::swap_interval)},
      {"swap_proposals", SetMember(&O::swap_proposals)},
      {"temperature", SetMember(&O::temperature)},
      {"swap_neighbors", SetMember(&O::swap_neighbors)},
      {"relocation_neighbors", SetMember(&O::relocation_neighbors)},
      {"second_stage_fraction", SetMember(&O::second_stage_fraction)},
      {"final_swap_fraction", SetMember(&O::final_swap_fraction)},
      {"dense_from_closeness", SetMember(&O::dense_from_closeness)},
      {"zoomout_start", SetMember(&O::zoomout_start)},
      {"zoomout_end", SetMember(&O::zoomout_end)},
      {"zoomout_step", SetMember(&O::zoomout_step)},
      {"candidates", SetMember(&O::candidates)},
      {"candidate_margin", SetMember(&O::candidate_margin)},
      {"descriptor_radius", SetMember(&O::descriptor_radius)},
      {"solved_vertices", SetMember(&O::solved_vertices)},
      {"wavelet_rounds", SetMember(&O::wavelet_rounds)},
      {"alignment_rounds", SetMember(&O::alignment_rounds)},
      {"alignment_basis", SetMember(&O::alignment_basis)},
      {"alignment_stiffness_first", SetMember(&O::alignment_stiffness_first)},
      {"alignment_stiffness_last", SetMember(&O::alignment_stiffness_last)},
      {"threads", SetMember(&O::threads)},
      {"keep_first",
       [](double value, O* o) { o->selection_rounds.at(0).keep = int(value); }},
      {"keep_second",
       [](double value, O* o) { o->selection_rounds.at(1).keep = int(value); }},
  };
  return setters;
}

}  // namespace

absl::Status ApplyOverrides(const std::vector<std::string>& settings,
                            MatchOptions* options) {
  for (const std::string& setting : settings) {
    const std::size_t equals = setting.find('=');
    const auto it = Setters().find(setting.substr(0, equals));
    double value = 0;
    if (equals == std::string::npos || it == Setters().end() ||
        !absl::SimpleAtod(setting.substr(equals + 1), &value)) {
      return absl::InvalidArgumentError(absl::StrCat(
          "--set ", setting, ": expected name=number, with one of ",
          absl::StrJoin(Setters(), ", ",
                        [](std::string* out, const auto& entry) {
                          out->append(entry.first);
                        })));
    }
    it->second(value, options);
  }
  return options->Validate();
}

}  // namespace isomatch::bench
