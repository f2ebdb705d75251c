// SPDX-License-Identifier: Apache-2.0
// Layouts: the .msg files of sensor_msgs, geometry_msgs, tf2_msgs and std_msgs; ros_types.cpp repeats them.
#include "palpate/io/ros_messages.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/io/depth_file.hpp"
#include "palpate/io/message_bytes.hpp"
#include "palpate/io/png_image.hpp"

namespace palpate::io {
namespace {

RosHeader header_of(MessageReader& in) {
  RosHeader header;
  if (!in.is_cdr()) in.number<std::uint32_t>();  // seq, of ROS 1 alone
  const auto seconds = in.number<std::int32_t>();
  header.stamp_ns = std::int64_t{seconds} * 1000000000 + in.number<std::uint32_t>();
  header.frame = in.text();
  return header;
}

void put(CdrWriter& out, const RosHeader& header) {
  out.number(static_cast<std::int32_t>(header.stamp_ns / 1000000000))
      .number(static_cast<std::uint32_t>(header.stamp_ns % 1000000000));
  out.text(header.frame);
}

Vec3 vector_of(MessageReader& in) {
  Vec3 value;
  for (int axis = 0; axis < 3; ++axis) value[axis] = in.number<double>();
  return value;
}
void put(CdrWriter& out, const Vec3& value) {
  for (int axis = 0; axis < 3; ++axis) out.number(value[axis]);
}

enum PointType : std::uint8_t { int8 = 1, uint8, int16, uint16, int32, uint32, float32, float64 };

struct PointField {
  std::string name;
  std::uint32_t offset = 0;
  std::uint8_t type = 0;
  std::size_t size() const { return type == float32 || type == int32 || type == uint32 ? 4 : type == float64 ? 8 : 0; }
};

double value_of(const PointField& field, const char* raw, std::endian order) {
  switch (field.type) {
    case float64:
      return load<double>(raw, order);
    case int32:
      return load<std::int32_t>(raw, order);
    case uint32:
      return load<std::uint32_t>(raw, order);
    default:
      return static_cast<double>(load<float>(raw, order));
  }
}

/// A depth image in one of the two encodings of REP 118.
DepthImage depth_of(std::string_view data, std::size_t rows, std::size_t columns, std::size_t step,
                    const std::string& encoding, std::endian order, const MessageReader& in) {
  const bool whole = encoding == "16UC1" || encoding == "mono16";
  if (!whole && encoding != "32FC1")
    in.fail("holds an image of encoding '" + encoding.substr(0, 20) + "'; depth is 16UC1 or 32FC1");
  const std::size_t size = whole ? 2 : 4;
  if (rows == 0 || columns == 0 || rows > 20000 || columns > 20000 || step < size * columns || data.size() < step * rows)
    in.fail("holds less than its image");
  DepthImage depth(static_cast<Eigen::Index>(rows), static_cast<Eigen::Index>(columns));
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t column = 0; column < columns; ++column) {
      const char* raw = data.data() + row * step + column * size;
      const float value = whole ? static_cast<float>(load<std::uint16_t>(raw, order) * 0.001) : load<float>(raw, order);
      depth(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(column)) =
          std::isfinite(value) && value > 0 ? value : 0.0f;
    }
  }
  return depth;
}

}  // namespace

