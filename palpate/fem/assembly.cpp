// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/assembly.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "palpate/core/error.hpp"
#include "palpate/fem/linear_solver/large_array.hpp"
#include "palpate/fem/tetrahedron.hpp"

namespace palpate::fem {

VectorX multiply(const BlockPattern& pattern, const BlockValues& values, const Eigen::Ref<const VectorX>& x) {
  VectorX y = VectorX::Zero(x.size());
  for (Index j = 0; j < pattern.nodes; ++j) {
    const Vec3 xj = x.segment<3>(3 * j);
    Vec3 yj = Vec3::Zero();
    Index p = pattern.column_start[j];
    yj += Eigen::Map<const Mat3>(&values[9 * p]) * xj;
    for (++p; p < pattern.column_start[j + 1]; ++p) {
      const Index i = pattern.row[p];
      const Eigen::Map<const Mat3> block(&values[9 * p]);
      y.segment<3>(3 * i).noalias() += block * xj;
      yj.noalias() += block.transpose() * x.segment<3>(3 * i);
    }
    y.segment<3>(3 * j) += yj;
  }
  return y;
}

Assembly::Assembly(const TetMesh& mesh, Dilatation dilatation, std::vector<int> region) : region_(std::move(region)) {
  const Index n = static_cast<Index>(mesh.nodes_m.rows());
  const Index elements = static_cast<Index>(mesh.tetrahedra.rows());
  const int nodes = static_cast<int>(mesh.tetrahedra.cols());
  if (nodes != 4 && nodes != 10) throw Error("needs 4 or 10 columns, has " + std::to_string(nodes), "mesh.tetrahedra");
  if (elements == 0) throw Error("is empty", "mesh.tetrahedra");
  if (!mesh.nodes_m.allFinite()) throw Error("holds NaN or infinity", "mesh.nodes_m");
  if (!region_.empty()) {
    if (static_cast<Index>(region_.size()) != elements) throw Error("needs one region an element", "StaticsOptions.region");
    if (*std::min_element(region_.begin(), region_.end()) < 0) throw Error("regions count from 0", "StaticsOptions.region");
    stiffness_ = VectorX::Ones(*std::max_element(region_.begin(), region_.end()) + 1);
  }
  pattern_.nodes = nodes_ = n;
  connectivity_ = mesh.tetrahedra;
  const auto quadrature = nodes == 4 ? tet_quadrature_1() : tet_quadrature_4();
  const auto points = static_cast<Index>(quadrature.size());
  make_large_room(gradients_, static_cast<std::size_t>(elements) * points * nodes * 3);
  gradients_.resize(static_cast<std::size_t>(elements) * points * nodes * 3);
  weights_.resize(static_cast<std::size_t>(elements) * points);
  const Vec3 extent = (mesh.nodes_m.colwise().maxCoeff() - mesh.nodes_m.colwise().minCoeff()).transpose();
  const double tiny_volume = 1e-18 * std::pow(extent.maxCoeff(), 3);

  double* gradient = gradients_.data();
  for (Index e = 0; e < elements; ++e) {
    Eigen::Matrix<double, Eigen::Dynamic, 3> x(nodes, 3);
    std::array<int, 10> order{};
    std::iota(order.begin(), order.begin() + nodes, 0);
    for (int a = 0; a < nodes; ++a) {
      const Index node = mesh.tetrahedra(e, a);
      if (node < 0 || node >= n)
        throw Error("names node " + std::to_string(node) + ", the mesh has " + std::to_string(n),
                    "mesh.tetrahedra row " + std::to_string(e));
      x.row(a) = mesh.nodes_m.row(node);
    }
    std::sort(order.begin(), order.begin() + nodes,
              [&](int a, int b) { return mesh.tetrahedra(e, a) < mesh.tetrahedra(e, b); });
    for (int a = 0; a < nodes; ++a) connectivity_(e, a) = mesh.tetrahedra(e, order[a]);
    for (int a = 1; a < nodes; ++a)
      if (connectivity_(e, a) == connectivity_(e, a - 1))
        throw Error("names a node twice", "mesh.tetrahedra row " + std::to_string(e));
    for (Index q = 0; q < points; ++q) {
      const auto d = tet_shape_gradient(nodes, quadrature[q].barycentric);
      const Mat3 jacobian = x.transpose() * d;  // dx_i / dxi_j
      const double volume = jacobian.determinant() * quadrature[q].weight;
      if (!(volume > tiny_volume))
        throw Error(
            jacobian.determinant() < 0 ? "the element is inside out (swap two of its corners)" : "the element has no volume",
            "mesh.tetrahedra row " + std::to_string(e));
      const Eigen::Matrix<double, Eigen::Dynamic, 3> g = d * jacobian.inverse();
      for (int a = 0; a < nodes; ++a)
        for (int i = 0; i < 3; ++i) *gradient++ = g(order[a], i);
      weights_[static_cast<std::size_t>(e) * points + q] = volume;
      volume_ += volume;
    }
  }
  if (!region_.empty()) volumes_ = weights_;
  if (dilatation == Dilatation::averaged && nodes == 4) build_patches();
  if (dilatation == Dilatation::averaged && nodes == 10) build_pressures(mesh);
  build_pattern();
}

void Assembly::build_pattern() {
  const Index n = pattern_.nodes;
  const int nodes = static_cast<int>(connectivity_.cols());
  std::vector<std::vector<Index>> rows(n);  // with the pressures' block nodes behind the mesh's
  for (Index e = 0; e < connectivity_.rows(); ++e)
    for (int b = 0; b < nodes; ++b)
      for (int a = b + 1; a < nodes; ++a) rows[connectivity_(e, b)].push_back(connectivity_(e, a));
  for (const Patch& patch : patches_)
    for (std::size_t b = 0; b < patch.nodes.size(); ++b)
      for (std::size_t a = b + 1; a < patch.nodes.size(); ++a) rows[patch.nodes[b]].push_back(patch.nodes[a]);
  for (std::size_t k = 0; k < pressure_of_.size(); ++k) {
    const Index e = static_cast<Index>(k / 4), p = nodes_ + pressure_of_[k];
    for (int a = 0; a < nodes; ++a) rows[connectivity_(e, a)].push_back(p);
    for (std::size_t b = 4 * (k / 4); b < 4 * (k / 4) + 4; ++b)
      if (nodes_ + pressure_of_[b] > p) rows[p].push_back(nodes_ + pressure_of_[b]);
  }
  pattern_.column_start.assign(1, 0);
  for (Index j = 0; j < n; ++j) {
    auto& r = rows[j];
    std::sort(r.begin(), r.end());
    r.erase(std::unique(r.begin(), r.end()), r.end());
    pattern_.row.push_back(j);
    pattern_.row.insert(pattern_.row.end(), r.begin(), r.end());
    pattern_.column_start.push_back(static_cast<Index>(pattern_.row.size()));
  }
  const auto find_block = [this](Index i, Index j) {
    const auto begin = pattern_.row.begin() + pattern_.column_start[j],
               end = pattern_.row.begin() + pattern_.column_start[j + 1];
    return static_cast<Index>(std::lower_bound(begin, end, i) - pattern_.row.begin());
  };
  make_large_room(block_of_, static_cast<std::size_t>(connectivity_.rows()) * nodes * (nodes + 1) / 2);
  for (Index e = 0; e < connectivity_.rows(); ++e)
    for (int b = 0; b < nodes; ++b)
      for (int a = b; a < nodes; ++a) block_of_.push_back(find_block(connectivity_(e, a), connectivity_(e, b)));
  for (std::size_t k = 0; k < pressure_of_.size(); ++k) {
    const Index e = static_cast<Index>(k / 4), p = nodes_ + pressure_of_[k];
    for (int a = 0; a < nodes; ++a) pressure_block_.push_back(find_block(p, connectivity_(e, a)));
    for (std::size_t b = 4 * (k / 4); b < 4 * (k / 4) + 4; ++b)
      mass_block_.push_back(nodes_ + pressure_of_[b] >= p ? find_block(nodes_ + pressure_of_[b], p) : -1);
  }
  for (Patch& patch : patches_)
    for (std::size_t b = 0; b < patch.nodes.size(); ++b)
      for (std::size_t a = b; a < patch.nodes.size(); ++a)
        patch.blocks.push_back(find_block(patch.nodes[a], patch.nodes[b]));
}

// Calls function(element, point, gradients (N x 3), weight, displacement gradient) at every quadrature point until it
// returns false.
template <int N, int Q, typename Function>
void Assembly::for_each_point(const VectorX& u, Function&& function) const {
  using Gradients = Eigen::Matrix<double, N, 3, Eigen::RowMajor>;
  const double* gradient = gradients_.data();
  const double* weight = weights_.data();
  for (Index e = 0; e < connectivity_.rows(); ++e) {
    Eigen::Matrix<double, 3, N> ue;
    for (int a = 0; a < N; ++a) ue.col(a) = u.segment<3>(3 * connectivity_(e, a));
    for (int q = 0; q < Q; ++q, gradient += 3 * N, ++weight) {
      const Eigen::Map<const Gradients> g(gradient);
      const Mat3 h = ue * g;
      if (!function(e, q, g, *weight, h)) return;
    }
  }
}

// Fills mean_ with the averaged theta of every point. False: this law or this assembly averages nothing.
template <int N, int Q>
bool Assembly::average_dilatation(const MaterialLaw& law, const Moduli& m, const VectorX& u) const {
  prepare_regions(law, m);
  VolumetricPart part;
  if ((patches_.empty() && pressures_ == 0) || !law.volumetric_part(m, Mat3::Zero(), false, part)) return false;
  static const auto quadrature = tet_quadrature_4();
  VectorX sum = VectorX::Zero(patches_.empty() ? pressures_ : static_cast<Index>(patches_.size()));
  for_each_point<N, Q>(u, [&](Index e, int q, const auto&, double plain, const Mat3& h) {
    law.volumetric_part(of_element(m, e), h, false, part);
    const double weight = bulk_weight(e) * plain;
    if (Q == 1)
      sum(patch_of_[e]) += weight * part.theta;
    else
      for (int a = 0; a < 4; ++a)
        sum(pressure_of_[4 * static_cast<std::size_t>(e) + a]) += weight * quadrature[q].barycentric(a) * part.theta;
    return true;
  });
  mean_.resize(weights_.size());
  if (Q == 1) {
    for (std::size_t e = 0; e < mean_.size(); ++e) mean_[e] = sum(patch_of_[e]) / patches_[patch_of_[e]].volume;
  } else {
    mass_factor_.solve_in_place(sum);
    for (std::size_t k = 0; k < mean_.size(); ++k) {
      mean_[k] = 0;
      for (int a = 0; a < 4; ++a) mean_[k] += quadrature[k % Q].barycentric(a) * sum(pressure_of_[4 * (k / Q) + a]);
    }
  }
  return true;
}

template <int N, int Q>
double Assembly::energy_and_forces_of(const MaterialLaw& law, const Moduli& m, const VectorX& u, VectorX& forces,
                                      int* inverted) const {
  forces.setZero(u.size());
  double energy = 0;
  Index last_inverted = -1;
  if (inverted) *inverted = 0;
  Mat3 stress;
  VolumetricPart part;
  const bool averaged = average_dilatation<N, Q>(law, m, u);
  for_each_point<N, Q>(u, [&](Index e, int q, const auto& g, double weight, const Mat3& h) {
    const Moduli& here = of_element(m, e);
    double density = law.energy_and_stress(here, h, stress);
    if (!(density < std::numeric_limits<double>::infinity())) {
      energy = std::numeric_limits<double>::infinity();
      return false;
    }
    if (averaged) {
      law.volumetric_part(here, h, false, part);
      const double mean = mean_[static_cast<std::size_t>(e) * Q + q];
      stress += part.modulus * (mean - part.theta) * part.gradient;
      density += 0.5 * part.modulus * (mean * mean - part.theta * part.theta);
    }
    energy += weight * density;
    const Eigen::Matrix<double, 3, N> f = (weight * stress) * g.transpose();
    for (int a = 0; a < N; ++a) forces.segment<3>(3 * connectivity_(e, a)) += f.col(a);
    if (inverted && e != last_inverted && volume_change(h) <= -1) {
      ++*inverted;
      last_inverted = e;
    }
    return true;
  });
  return energy;
}

template <int N, int Q>
void Assembly::tangent_of(const MaterialLaw& law, const Moduli& m, const VectorX& u, BlockValues& blocks) const {
  make_large_room(blocks, 9 * static_cast<std::size_t>(pattern_.block_count()));
  blocks.assign(9 * static_cast<std::size_t>(pattern_.block_count()), 0.0);
  constexpr int kPairs = N * (N + 1) / 2;
  alignas(64) double local[kPairs * 9];
  const bool averaged = average_dilatation<N, Q>(law, m, u);
  std::vector<VectorX> volume_gradient(averaged ? patches_.size() : 0);
  for (std::size_t p = 0; p < volume_gradient.size(); ++p)
    volume_gradient[p].setZero(3 * static_cast<Index>(patches_[p].nodes.size()));
  VolumetricPart part;
  int point = 0;
  Mat9 c;
  for_each_point<N, Q>(u, [&](Index e, int q, const auto& g, double weight, const Mat3& h) {
    if (point == 0) std::fill(local, local + kPairs * 9, 0.0);
    const Moduli& here = of_element(m, e);
    law.tangent(here, h, c);
    if (averaged) {
      law.volumetric_part(here, h, true, part);
      c += part.modulus * (mean_[static_cast<std::size_t>(e) * Q + q] - part.theta) * part.hessian;
      c.noalias() -= part.modulus * as_vector(part.gradient) * as_vector(part.gradient).transpose();
      if (Q == 1) {
        VectorX& sum = volume_gradient[patch_of_[e]];
        for (int a = 0; a < N; ++a)
          sum.segment<3>(3 * slot_[static_cast<std::size_t>(e) * N + a]) += bulk_weight(e) * weight * part.gradient * g.row(a).transpose();
      }
    }
    double* block = local;
    for (int b = 0; b < N; ++b) {
      // D(ij, k) = sum_l C(ij, kl) G_bl, then K_ab(i, k) = sum_j G_aj D(ij, k).
      Eigen::Matrix<double, 9, 3> d;
      const Vec3 gb = weight * g.row(b).transpose();
      d.noalias() =
          gb(0) * c.template leftCols<3>() + gb(1) * c.template middleCols<3>(3) + gb(2) * c.template rightCols<3>();
      for (int a = b; a < N; ++a, block += 9)
        Eigen::Map<Mat3>(block).noalias() +=
            g(a, 0) * d.template topRows<3>() + g(a, 1) * d.template middleRows<3>(3) + g(a, 2) * d.template bottomRows<3>();
    }
    if (++point == Q) {
      point = 0;
      const Index* target = &block_of_[static_cast<std::size_t>(e) * kPairs];
      for (int p = 0; p < kPairs; ++p) {
        double* to = &blocks[9 * static_cast<std::size_t>(target[p])];
        for (int i = 0; i < 9; ++i) to[i] += local[9 * p + i];
      }
    }
    return true;
  });
  for (std::size_t p = 0; p < volume_gradient.size(); ++p) {
    const VectorX& v = volume_gradient[p];
    const double scale = (has_own_poisson() ? bulk_pa_ : part.modulus) / patches_[p].volume;
    const Index* target = patches_[p].blocks.data();
    for (Index b = 0; b < v.size(); b += 3)
      for (Index a = b; a < v.size(); a += 3)
        Eigen::Map<Mat3>(&blocks[9 * static_cast<std::size_t>(*target++)]).noalias() +=
            scale * v.segment<3>(a) * v.segment<3>(b).transpose();
  }
  if (pressures_ > 0) add_pressure_blocks<N, Q>(law, m, u, blocks);
}

// B and -M/kappa of the quasi-definite form (see the header).
template <int N, int Q>
void Assembly::add_pressure_blocks(const MaterialLaw& law, const Moduli& m, const VectorX& u, BlockValues& blocks) const {
  static const auto quadrature = tet_quadrature_4();
  VolumetricPart part;
  const bool split = law.volumetric_part(m, Mat3::Zero(), false, part);
  if (has_own_poisson()) part.modulus = bulk_pa_;
  // Nothing couples a body without a volumetric part (foam, nu = 0) to its pressures.
  const bool coupled = split && std::abs(part.modulus) > 1e-9 * m.young_pa;
  modulus_ = coupled ? part.modulus : 0;
  expected_negative_ = !coupled || part.modulus > 0 ? static_cast<int>(pressures_) : 0;
  const double idle = m.young_pa * std::cbrt(volume_);
  for (Index p = 0; p < pressures_; ++p) {
    Eigen::Map<Mat3> block(&blocks[9 * static_cast<std::size_t>(pattern_.column_start[nodes_ + p])]);
    block(1, 1) = block(2, 2) = idle;
    if (!coupled) block(0, 0) = -idle;
  }
  if (!coupled) return;
  for_each_point<N, Q>(u, [&](Index e, int q, const auto& g, double plain, const Mat3& h) {
    law.volumetric_part(of_element(m, e), h, false, part);
    const double weight = bulk_weight(e) * plain;
    const Eigen::Matrix<double, 3, N> flux = weight * part.gradient * g.transpose();
    for (int a = 0; a < 4; ++a) {
      const std::size_t k = 4 * static_cast<std::size_t>(e) + a;
      const double shape = quadrature[q].barycentric(a);
      for (int b = 0; b < N; ++b)
        Eigen::Map<Mat3>(&blocks[9 * static_cast<std::size_t>(pressure_block_[k * N + b])]).row(0) +=
            shape * flux.col(b).transpose();
      for (int b = 0; b < 4; ++b)
        if (mass_block_[4 * k + b] >= 0)
          blocks[9 * static_cast<std::size_t>(mass_block_[4 * k + b])] -=
              weight * shape * quadrature[q].barycentric(b) / modulus_;
    }
    return true;
  });
}

VectorX Assembly::multiply(const BlockValues& blocks, const VectorX& x) const {
  if (pressures_ == 0) return fem::multiply(pattern_, blocks, x);
  VectorX extended = VectorX::Zero(3 * pattern_.nodes);
  extended.head(x.size()) = x;
  VectorX y = fem::multiply(pattern_, blocks, extended);
  VectorX pressure(pressures_);
  for (Index p = 0; p < pressures_; ++p) pressure(p) = modulus_ * y(3 * (nodes_ + p));
  mass_factor_.solve_in_place(pressure);
  extended.setZero();
  for (Index p = 0; p < pressures_; ++p) extended(3 * (nodes_ + p)) = pressure(p);
  y += fem::multiply(pattern_, blocks, extended);
  return y.head(x.size());
}

template <typename Stress>
VectorX Assembly::forces_of(const VectorX& u, Stress&& stress) const {
  VectorX forces = VectorX::Zero(u.size());
  const auto add = [&](Index e, int q, const auto& g, double weight, const Mat3& h) {
    const std::size_t point = static_cast<std::size_t>(e) * (connectivity_.cols() == 4 ? 1 : 4) + q;
    const Mat3 p = weight * stress(point, h);
    for (int a = 0; a < g.rows(); ++a) forces.segment<3>(3 * connectivity_(e, a)) += p * g.row(a).transpose();
    return true;
  };
  if (connectivity_.cols() == 4)
    for_each_point<4, 1>(u, add);
  else
    for_each_point<10, 4>(u, add);
  return forces;
}

double Assembly::energy_and_forces(const MaterialLaw& law, const Moduli& m, const VectorX& u, VectorX& forces,
                                   int* inverted) const {
  return connectivity_.cols() == 4 ? energy_and_forces_of<4, 1>(law, m, u, forces, inverted)
                                   : energy_and_forces_of<10, 4>(law, m, u, forces, inverted);
}

double Assembly::largest_gradient(const VectorX& u) const {
  double largest = 0;
  const auto look = [&](Index, int, const auto&, double, const Mat3& h) {
    largest = std::max(largest, h.squaredNorm());
    return true;
  };
  if (connectivity_.cols() == 4)
    for_each_point<4, 1>(u, look);
  else
    for_each_point<10, 4>(u, look);
  return std::sqrt(largest);
}

void Assembly::tangent(const MaterialLaw& law, const Moduli& m, const VectorX& u, BlockValues& blocks) const {
  if (connectivity_.cols() == 4)
    tangent_of<4, 1>(law, m, u, blocks);
  else
    tangent_of<10, 4>(law, m, u, blocks);
}

// How averaged dilatations move as the weights do that they are averaged with, by `weight_slope` of an element's plain weight: of the
// projection M p = s, M dp = ds - dM p.
template <typename Slope>
std::vector<double> Assembly::mean_slope(const MaterialLaw& law, const Moduli& m, const VectorX& u, Slope&& weight_slope) const {
  const bool quadratic = connectivity_.cols() == 10;
  const std::size_t points = quadratic ? 4 : 1;
  VolumetricPart part;
  VectorX sum = VectorX::Zero(patches_.empty() ? pressures_ : static_cast<Index>(patches_.size()));
  const auto quadrature = tet_quadrature_4();
  const auto add = [&](Index e, int q, const auto&, double weight, const Mat3& h) {
    const double slope = weight_slope(e);
    if (slope == 0) return true;
    law.volumetric_part(of_element(m, e), h, false, part);
    const double off = slope * weight * (part.theta - mean_[static_cast<std::size_t>(e) * points + q]);
    if (!quadratic) {
      sum(patch_of_[e]) += off / patches_[patch_of_[e]].volume;
    } else {
      for (int a = 0; a < 4; ++a) sum(pressure_of_[4 * static_cast<std::size_t>(e) + a]) += quadrature[q].barycentric(a) * off;
    }
    return true;
  };
  if (quadratic)
    for_each_point<10, 4>(u, add);
  else
    for_each_point<4, 1>(u, add);
  if (quadratic) mass_factor_.solve_in_place(sum);
  std::vector<double> slopes(weights_.size(), 0);
  for (std::size_t k = 0; k < slopes.size(); ++k) {
    if (!quadratic) slopes[k] = sum(patch_of_[k]);
    for (int a = 0; quadratic && a < 4; ++a) slopes[k] += quadrature[k % 4].barycentric(a) * sum(pressure_of_[4 * (k / 4) + a]);
  }
  return slopes;
}

// `moves` says of an element whether its nu does. Where all have the same, averages stay: their weights move as one.
template <typename Moves>
VectorX Assembly::forces_d_poisson_of(const MaterialLaw& law, const Moduli& m, const VectorX& u, Moves&& moves) const {
  const bool averaged =
      connectivity_.cols() == 4 ? average_dilatation<4, 1>(law, m, u) : average_dilatation<10, 4>(law, m, u);
  const std::size_t points = connectivity_.cols() == 4 ? 1 : 4;
  std::vector<double> slopes;
  if (averaged && has_own_poisson() && bulk_pa_ > 0) {
    slopes = mean_slope(law, m, u, [&](Index e) {
      if (!moves(e)) return 0.0;
      VolumetricPart part;
      law.volumetric_part(of_element(m, e), Mat3::Zero(), false, part);
      return part.modulus_d_poisson / bulk_pa_;
    });
  }
  return forces_of(u, [&](std::size_t point, const Mat3& h) {
    const Index e = static_cast<Index>(point / points);
    const Moduli& here = of_element(m, e);
    const bool moving = moves(e);
    Mat3 stress = Mat3::Zero();
    if (moving) stress = law.stress_d_poisson(here, h);
    if (averaged) {
      VolumetricPart part;
      law.volumetric_part(here, h, false, part);
      if (moving) stress += part.modulus_d_poisson * (mean_[point] - part.theta) * part.gradient;
      if (!slopes.empty()) stress += part.modulus * slopes[point] * part.gradient;
    }
    return stress;
  });
}

VectorX Assembly::forces_d_poisson(const MaterialLaw& law, const Moduli& m, const VectorX& u) const {
  return forces_d_poisson_of(law, m, u, [this](Index e) {
    return !has_own_poisson() || std::isnan(region_poisson_(region_[static_cast<std::size_t>(e)]));
  });
}

VectorX Assembly::forces_d_region_poisson(const MaterialLaw& law, const Moduli& m, const VectorX& u, int region) const {
  if (!has_own_poisson() || std::isnan(region_poisson_(region))) return VectorX::Zero(u.size());
  return forces_d_poisson_of(law, m, u, [&](Index e) { return region_[static_cast<std::size_t>(e)] == region; });
}

VectorX Assembly::forces_d_log_stiffness(const MaterialLaw& law, const Moduli& m, const VectorX& u, int region) const {
  const bool quadratic = connectivity_.cols() == 10;
  const bool averaged = quadratic ? average_dilatation<10, 4>(law, m, u) : average_dilatation<4, 1>(law, m, u);
  const std::size_t points = quadratic ? 4 : 1;
  std::vector<double> slopes;
  if (averaged) slopes = mean_slope(law, m, u, [&](Index e) { return region_[e] == region ? bulk_weight(e) : 0.0; });
  return forces_of(u, [&](std::size_t point, const Mat3& h) {
    const Moduli& here = of_element(m, static_cast<Index>(point / points));
    Mat3 stress = Mat3::Zero();
    const bool inside = region_[point / points] == region;
    if (inside) law.energy_and_stress(here, h, stress);
    if (averaged) {
      VolumetricPart part;
      law.volumetric_part(here, h, false, part);
      stress += part.modulus * ((inside ? mean_[point] - part.theta : 0.0) + slopes[point]) * part.gradient;
    }
    return stress;
  });
}

// Further parameters never enter a volumetric part (VolumetricPart knows only its derivative to nu).
VectorX Assembly::forces_d_extra(const MaterialLaw& law, const Moduli& m, const VectorX& u, int index) const {
  prepare_regions(law, m);
  const std::size_t points = connectivity_.cols() == 4 ? 1 : 4;
  return forces_of(u, [&](std::size_t point, const Mat3& h) {
    return law.stress_d_extra(of_element(m, static_cast<Index>(point / points)), h, index);
  });
}

}  // namespace palpate::fem
