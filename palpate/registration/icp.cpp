// SPDX-License-Identifier: Apache-2.0
#include "palpate/registration/icp.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

#include "palpate/core/cross_matrix.hpp"
#include "palpate/core/error.hpp"

namespace palpate::registration {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;

struct Pairing {
  Vec3 point, normal, gap;  ///< point in the surface's frame, surface normal, point - closest
  double weight = 0;        ///< 1 / sigma^2, or 1
  double miss = 0;          ///< length of the residual in the metric, times sqrt(weight)
};

/// The normal equations about the centroid, where rotation and translation hardly mix.
struct Normal {
  Matrix6 h = Matrix6::Zero();
  Vector6 g = Vector6::Zero();
  Vec3 centre = Vec3::Zero();
  double sum = 0, weights = 0, size = 0;
  Index counting = 0;
};

Pose small_motion(const Vector6& d) {
  const double angle = d.head<3>().norm();
  Pose T = Pose::Identity();
  if (angle > 0) T.linear() = Eigen::AngleAxisd(angle, d.head<3>() / angle).toRotationMatrix();
  T.translation() = d.tail<3>();
  return T;
}

double quantile_of_misses(const std::vector<Pairing>& pairs, double share) {
  std::vector<double> v;
  v.reserve(pairs.size());
  for (const Pairing& p : pairs) v.push_back(p.miss);
  const auto at = std::min(v.size() - 1, static_cast<std::size_t>(share * double(v.size())));
  std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(at), v.end());
  return v[at];
}

class Aligner {
 public:
  Aligner(const PointCloud& cloud, const geometry::TriangleTree& surface, const Pose& start, const IcpOptions& options)
      : cloud_(cloud), surface_(surface), o_(options), T_(start), hint_(cloud.points_m.rows(), -1) {}

  IcpResult run() {
    IcpResult out;
    // far from the answer a few thousand points say as much as all: only the last steps take every point
    const Index stride = std::max<Index>(1, static_cast<Index>(cloud_.points_m.rows()) / 3000);
    if (stride > 1 || o_.sensor_m) iterate(stride, 5 * o_.stop_share, out);
    along_rays_ = o_.sensor_m.has_value();
    iterate(1, along_rays_ ? 4 * o_.stop_share : o_.stop_share,
            out);  // rays that change over at rims keep finer steps alive
    out.T_surface_cloud = T_;
    return out;
  }

 private:
  /// Does the cloud say how good its points are? One common value of 0 says nothing.
  bool absolute() const { return cloud_.sigma_m.size() > 0 && cloud_.sigma_m[0] > 0; }

  geometry::ClosestPoint on_ray(const Vec3& point) const {
    const Vec3 d = (point - T_ * *o_.sensor_m).normalized();
    geometry::ClosestPoint out;
    const Vec3 from = point - o_.reject_m * d;
    if (const auto hit = surface_.cast(from, d, 2 * o_.reject_m)) {
      out.triangle = hit->triangle;
      out.point_m = from + hit->range_m * d;
      out.squared_distance_m2 = (out.point_m - point).squaredNorm();
    }
    return out;
  }

  bool normal_fits(Index i, const Vec3& normal) const {
    if (cloud_.normals.rows() != cloud_.points_m.rows()) return true;
    return normal.dot(T_.linear() * cloud_.normals.row(i).transpose()) > std::cos(o_.reject_angle_rad);
  }