RosPointCloud decode_point_cloud(std::string_view message, const std::string& where, MessageEncoding encoding) {
  MessageReader in(message, encoding, where);
  RosPointCloud result;
  result.header = header_of(in);
  const std::size_t rows = in.number<std::uint32_t>(), columns = in.number<std::uint32_t>();
  PointField axis[3];
  for (std::size_t i = in.count(10); i > 0; --i) {
    PointField field;
    field.name = in.text();
    field.offset = in.number<std::uint32_t>();
    field.type = in.number<std::uint8_t>();
    in.number<std::uint32_t>();  // count
    for (int k = 0; k < 3; ++k) {
      if (field.name == std::string(1, static_cast<char>('x' + k))) axis[k] = field;
    }
  }
  const std::endian order = in.number<std::uint8_t>() != 0 ? std::endian::big : std::endian::little;
  const std::size_t point_step = in.number<std::uint32_t>(), row_step = in.number<std::uint32_t>();
  const std::string_view data = in.octets();
  for (const PointField& one : axis) {
    if (one.size() == 0) in.fail("has no x, y and z of 32 or 64 bits");
    if (one.offset + one.size() > point_step) in.fail("has a point that is shorter than its fields");
  }
  if (rows > 0 && (row_step < point_step * columns || row_step > data.size() / rows))
    in.fail("holds fewer points than it announces");
  Points points(static_cast<Eigen::Index>(rows * columns), 3);
  Eigen::Index kept = 0;
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t column = 0; column < columns; ++column) {
      const char* raw = data.data() + row * row_step + column * point_step;
      for (int k = 0; k < 3; ++k) points(kept, k) = value_of(axis[k], raw + axis[k].offset, order);
      if (points.row(kept).allFinite()) ++kept;
    }
  }
  result.cloud.points_m = points.topRows(kept);
  result.cloud.normals = Points(0, 3);
  return result;
}

RosImage decode_image(std::string_view message, const std::string& where, MessageEncoding encoding) {
  MessageReader in(message, encoding, where);
  RosImage result;
  result.header = header_of(in);
  const std::size_t rows = in.number<std::uint32_t>(), columns = in.number<std::uint32_t>();
  const std::string pixels = in.text();
  const std::endian order = in.number<std::uint8_t>() != 0 ? std::endian::big : std::endian::little;
  const std::size_t step = in.number<std::uint32_t>();
  result.depth_m = depth_of(in.octets(), rows, columns, step, pixels, order, in);
  return result;
}

RosImage decode_compressed_depth(std::string_view message, const std::string& where, MessageEncoding encoding) {
  MessageReader in(message, encoding, where);
  RosImage result;
  result.header = header_of(in);
  const std::string format = in.text();
  const std::string_view data = in.octets();
  if (format.find("compressedDepth") == std::string::npos)
    in.fail("is of format '" + format.substr(0, 40) + "', not compressedDepth");
  constexpr std::size_t head = 12;  // kind (4 bytes), two floats of the quantisation
  if (data.size() < head) in.fail("ends too early");
  const float a = load<float>(data.data() + 4), b = load<float>(data.data() + 8);
  const GreyImage image = parse_png(data.substr(head), where);
  result.depth_m.resize(image.height, image.width);
  const bool inverse = format.substr(0, 5) == "32FC1";
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const float units = image.pixels[i];
    float depth = static_cast<float>(image.pixels[i] * 0.001);
    if (inverse) depth = units > 0 ? a / (units - b) : 0.0f;
    result.depth_m.data()[i] = std::isfinite(depth) && depth > 0 ? depth : 0.0f;
  }
  return result;
}

