// SPDX-License-Identifier: Apache-2.0
#include "palpate/registration/views.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "palpate/core/error.hpp"

namespace palpate::registration {
namespace {

constexpr double stop_share = 0.2;  // of the answer's standard deviation; pairs that change over keep finer steps alive

struct Disc {
  Vec3 middle = Vec3::Zero(), normal = Vec3::Zero();
  double variance_m2 = 0;  ///< of the middle along the normal
};

/// The discs of one view in its own frame, found by place.
class View {
 public:
  View(const PointCloud& cloud, double cell, double sigma) : cell_(cell) {
    using Key = std::array<std::int64_t, 3>;
    std::map<Key, std::pair<Disc, int>> bins;
    for (Index i = 0; i < cloud.points_m.rows(); ++i) {
      const Vec3 p = cloud.points_m.row(i).transpose(), n = cloud.normals.row(i).transpose();
      if (!p.allFinite() || !n.allFinite()) continue;
      Key key;
      for (std::size_t k = 0; k < 3; ++k) key[k] = std::int64_t(std::floor(p[static_cast<Index>(k)] / cell));
      auto& [disc, count] = bins[key];
      disc.middle += p, disc.normal += n, ++count;
    }
    for (const auto& [key, bin] : bins) {
      const auto& [sum, count] = bin;
      if (count < 3 || sum.normal.norm() < 0.5 * count) continue;
      discs.push_back({sum.middle / count, sum.normal.normalized(), sigma * sigma / count});
      centre += discs.back().middle;
    }
    if (discs.empty()) return;
    centre /= double(discs.size());
    low_ = high_ = discs[0].middle;
    for (const Disc& d : discs) low_ = low_.cwiseMin(d.middle), high_ = high_.cwiseMax(d.middle);
    for (int k = 0; k < 3; ++k) size_[k] = static_cast<Index>((high_[k] - low_[k]) / cell_) + 1;
    grid_.resize(static_cast<std::size_t>(size_[0]) * size_[1] * size_[2]);
    for (Index i = 0; i < static_cast<Index>(discs.size()); ++i) grid_[at(place(discs[i].middle))].push_back(i);
  }

  std::vector<Disc> discs;
  Vec3 centre = Vec3::Zero();

  /// The nearest disc that faces the same way, or -1.
  Index nearest(const Vec3& p, const Vec3& normal, double reject, double least_cosine) const {
    if (discs.empty() || ((p - low_).array() < -reject).any() || ((p - high_).array() > reject).any()) return -1;
    // a disc's neighbour lies within two cells; farther ones only while poses are still poor
    const int reach = std::clamp(static_cast<int>(std::ceil(reject / cell_)), 1, 4);
    const auto c = place(p);
    Index best = -1;
    double least = reject * reject;
    for (Index x = std::max(0, c[0] - reach); x <= std::min(size_[0] - 1, c[0] + reach); ++x)
      for (Index y = std::max(0, c[1] - reach); y <= std::min(size_[1] - 1, c[1] + reach); ++y)
        for (Index z = std::max(0, c[2] - reach); z <= std::min(size_[2] - 1, c[2] + reach); ++z)
          for (const Index i : grid_[at({x, y, z})]) {
            const double d2 = (discs[i].middle - p).squaredNorm();
            if (d2 < least && discs[i].normal.dot(normal) > least_cosine) least = d2, best = i;
          }
    return best;
  }

