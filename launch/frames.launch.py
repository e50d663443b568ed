# Copyright 2026 ride_estimation contributors
"""Publish the frames of a vehicle file for RViz: ``ros2 launch ride_estimation frames.launch.py vehicle:=my_cab.yaml``."""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch_ros.actions import Node

from ride_estimation.estimation.common.geometry import geometry_of
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.vehicles.published_frames import published_frames


def publishers(context: LaunchContext) -> list[Node]:
    """Return one static transform publisher per frame of the vehicle."""
    given = context.launch_configurations
    vehicle = load_vehicle(given["vehicle"])
    nodes = []
    names = {"cg_frame": given["cg_frame"], "mount_prefix": given["mount_frame_prefix"]}
    for frame in published_frames(vehicle, geometry_of(vehicle).body.name, **names):
        pose = zip(("x", "y", "z", "qx", "qy", "qz", "qw"), (*frame.position, *frame.quaternion), strict=True)
        arguments = [word for name, value in pose for word in (f"--{name}", str(float(value)))]
        arguments += ["--frame-id", given["vehicle_frame"], "--child-frame-id", frame.name]
        nodes.append(Node(package="tf2_ros", executable="static_transform_publisher", arguments=arguments))
    return nodes


def generate_launch_description() -> LaunchDescription:
    """Return the publishers of all frames."""
    return LaunchDescription(
        [
            DeclareLaunchArgument("vehicle", default_value="truck_cab", description="vehicle file, or the name of a bundled one"),
            DeclareLaunchArgument("vehicle_frame", default_value="cab_link", description="frame of the vehicle file"),
            DeclareLaunchArgument("cg_frame", default_value="cab_cg", description="frame at the centre of gravity"),
            DeclareLaunchArgument(
                "mount_frame_prefix", default_value="mount_", description="frame of a mount is this and the mount's name"
            ),
            OpaqueFunction(function=publishers),
        ]
    )