RosCameraInfo decode_camera_info(std::string_view message, const std::string& where, MessageEncoding encoding) {
  MessageReader in(message, encoding, where);
  RosCameraInfo result;
  result.header = header_of(in);
  Camera& camera = result.camera;
  const auto height = in.number<std::uint32_t>(), width = in.number<std::uint32_t>();
  if (height > 20000 || width > 20000) in.fail("announces an image of more than 20000 pixels a side");
  camera.height_px = static_cast<int>(height);
  camera.width_px = static_cast<int>(width);
  const std::string model = in.text();
  for (std::size_t i = in.count(8); i > 0; --i) camera.distortion_coefficients.push_back(in.number<double>());
  double k[9];
  for (double& value : k) value = in.number<double>();
  double p[9 + 12];  // rectification, then the projection of what is rectified
  for (double& value : p) value = in.number<double>();
  const auto binning_x = in.number<std::uint32_t>(), binning_y = in.number<std::uint32_t>(), roi_x = in.number<std::uint32_t>(),
             roi_y = in.number<std::uint32_t>(), roi_height = in.number<std::uint32_t>(), roi_width = in.number<std::uint32_t>();
  in.number<std::uint8_t>();
  camera.fx_px = k[0], camera.cx_px = k[2], camera.fy_px = k[4], camera.cy_px = k[5];
  bool finite = true;
  for (const double value : k) finite = finite && std::isfinite(value);
  for (const double value : camera.distortion_coefficients) finite = finite && std::isfinite(value);
  if (!finite) in.fail("holds a number that is not finite in K or D");
  if (!std::all_of(p, p + 21, [](double value) { return std::isfinite(value); })) std::fill(p, p + 21, 0.0);  // as where P is empty
  if (!(camera.fx_px > 0 && camera.fy_px > 0)) in.fail("holds no focal length: the camera is not calibrated");
  bool bent = false;
  for (const double value : camera.distortion_coefficients) bent |= value != 0;
  if (model == "rational_polynomial" && bent && camera.distortion_coefficients.size() > 8) {  // OpenCV's thin prism and tilt
    const auto further = camera.distortion_coefficients.begin() + 8;
    if (std::any_of(further, camera.distortion_coefficients.end(), [](double value) { return value != 0; }))
      in.fail("has a thin prism or tilt in D, beyond the eight numbers of rational_polynomial that are taken; rectify the images (image_proc)");
    camera.distortion_coefficients.resize(8);
  }
  const std::size_t given = camera.distortion_coefficients.size();
  if (bent && given != (model == "rational_polynomial" ? 8 : 4) && !(model == "plumb_bob" && given == 5))
    in.fail("has " + std::to_string(given) + " numbers in D; plumb_bob has 4 or 5, rational_polynomial 8, equidistant 4");
  if (!bent)
    camera.distortion_coefficients.clear();
  else if (model == "plumb_bob")
    camera.distortion = DistortionModel::plumb_bob;
  else if (model == "rational_polynomial")
    camera.distortion = DistortionModel::rational;
  else if (model == "equidistant")
    camera.distortion = DistortionModel::fisheye;
  else
    in.fail("has an unknown distortion model '" + model.substr(0, 40) + "'");
  result.rectified = camera;
  result.rectified.distortion = DistortionModel::none;
  result.rectified.distortion_coefficients.clear();
  result.rectified.fx_px = p[9], result.rectified.cx_px = p[11], result.rectified.fy_px = p[14], result.rectified.cy_px = p[15];
  // K, D and P are of the whole sensor: what is sent is a part of it, every so manieth pixel (image_geometry's PinholeCameraModel).
  const double bin_x = std::max(binning_x, 1u), bin_y = std::max(binning_y, 1u);
  for (Camera* one : {&result.camera, &result.rectified}) {
    one->fx_px /= bin_x, one->cx_px = (one->cx_px - roi_x) / bin_x;
    one->fy_px /= bin_y, one->cy_px = (one->cy_px - roi_y) / bin_y;
    if (roi_width > 0) one->width_px = static_cast<int>(std::min(roi_width, width));
    if (roi_height > 0) one->height_px = static_cast<int>(std::min(roi_height, height));
    one->width_px /= static_cast<int>(bin_x), one->height_px /= static_cast<int>(bin_y);
  }
  return result;
}

RosJointState decode_joint_state(std::string_view message, const std::string& where, MessageEncoding encoding) {
  MessageReader in(message, encoding, where);
  RosJointState result;
  result.header = header_of(in);
  for (std::size_t i = in.count(5); i > 0; --i) result.names.push_back(in.text());
  for (std::size_t i = in.count(8); i > 0; --i) result.position.push_back(in.number<double>());
  for (int k = 0; k < 2; ++k) {  // velocity and effort
    for (std::size_t i = in.count(8); i > 0; --i) in.number<double>();
  }
  if (result.position.size() != result.names.size())
    in.fail("names " + std::to_string(result.names.size()) + " joints and gives " + std::to_string(result.position.size()) +
            " positions");
  return result;
}

