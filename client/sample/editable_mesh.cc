#include "client/sample/editable_mesh.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <unordered_map>

#include <Eigen/Geometry>

namespace isomatch {
namespace {

std::int64_t EdgeKey(int from, int to) {
  return (static_cast<std::int64_t>(from) << 32) | to;
}

Eigen::Vector3d Normal(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                       const Eigen::Vector3d& c) {
  return (b - a).cross(c - a);
}

}  // namespace

EditableMesh::EditableMesh(const TriangleMesh& mesh)
    : twin_(static_cast<std::size_t>(mesh.faces.size()), -1),
      out_(static_cast<std::size_t>(mesh.num_vertices()), -1),
      live_vertices_(mesh.num_vertices()) {
  for (Eigen::Index v = 0; v < mesh.positions.rows(); ++v) {
    points.emplace_back(mesh.positions.row(v));
  }
  std::unordered_map<std::int64_t, int> half_edge_of;
  half_edge_of.reserve(twin_.size());
  for (const VertexIndex v : mesh.faces.reshaped<Eigen::RowMajor>()) {
    out_[Index(v)] = num_half_edges();
    origin_.push_back(v);
  }
  for (int h = 0; h < num_half_edges(); ++h) {
    half_edge_of[EdgeKey(Origin(h), Tip(h))] = h;
  }
  for (int h = 0; h < num_half_edges(); ++h) {
    const auto twin = half_edge_of.find(EdgeKey(Tip(h), Origin(h)));
    assert(twin != half_edge_of.end());
    twin_[Index(h)] = twin->second;
  }
}

int EditableMesh::Valence(int vertex) const {
  int valence = 0;
  ForEachOut(vertex, [&](int) { ++valence; });
  return valence;
}

int EditableMesh::NewFace() {
  const int face = num_half_edges() / 3;
  origin_.resize(origin_.size() + 3, -1);
  twin_.resize(twin_.size() + 3, -1);
  return face;
}

void EditableMesh::SetFace(int face, int a, int b, int c) {
  const std::array<int, 3> corners = {a, b, c};
  for (int i = 0; i < 3; ++i) {
    origin_[Index(3 * face + i)] = corners[Index(i)];
    out_[Index(corners[Index(i)])] = 3 * face + i;
  }
}

void EditableMesh::Link(int h, int other) {
  twin_[Index(h)] = other;
  twin_[Index(other)] = h;
}

// Around the edge a-b, c is the corner of h's face, d that of its twin's:
//
//        c                 c                 c
//      /   \             / | \             / | \.
//     a --- b   Split   a -m- b   Flip    a  |  b
//      \   /             \ | /             \ | /
//        d                 d                 d

int EditableMesh::Split(int h, const Eigen::Vector3d& point) {
  const int t = Twin(h);
  const int a = Origin(h), b = Tip(h), c = Opposite(h), d = Opposite(t);
  const int out_bc = Twin(Next(h)), out_ca = Twin(Previous(h));
  const int out_ad = Twin(Next(t)), out_db = Twin(Previous(t));
  const int m = end_vertex();
  points.push_back(point);
  out_.push_back(-1);
  ++live_vertices_;
  const int amc = h / 3, mad = t / 3;
  const int mbc = NewFace(), bmd = NewFace();
  SetFace(amc, a, m, c);
  SetFace(mad, m, a, d);
  SetFace(mbc, m, b, c);
  SetFace(bmd, b, m, d);
  Link(3 * amc, 3 * mad);
  Link(3 * amc + 1, 3 * mbc + 2);
  Link(3 * amc + 2, out_ca);
  Link(3 * mad + 1, out_ad);
  Link(3 * mad + 2, 3 * bmd + 1);
  Link(3 * mbc, 3 * bmd);
  Link(3 * mbc + 1, out_bc);
  Link(3 * bmd + 2, out_db);
  return m;
}

bool EditableMesh::CanFlip(int h) const {
  const int c = Opposite(h), d = Opposite(Twin(h));
  bool is_new = c != d;
  ForEachOut(c, [&](int out) { is_new = is_new && Tip(out) != d; });
  return is_new;
}

void EditableMesh::Flip(int h) {
  const int t = Twin(h);
  const int a = Origin(h), b = Tip(h), c = Opposite(h), d = Opposite(t);
  const int out_bc = Twin(Next(h)), out_ca = Twin(Previous(h));
  const int out_ad = Twin(Next(t)), out_db = Twin(Previous(t));
  const int adc = h / 3, dbc = t / 3;
  SetFace(adc, a, d, c);
  SetFace(dbc, d, b, c);
  Link(3 * adc, out_ad);
  Link(3 * adc + 1, 3 * dbc + 2);
  Link(3 * adc + 2, out_ca);
  Link(3 * dbc, out_db);
  Link(3 * dbc + 1, out_bc);
}

bool EditableMesh::TurnsNoFace(int h) const {
  const int a = Origin(h), b = Tip(h);
  bool turns_none = true;
  ForEachOut(a, [&](int out) {
    if (Tip(out) == b || Opposite(out) == b) return;
    const Eigen::Vector3d before =
        Normal(Point(a), Point(Tip(out)), Point(Opposite(out)));
    const Eigen::Vector3d after =
        Normal(Point(b), Point(Tip(out)), Point(Opposite(out)));
    turns_none =
        turns_none && before.dot(after) > 0.5 * before.norm() * after.norm();
  });
  return turns_none;
}

bool EditableMesh::CanCollapse(int h) const {
  const int a = Origin(h), b = Tip(h);
  if (Valence(Opposite(h)) <= 3 || Valence(Opposite(Twin(h))) <= 3) {
    return false;
  }
  int common = 0;
  ForEachOut(a, [&](int of_a) {
    ForEachOut(b, [&](int of_b) { common += Tip(of_a) == Tip(of_b); });
  });
  return common == 2 && TurnsNoFace(h);
}

void EditableMesh::Collapse(int h) {
  const int t = Twin(h);
  const int a = Origin(h), b = Tip(h), c = Opposite(h), d = Opposite(t);
  const int out_bc = Twin(Next(h)), out_ca = Twin(Previous(h));
  const int out_ad = Twin(Next(t)), out_db = Twin(Previous(t));
  std::vector<int> leaving;
  ForEachOut(a, [&](int out) { leaving.push_back(out); });
  for (const int out : leaving) origin_[Index(out)] = b;
  for (const int face : {h / 3, t / 3}) {
    for (int i = 0; i < 3; ++i) origin_[Index(3 * face + i)] = -1;
  }
  Link(out_bc, out_ca);
  Link(out_ad, out_db);
  out_[Index(a)] = -1;
  out_[Index(b)] = out_ca;
  out_[Index(c)] = out_bc;
  out_[Index(d)] = out_ad;
  --live_vertices_;
}

TriangleMesh EditableMesh::ToMesh() const {
  std::vector<VertexIndex> number(points.size(), kNoVertex);
  TriangleMesh mesh;
  mesh.positions.resize(live_vertices_, 3);
  VertexIndex next = 0;
  for (int v = 0; v < end_vertex(); ++v) {
    if (!is_live_vertex(v)) continue;
    mesh.positions.row(next) = Point(v);
    number[Index(v)] = next++;
  }
  // Euler: a closed surface of genus 0 has 2 n - 4 faces; count all the same.
  const auto live = std::count_if(origin_.begin(), origin_.end(),
                                  [](int v) { return v >= 0; });
  mesh.faces.resize(live / 3, 3);
  Eigen::Index f = 0;
  for (int h = 0; h < num_half_edges(); h += 3) {
    if (!is_live(h)) continue;
    mesh.faces.row(f++) << number[Index(Origin(h))],
        number[Index(Origin(h + 1))], number[Index(Origin(h + 2))];
  }
  return mesh;
}

}  // namespace isomatch
