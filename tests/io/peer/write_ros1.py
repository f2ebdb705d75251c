# SPDX-License-Identifier: Apache-2.0
# A small ROS 1 bag of every type that palpate reads, written by ROS itself: write_ros1.py FILE none|bz2|lz4
# Needs Debian's python3-rosbag, python3-sensor-msgs, python3-tf2-msgs.
import io
import struct
import sys
import zlib

import genpy
import rosbag
from geometry_msgs.msg import TransformStamped, WrenchStamped
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, JointState, PointCloud2, PointField
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage


def png16(width, height, values):
    rows = b"".join(b"\0" + struct.pack(">%dH" % width, *values[r * width:(r + 1) * width]) for r in range(height))

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 16, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def main():
    with rosbag.Bag(sys.argv[1], "w", compression=sys.argv[2], chunk_threshold=1000) as bag:
        for i in (1, 0, 2):  # not in the order of time
            stamp = genpy.Time(100 + i, 5)

            def put(topic, message, frame):
                if hasattr(message, "header"):
                    message.header.stamp = stamp
                    message.header.frame_id = frame
                bag.write(topic, message, stamp)

            wrench = WrenchStamped()
            wrench.wrench.force.x, wrench.wrench.force.y, wrench.wrench.force.z = i, 0.5, -2
            wrench.wrench.torque.z = 0.25
            put("/wrench", wrench, "sensor")
            joints = JointState(name=["a", "elbow"], position=[0.1, 0.2 + i], velocity=[], effort=[1.0, 2.0])
            put("/joint_states", joints, "")
            one = TransformStamped()
            one.header.stamp, one.header.frame_id, one.child_frame_id = stamp, "base", "tip"
            one.transform.translation.x = 0.1 * i
            one.transform.rotation.w, one.transform.rotation.z = 0.6, 0.8
            put("/tf", TFMessage(transforms=[one]), "")
            depth = [1000 + 10 * i + k for k in range(6)]
            put("/depth", Image(height=2, width=3, encoding="16UC1", step=6, data=struct.pack("<6H", *depth)), "camera")
            real = [1.25 + i + k for k in range(6)]
            put("/depth_real", Image(height=2, width=3, encoding="32FC1", is_bigendian=1, step=12,
                                     data=struct.pack(">6f", *real)), "camera")
            packed = struct.pack("<Iff", 0, 0, 0) + png16(3, 2, depth)
            put("/depth/compressedDepth", CompressedImage(format="16UC1; compressedDepth png", data=packed), "camera")
            put("/info", CameraInfo(height=2, width=3, distortion_model="plumb_bob", D=[0.1, 0, 0, 0, 0],
                                    K=[500, 0, 1.5, 0, 501, 1, 0, 0, 1], R=[0] * 9, P=[0] * 12), "camera")
            fields = [PointField(name=n, offset=8 * k, datatype=PointField.FLOAT64, count=1) for k, n in enumerate("xyz")]
            points = [0.1, 0.2, 0.3 + i, float("nan"), 0, 0]
            put("/points", PointCloud2(height=1, width=2, fields=fields, point_step=24, row_step=48,
                                       data=struct.pack("<6d", *points)), "camera")
            put("/robot_description", String(data="<robot/>"), "")


main()