RosWrench decode_wrench(std::string_view message, const std::string& where, MessageEncoding encoding) {
  MessageReader in(message, encoding, where);
  RosWrench result;
  result.header = header_of(in);
  result.force_n = vector_of(in);
  result.torque_nm = vector_of(in);
  return result;
}

std::vector<RosTransform> decode_transforms(std::string_view message, const std::string& where, MessageEncoding encoding) {
  MessageReader in(message, encoding, where);
  std::vector<RosTransform> result;
  for (std::size_t i = in.count(60); i > 0; --i) {
    RosTransform one;
    one.header = header_of(in);
    one.child = in.text();
    one.T_parent_child.translation() = vector_of(in);
    constexpr double farthest_m = 1e6;
    if (!(one.T_parent_child.translation().cwiseAbs().maxCoeff() < farthest_m)) in.fail("holds a position that is no number of metres");
    const Vec3 imaginary = vector_of(in);
    const Eigen::Quaterniond rotation(in.number<double>(), imaginary.x(), imaginary.y(), imaginary.z());
    if (!(std::abs(rotation.norm() - 1) < 0.01)) in.fail("holds a rotation whose quaternion is not of length 1");
    one.T_parent_child.linear() = rotation.normalized().toRotationMatrix();
    result.push_back(std::move(one));
  }
  return result;
}

std::string decode_string(std::string_view message, const std::string& where, MessageEncoding encoding) {
  return MessageReader(message, encoding, where).text();
}

RosHeader decode_header(std::string_view message, const std::string& where, MessageEncoding encoding) {
  MessageReader in(message, encoding, where);
  return header_of(in);
}

RosImageKind decode_image_kind(std::string_view message, const std::string& where, MessageEncoding encoding) {
  MessageReader in(message, encoding, where);
  header_of(in);
  RosImageKind kind;
  kind.rows = in.number<std::uint32_t>(), kind.columns = in.number<std::uint32_t>();
  kind.encoding = in.text();
  return kind;
}

std::string decode_compressed_format(std::string_view message, const std::string& where, MessageEncoding encoding) {
  MessageReader in(message, encoding, where);
  header_of(in);
  return in.text();
}

MaskImage decode_mask(std::string_view message, const std::string& where, MessageEncoding encoding) {
  MessageReader in(message, encoding, where);
  header_of(in);
  const std::size_t rows = in.number<std::uint32_t>(), columns = in.number<std::uint32_t>();
  const std::string pixels = in.text();
  in.number<std::uint8_t>();  // byte order
  const std::size_t step = in.number<std::uint32_t>();
  const std::string_view data = in.octets();
  if (pixels != "mono8" && pixels != "8UC1")
    in.fail("holds an image of encoding '" + pixels.substr(0, 20) + "'; a mask is mono8");
  if (rows == 0 || columns == 0 || rows > 20000 || columns > 20000 || step < columns || data.size() < step * rows)
    in.fail("holds less than its image");
  MaskImage mask(static_cast<Eigen::Index>(rows), static_cast<Eigen::Index>(columns));
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t column = 0; column < columns; ++column)
      mask(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(column)) = data[row * step + column] != 0 ? 1 : 0;
  }
  return mask;
}

std::string encode(const RosPointCloud& message) {
  CdrWriter out;
  put(out, message.header);
  const Points& points = message.cloud.points_m;
  out.number(std::uint32_t{1}).number(static_cast<std::uint32_t>(points.rows()));
  out.number(std::uint32_t{3});
  for (std::uint32_t k = 0; k < 3; ++k) {
    out.text(std::string(1, static_cast<char>('x' + k)))
        .number(4 * k)
        .number(static_cast<std::uint8_t>(float32))
        .number(std::uint32_t{1});
  }
  out.number(std::uint8_t{0}).number(std::uint32_t{12}).number(static_cast<std::uint32_t>(12 * points.rows()));
  std::string data;
  for (Eigen::Index i = 0; i < points.size(); ++i) store(data, static_cast<float>(points.data()[i]));
  out.octets(data).number(std::uint8_t{1});
  return out.take();
}

