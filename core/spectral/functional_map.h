#pragma once

#include <Eigen/Core>

#include "absl/types/span.h"
#include "core/base/nearest_columns.h"
#include "core/base/vertex_index.h"
#include "core/spectral/spectral_basis.h"

namespace isomatch {

/// Returns the k x k functional map of y_from_x: the C whose column j holds the
/// coefficients, in the first k functions of X, of the j-th function of Y
/// pulled back along the map (Ovsjanikov et al. 2012; ZoomOut, Eq. 2):
///
///   C = argmin || W^1/2 (Phi_X(S, :) C - Phi_Y(y_from_x(S), :)) ||
///
/// over the vertices S of X that have a match. W is the mass of X, so that for
/// a dense map C = Phi_X^T M_X Phi_Y(y_from_x, :). Properties: (1) the identity
/// gives I; (2) maps between congruent shapes give orthogonal C.
///
/// REQUIRES: k <= both bases' sizes, y_from_x.size() == n_X, at least one
/// match. Time O(n k^2).
Eigen::MatrixXd FunctionalMapFromVertexMap(
    const SpectralBasis& spectral_x, const SpectralBasis& spectral_y,
    absl::Span<const VertexIndex> y_from_x, int k);

/// The first k functions in single precision, the values at a vertex side by
/// side: what loops over maps read fastest.
PointColumns FunctionColumns(const SpectralBasis& spectral, int k);

/// FunctionalMapFromVertexMap of a dense map (no kNoVertex) in single
/// precision, from FunctionColumns of equally many functions and the mass of X.
Eigen::MatrixXf DenseFunctionalMap(
    const Eigen::Ref<const PointColumns>& functions_x,
    const Eigen::VectorXd& mass_x,
    const Eigen::Ref<const PointColumns>& functions_y,
    const VertexMap& y_from_x);

/// Sets `carried` to fmap_x_from_y * functions_y: Y's vertices in X's basis.
void CarryOver(const Eigen::MatrixXf& fmap_x_from_y,
               const Eigen::Ref<const PointColumns>& functions_y,
               Eigen::Ref<PointColumns> carried);

/// The same in double precision of a whole basis: NearestColumns from
/// FunctionColumns of X among these is the vertex map of a functional map, each
/// vertex x going to the y whose delta function is nearest in X's basis,
/// argmin_y |C Phi_Y(y) - Phi_X(x)| (ZoomOut, Eq. 3).
PointColumns CarriedColumns(const SpectralBasis& spectral_y,
                            const Eigen::MatrixXd& fmap_x_from_y);

}  // namespace isomatch