  std::vector<Pairing> pair_up(Index stride) {
    std::vector<Pairing> pairs;
    const auto n = static_cast<Index>(cloud_.points_m.rows());
    const bool each = cloud_.sigma_m.size() == n, common = !each && absolute();
    const double same = common ? 1 / (cloud_.sigma_m[0] * cloud_.sigma_m[0]) : 1;
    pairs.reserve(n / stride + 1);
    const TriMesh& m = surface_.mesh();
    for (Index i = 0; i < n; i += stride) {
      Pairing p;
      p.point = T_ * Vec3(cloud_.points_m.row(i).transpose());
      const auto c = along_rays_ ? on_ray(p.point) : surface_.closest(p.point, hint_[i]);
      if (c.triangle < 0 || c.squared_distance_m2 > o_.reject_m * o_.reject_m) continue;
      hint_[i] = c.triangle;
      const Vec3 a = m.vertices_m.row(m.triangles(c.triangle, 0)).transpose(),
                 b = m.vertices_m.row(m.triangles(c.triangle, 1)).transpose(),
                 d = m.vertices_m.row(m.triangles(c.triangle, 2)).transpose();
      p.normal = (b - a).cross(d - a);
      const double length = p.normal.norm();
      if (!(length > 0)) continue;
      p.normal /= length;
      if (!normal_fits(i, p.normal)) continue;
      double cosine = 1;  // of noise along the ray, along the normal
      if (along_rays_) cosine = std::abs(p.normal.dot((p.point - T_ * *o_.sensor_m).normalized()));
      if (cosine < 0.2) continue;
      p.gap = p.point - c.point_m;
      p.weight = each ? 1 / (cloud_.sigma_m[i] * cloud_.sigma_m[i]) : same;
      p.weight /= cosine * cosine;
      const double miss = o_.metric == IcpMetric::point_to_plane ? std::abs(p.normal.dot(p.gap)) : p.gap.norm();
      p.miss = miss * std::sqrt(p.weight);
      pairs.push_back(p);
    }
    if (o_.trim < 1 && !pairs.empty()) {
      const double limit = quantile_of_misses(pairs, o_.trim);
      std::erase_if(pairs, [&](const Pairing& p) { return p.miss > limit; });
    }
    if (o_.tukey > 0 && !pairs.empty()) {
      const double limit = o_.tukey * std::max(1.4826 * quantile_of_misses(pairs, 0.5), 1e-12);
      for (Pairing& p : pairs) {
        const double u = p.miss / limit;
        p.weight *= u < 1 ? (1 - u * u) * (1 - u * u) : 0;
      }
    }
    return pairs;
  }

  Normal normal_equations(const std::vector<Pairing>& pairs) const {
    Normal n;
    for (const Pairing& p : pairs) n.weights += p.weight, n.centre += p.weight * p.point, n.counting += p.weight > 0;
    if (n.counting < 6) return n;
    n.centre /= n.weights;
    for (const Pairing& p : pairs) {
      const Vec3 arm = p.point - n.centre;
      n.size += p.weight * arm.squaredNorm();
      if (o_.metric == IcpMetric::point_to_plane) {
        Vector6 j;
        j << arm.cross(p.normal), p.normal;
        const double r = p.normal.dot(p.gap);
        n.h += p.weight * j * j.transpose();
        n.g -= p.weight * r * j;
        n.sum += p.weight * r * r;
      } else {
        Eigen::Matrix<double, 3, 6> j;
        j << -cross_matrix(arm), Mat3::Identity();
        n.h += p.weight * j.transpose() * j;
        n.g -= p.weight * j.transpose() * p.gap;
        n.sum += p.weight * p.gap.squaredNorm();
      }
    }
    n.size = std::max(std::sqrt(n.size / n.weights), 1e-12);
    return n;
  }