std::string encode(const RosImage& message) {
  const DepthImage& depth = message.depth_m;
  std::string whole, real;
  bool millimetres = true;
  for (Eigen::Index i = 0; i < depth.size(); ++i) {
    const float value = depth.data()[i];
    const double units = std::round(static_cast<double>(value) * 1000);
    millimetres &= units >= 0 && units <= 65535 && static_cast<float>(units * 0.001) == value;
    if (millimetres) store(whole, static_cast<std::uint16_t>(units));
    store(real, value);
  }
  CdrWriter out;
  put(out, message.header);
  out.number(static_cast<std::uint32_t>(depth.rows())).number(static_cast<std::uint32_t>(depth.cols()));
  out.text(millimetres ? "16UC1" : "32FC1").number(std::uint8_t{0});
  out.number(static_cast<std::uint32_t>(depth.cols() * (millimetres ? 2 : 4))).octets(millimetres ? whole : real);
  return out.take();
}

std::string encode(const RosHeader& header, const MaskImage& mask) {
  CdrWriter out;
  put(out, header);
  out.number(static_cast<std::uint32_t>(mask.rows())).number(static_cast<std::uint32_t>(mask.cols()));
  out.text("mono8").number(std::uint8_t{0}).number(static_cast<std::uint32_t>(mask.cols()));
  std::string data;
  for (Eigen::Index i = 0; i < mask.size(); ++i) data += mask.data()[i] != 0 ? '\xff' : '\0';
  return out.octets(data).take();
}

std::string encode(const RosCameraInfo& message) {
  const Camera& camera = message.camera;
  CdrWriter out;
  put(out, message.header);
  out.number(static_cast<std::uint32_t>(camera.height_px)).number(static_cast<std::uint32_t>(camera.width_px));
  const char* model = camera.distortion == DistortionModel::rational  ? "rational_polynomial"
                      : camera.distortion == DistortionModel::fisheye ? "equidistant"
                                                                      : "plumb_bob";
  out.text(model);
  std::vector<double> coefficients = camera.distortion_coefficients;
  if (camera.distortion == DistortionModel::none) coefficients.assign(5, 0.0);
  out.number(static_cast<std::uint32_t>(coefficients.size()));
  for (const double value : coefficients) out.number(value);
  for (const double value : {camera.fx_px, 0.0, camera.cx_px, 0.0, camera.fy_px, camera.cy_px, 0.0, 0.0, 1.0})
    out.number(value);
  for (const double value : {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0}) out.number(value);
  for (const double value : {camera.fx_px, 0.0, camera.cx_px, 0.0, 0.0, camera.fy_px, camera.cy_px, 0.0, 0.0, 0.0, 1.0, 0.0})
    out.number(value);
  for (int i = 0; i < 6; ++i) out.number(std::uint32_t{0});  // binning and region of interest
  out.number(std::uint8_t{0});
  return out.take();
}

std::string encode(const RosJointState& message) {
  CdrWriter out;
  put(out, message.header);
  out.number(static_cast<std::uint32_t>(message.names.size()));
  for (const std::string& name : message.names) out.text(name);
  out.number(static_cast<std::uint32_t>(message.position.size()));
  for (const double value : message.position) out.number(value);
  out.number(std::uint32_t{0}).number(std::uint32_t{0});
  return out.take();
}

std::string encode(const RosWrench& message) {
  CdrWriter out;
  put(out, message.header);
  put(out, message.force_n);
  put(out, message.torque_nm);
  return out.take();
}

std::string encode(const std::vector<RosTransform>& message) {
  CdrWriter out;
  out.number(static_cast<std::uint32_t>(message.size()));
  for (const RosTransform& one : message) {
    put(out, one.header);
    out.text(one.child);
    put(out, Vec3(one.T_parent_child.translation()));
    const Eigen::Quaterniond rotation(one.T_parent_child.linear());
    put(out, Vec3(rotation.vec()));
    out.number(rotation.w());
  }
  return out.take();
}

std::string encode(const std::string& message) { return CdrWriter().text(message).take(); }

}  // namespace palpate::io