 private:
  std::array<Index, 3> place(const Vec3& p) const {
    std::array<Index, 3> c;
    for (int k = 0; k < 3; ++k) c[k] = static_cast<Index>(std::floor((p[k] - low_[k]) / cell_));
    return c;
  }
  std::size_t at(const std::array<Index, 3>& c) const {
    return (static_cast<std::size_t>(c[0]) * size_[1] + c[1]) * size_[2] + c[2];
  }
  double cell_;
  Vec3 low_ = Vec3::Zero(), high_ = Vec3::Zero();
  std::array<Index, 3> size_{0, 0, 0};
  std::vector<std::vector<Index>> grid_;
};

struct Pair {
  Index a, b;            ///< views
  Vec3 middle, normal;   ///< half way
  double gap, variance;  ///< (a - b) along the normal
};

double robust_deviation(const std::vector<Pair>& pairs) {
  std::vector<double> v;
  v.reserve(pairs.size());
  for (const Pair& p : pairs) v.push_back(std::abs(p.gap));
  std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
  return 1.4826 * v[v.size() / 2];
}

class Joint {
 public:
  Joint(const std::vector<PointCloud>& clouds, const ViewsOptions& o) : clouds_(clouds), o_(o) {
    Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity()), high = -low;
    double sigma = 0;
    for (const PointCloud& c : clouds) {
      low = low.cwiseMin(c.points_m.colwise().minCoeff().transpose());
      high = high.cwiseMax(c.points_m.colwise().maxCoeff().transpose());
      if (c.sigma_m.size() > 0) sigma = std::max(sigma, c.sigma_m.mean());
      free_ = free_ && c.pose_std_m == 0 && c.pose_std_rad == 0;
    }
    const double diagonal = (high - low).norm();
    cell_ = o.cell_m > 0 ? o.cell_m : std::max(3 * sigma, diagonal / 60);
    for (const PointCloud& c : clouds) {
      views_.emplace_back(c, cell_, sigma > 0 ? sigma : 0.1 * cell_);
      double far = 0;
      for (const Disc& d : views_.back().discs) far = std::max(far, (d.middle - views_.back().centre).norm());
      reject_ = std::max(reject_, 3 * (c.pose_std_m + far * c.pose_std_rad));
    }
    reject_ = o.reject_m > 0 ? o.reject_m : free_ ? 0.05 * diagonal : std::min(reject_ + cell_, 0.1 * diagonal);
    pose_.assign(clouds.size(), Pose::Identity());
  }

  ViewsResult run() {
    ViewsResult out;
    const auto n = static_cast<Index>(views_.size());
    out.covariance = MatrixX::Zero(6 * n, 6 * n);
    for (int i = 0; i < o_.max_iterations; ++i) {
      auto pairs = pair_up();
      ++out.iterations;
      out.pairs = static_cast<Index>(pairs.size());
      if (pairs.size() < 6) {
        out.reason = "the views hardly overlap: check their poses, or raise reject_m";
        break;
      }
      const double robust = std::max(robust_deviation(pairs), 1e-12);
      MatrixX h = MatrixX::Zero(6 * n, 6 * n);
      VectorX g = VectorX::Zero(6 * n);
      double chi2 = 0, sum = 0, counted = 0;
      std::vector<char> touched(n, 0);
      for (const Pair& p : pairs) {
        const double u = p.gap / (4.7 * robust);
        if (std::abs(u) >= 1) continue;
        const double weight = (1 - u * u) * (1 - u * u) / p.variance;
        Eigen::Matrix<double, 6, 1> ja, jb;
        ja << (p.middle - centre(p.a)).cross(p.normal), p.normal;
        jb << -(p.middle - centre(p.b)).cross(p.normal), -p.normal;
        h.block<6, 6>(6 * p.a, 6 * p.a) += weight * ja * ja.transpose();
        h.block<6, 6>(6 * p.b, 6 * p.b) += weight * jb * jb.transpose();
        h.block<6, 6>(6 * p.a, 6 * p.b) += weight * ja * jb.transpose();
        h.block<6, 6>(6 * p.b, 6 * p.a) += weight * jb * ja.transpose();
        g.segment<6>(6 * p.a) -= weight * p.gap * ja;
        g.segment<6>(6 * p.b) -= weight * p.gap * jb;
        chi2 += weight * p.gap * p.gap, sum += p.gap * p.gap, counted += 1;
        touched[p.a] = touched[p.b] = 1;
      }
      // a disc is paired up to twice with every other view: what its noise says counts once
      const double variance = std::max(1.0, chi2 / std::max(1.0, counted)) * 2;
      h /= variance, g /= variance;
      add_priors(h, g, touched);
      const Eigen::LDLT<MatrixX> factor(h);
      const VectorX step = factor.solve(g);
      for (Index v = 0; v < n; ++v) move(v, step.segment<6>(6 * v));
      out.rms_m = std::sqrt(sum / std::max(1.0, counted));
      out.alone.clear();
      for (Index v = 0; v < n; ++v)
        if (!touched[v]) out.alone.push_back(v);
      const bool narrow = std::exchange(reject_, std::clamp(5 * robust + 1.5 * cell_, cell_, reject_)) <= 1.02 * reject_;
      if (narrow && step.dot(h * step) <= stop_share * stop_share * 6 * double(n)) {
        out.converged = out.alone.empty();
        out.reason = out.converged ? "the steps have become smaller than the answer's uncertainty"
                                   : "converged, but some views overlap with no other one and stay where they were";
        out.covariance = factor.solve(MatrixX::Identity(6 * n, 6 * n));
        if (free_) out.covariance.topRows(6).setZero(), out.covariance.leftCols(6).setZero();
        break;
      }
      out.reason = "still moving after the most iterations that were allowed";
    }
    out.correction = pose_;
    for (Index v = 0; v < n; ++v) out.centre_m.push_back(centre(v));
    return out;
  }