  void iterate(Index stride, double stop_share, IcpResult& out) {
    out.converged = false;
    for (int i = 0; i < o_.max_iterations; ++i) {
      const Normal n = normal_equations(pair_up(stride));
      out.pairs = n.counting;
      if (n.counting < 6) {
        out.reason = "fewer than six points lie near the surface: check the start pose, or raise reject_m";
        return;
      }
      // in units of the cloud's size, so that rotations and translations can be compared
      Vector6 scale;
      scale << Vec3::Constant(1 / n.size), Vec3::Ones();
      const Eigen::SelfAdjointEigenSolver<Matrix6> eigen(scale.asDiagonal() * n.h * scale.asDiagonal());
      Matrix6 inverse = Matrix6::Zero();
      out.open_directions = 0;
      for (int k = 0; k < 6; ++k) {
        if (eigen.eigenvalues()[k] > 1e-7 * eigen.eigenvalues()[5])
          inverse += eigen.eigenvectors().col(k) * eigen.eigenvectors().col(k).transpose() / eigen.eigenvalues()[k];
        else
          ++out.open_directions;
      }
      inverse = scale.asDiagonal() * inverse * scale.asDiagonal();
      const Vector6 step = inverse * n.g;
      const double dof = std::max(1.0, double(n.counting) * (o_.metric == IcpMetric::point_to_plane ? 1 : 3) - 6);
      const double variance = absolute() ? std::max(1.0, n.sum / dof) : n.sum / dof;
      T_ = Pose(Eigen::Translation3d(n.centre)) * small_motion(step) * Pose(Eigen::Translation3d(-n.centre)) * T_;
      T_.linear() = Eigen::Quaterniond(T_.linear()).normalized().toRotationMatrix();

      // from the centroid to the frame's origin: (w, t - w x centre)
      Matrix6 shift = Matrix6::Identity();
      shift.bottomLeftCorner<3, 3>() = cross_matrix(n.centre);
      out.covariance = variance * shift * inverse * shift.transpose();
      out.rms_m = std::sqrt(n.sum / n.weights);
      out.sigma_m = std::sqrt(variance * double(n.counting) / n.weights);
      ++out.iterations;
      // in units of the answer's own standard deviation, or nothing left to gain in double
      const double move2 = step.dot(n.h * step);
      if (move2 <= 6 * stop_share * stop_share * variance || move2 <= 1e-24 * n.size * n.size * n.weights) {
        out.converged = true;
        out.reason = out.open_directions == 0 ? "the steps have become smaller than the answer's uncertainty"
                                              : "converged, but the surface leaves directions open along which it may slide";
        return;
      }
    }
    out.reason = "still moving after the most iterations that were allowed";
  }

  const PointCloud& cloud_;
  const geometry::TriangleTree& surface_;
  IcpOptions o_;
  Pose T_;
  std::vector<Index> hint_;
  bool along_rays_ = false;
};

void require(bool ok, const char* field, const char* bounds) {
  if (!ok) throw Error(bounds, std::string("IcpOptions: ") + field);
}

}  // namespace

void check(const IcpOptions& o) {
  require(o.reject_m > 0, "reject_m", "must be above 0");
  require(o.trim >= 0.1 && o.trim <= 1, "trim", "must lie within 0.1 and 1");
  require(o.tukey == 0 || o.tukey >= 2, "tukey", "must be 0 or at least 2");
  require(o.reject_angle_rad > 0 && o.reject_angle_rad <= M_PI, "reject_angle_rad", "must lie within 0 and pi");
  require(o.max_iterations >= 1, "max_iterations", "must be at least 1");
  require(o.stop_share > 0 && o.stop_share <= 1, "stop_share", "must lie within 0 and 1");
}

IcpResult align(const PointCloud& cloud, const geometry::TriangleTree& surface, const Pose& start,
                const IcpOptions& options) {
  check(options);
  if (cloud.points_m.rows() < 6) throw Error("fewer than six points", "align: cloud");
  if (!cloud.points_m.allFinite()) throw Error("a point is not finite", "align: cloud");
  if (cloud.sigma_m.size() > 1 && cloud.sigma_m.size() != cloud.points_m.rows())
    throw Error("needs one value, or one for each point", "align: cloud.sigma_m");
  const double least = cloud.sigma_m.size() > 0 ? cloud.sigma_m.minCoeff() : 1;
  if (!(least >= 0) || (cloud.sigma_m.size() > 1 && least == 0))
    throw Error("a standard deviation is not above 0", "align: cloud.sigma_m");
  return Aligner(cloud, surface, start, options).run();
}

}  // namespace palpate::registration
