// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/reach.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <random>

#include "palpate/core/error.hpp"

namespace palpate::sensing {
namespace {

constexpr double pi = 3.14159265358979323846;

class Search {
 public:
  Search(const Kinematics& kinematics, Index link, const Pose& target, const ReachOptions& options)
      : kinematics_(kinematics), link_(link), target_(target), options_(options) {
    for (const std::string& name : kinematics.free_joints())
      for (const RobotJoint& joint : kinematics.robot().joints)
        if (joint.name == name) {
          const bool turns = joint.kind == RobotJoint::Kind::continuous;
          lower_.push_back(turns ? -1e9 : joint.lower);
          upper_.push_back(turns ? 1e9 : joint.upper);
        }
  }

  bool solve(std::vector<double>& q) const {
    double damping = 1e-3;
    Vec6 error = miss(q);
    for (int i = 0; i < options_.max_iterations; ++i) {
      if (error.head<3>().norm() < options_.position_tolerance_m && error.tail<3>().norm() < options_.angle_tolerance_rad)
        return true;
      Eigen::Matrix<double, 6, Eigen::Dynamic> slope(6, Eigen::Index(q.size()));
      for (std::size_t k = 0; k < q.size(); ++k) {
        std::vector<double> moved = q;
        const double h = 1e-6;
        moved[k] += h;
        slope.col(Eigen::Index(k)) = (miss(moved) - error) / h;
      }
      const MatrixX normal = slope.transpose() * slope;
      const VectorX step =
          (normal + damping * MatrixX::Identity(normal.rows(), normal.cols())).ldlt().solve(-slope.transpose() * error);
      std::vector<double> next = q;
      for (std::size_t k = 0; k < q.size(); ++k)
        next[k] = std::clamp(q[k] + std::clamp(step(Eigen::Index(k)), -0.3, 0.3), lower_[k], upper_[k]);
      const Vec6 next_error = miss(next);
      if (next_error.squaredNorm() < error.squaredNorm()) {
        q = next;
        error = next_error;
        damping = std::max(damping * 0.3, 1e-12);
      } else {
        damping *= 10;
        if (damping > 1e6) return false;
      }
    }
    return false;
  }

  std::vector<double> drawn(std::mt19937_64& random) const {
    std::vector<double> q;
    for (std::size_t k = 0; k < lower_.size(); ++k) {
      const double low = std::max(lower_[k], -pi), high = std::min(upper_[k], pi);
      q.push_back(low + (high - low) * static_cast<double>(random() >> 11) * 0x1.0p-53);
    }
    return q;
  }

 private:
  Vec6 miss(const std::vector<double>& q) const {
    const Pose pose = kinematics_.link_poses(kinematics_.free_joints(), q)[std::size_t(link_)] * options_.T_link_tip;
    Vec6 error;
    error.head<3>() = target_.translation() - pose.translation();
    if (options_.any_roll) {  // only the axis must agree: the rotation that takes one axis to the other
      const Vec3 have = pose.linear().col(2), want = target_.linear().col(2);
      const Vec3 turn = have.cross(want);
      const double sine = turn.norm(), angle = std::atan2(sine, have.dot(want));
      error.tail<3>() =
          sine > 1e-12 ? Vec3(angle / sine * turn) : Vec3(angle > 1 ? Vec3(angle * pose.linear().col(0)) : Vec3::Zero());
    } else {
      const Eigen::AngleAxisd turn(target_.linear() * pose.linear().transpose());
      error.tail<3>() = turn.angle() * turn.axis();
    }
    return error;
  }

  const Kinematics& kinematics_;
  Index link_;
  const Pose& target_;
  const ReachOptions& options_;
  std::vector<double> lower_, upper_;
};

}  // namespace

std::optional<std::vector<double>> reach(const Kinematics& kinematics, Index link, const Pose& T_root_tip,
                                         const std::vector<double>& start, const ReachOptions& options) {
  if (start.size() != kinematics.free_joints().size()) throw Error("needs one value a free joint", "start");
  const Search search(kinematics, link, T_root_tip, options);
  std::mt19937_64 random(20100918);
  std::vector<double> q = start;
  for (int attempt = 0; attempt < options.starts; ++attempt) {
    if (attempt > 0) q = search.drawn(random);
    if (search.solve(q) && (!options.accept || options.accept(q))) return q;
  }
  return std::nullopt;
}

}  // namespace palpate::sensing