 private:
  Vec3 centre(Index v) const { return pose_[v] * views_[v].centre; }

  void move(Index v, const Eigen::Matrix<double, 6, 1>& d) {
    const Vec3 c = centre(v);
    Pose T = Pose::Identity();
    if (const double angle = d.head<3>().norm(); angle > 0)
      T.linear() = Eigen::AngleAxisd(angle, d.head<3>() / angle).toRotationMatrix();
    T.translation() = c - T.linear() * c + d.tail<3>();
    pose_[v] = T * pose_[v];
    pose_[v].linear() = Eigen::Quaterniond(pose_[v].linear()).normalized().toRotationMatrix();
  }

  void add_priors(MatrixX& h, VectorX& g, const std::vector<char>& touched) const {
    for (Index v = 0; v < static_cast<Index>(views_.size()); ++v) {
      const PointCloud& c = clouds_[v];
      const Eigen::AngleAxisd turned(pose_[v].linear());
      Eigen::Matrix<double, 6, 1> moved, information;
      moved << turned.angle() * turned.axis(), centre(v) - views_[v].centre;
      const double hold = 1e6 / (cell_ * cell_);
      if (free_) {
        information.setConstant(v == 0 || !touched[v] ? hold : 0);
      } else {  // a pose without a spread is known
        information.head<3>().setConstant(c.pose_std_rad > 0 ? 1 / (c.pose_std_rad * c.pose_std_rad) : hold);
        information.tail<3>().setConstant(c.pose_std_m > 0 ? 1 / (c.pose_std_m * c.pose_std_m) : hold);
      }
      h.diagonal().segment<6>(6 * v) += information;
      g.segment<6>(6 * v) -= information.cwiseProduct(moved);
    }
  }

  std::vector<Pair> pair_up() const {
    std::vector<Pair> pairs;
    const double cosine = std::cos(o_.reject_angle_rad);
    for (Index a = 0; a < static_cast<Index>(views_.size()); ++a)
      for (Index b = 0; b < static_cast<Index>(views_.size()); ++b) {
        if (a == b) continue;
        const Pose T_b_a = pose_[b].inverse() * pose_[a];
        for (const Disc& d : views_[a].discs) {
          const Vec3 p = T_b_a * d.middle, n = T_b_a.linear() * d.normal;
          const Index i = views_[b].nearest(p, n, reject_, cosine);
          if (i < 0) continue;
          const Disc& e = views_[b].discs[i];
          const Vec3 normal = (n + e.normal).normalized(), gap = p - e.middle;
          const double along = normal.dot(gap);
          if ((gap - along * normal).norm() > cell_) continue;  // beyond the other view's rim
          pairs.push_back({a, b, pose_[b] * Vec3(0.5 * (p + e.middle)), pose_[b].linear() * normal, along,
                           d.variance_m2 + e.variance_m2});
        }
      }
    return pairs;
  }

  const std::vector<PointCloud>& clouds_;
  ViewsOptions o_;
  std::vector<View> views_;
  std::vector<Pose> pose_;
  double cell_ = 0, reject_ = 0;
  bool free_ = true;
};

void require_views(bool ok, const char* field, const char* bounds) {
  if (!ok) throw Error(bounds, std::string("ViewsOptions: ") + field);
}

}  // namespace

void check(const ViewsOptions& o) {
  require_views(o.cell_m >= 0 && std::isfinite(o.cell_m), "cell_m", "must be a length, or 0");
  require_views(o.reject_m >= 0 && std::isfinite(o.reject_m), "reject_m", "must be a length, or 0");
  require_views(o.reject_angle_rad > 0 && o.reject_angle_rad <= M_PI, "reject_angle_rad", "must lie within 0 and pi");
  require_views(o.max_iterations >= 1, "max_iterations", "must be at least 1");
}

ViewsResult align_views(const std::vector<PointCloud>& clouds, const ViewsOptions& options) {
  check(options);
  if (clouds.size() < 2) throw Error("needs at least two views", "align_views: clouds");
  for (std::size_t c = 0; c < clouds.size(); ++c) {
    if (clouds[c].points_m.rows() == 0) throw Error("is empty", "align_views: cloud " + std::to_string(c));
    if (clouds[c].normals.rows() != clouds[c].points_m.rows())
      throw Error("has no normals, without which both sides of a thin part would be paired",
                  "align_views: cloud " + std::to_string(c));
  }
  return Joint(clouds, options).run();
}

}  // namespace palpate::registration
