# Copyright 2026 ride_estimation contributors
"""Start the estimator beside a logging stack: ``ros2 launch ride_estimation estimation.launch.py vehicle:=my_cab.yaml``."""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode
from launch_ros.parameter_descriptions import ParameterValue

from ride_estimation.resources import shared_path


def generate_launch_description() -> LaunchDescription:
    """Return the estimator node with its arguments."""
    defaults: Path = shared_path("config", "nodes", "estimator.yaml")
    return LaunchDescription(
        [
            DeclareLaunchArgument("config", default_value=str(defaults), description="ROS parameter file of the estimator"),
            DeclareLaunchArgument("vehicle", default_value="truck_cab", description="vehicle file, or the name of a bundled one"),
            DeclareLaunchArgument("namespace", default_value="ride", description="namespace of node and outputs"),
            DeclareLaunchArgument("use_sim_time", default_value="false", description="follow /clock"),
            DeclareLaunchArgument("log_level", default_value="info", description="debug, info, warn or error"),
            LifecycleNode(
                package="ride_estimation",
                executable="estimator_node",
                name="estimator",
                namespace=LaunchConfiguration("namespace"),
                output="screen",
                parameters=[
                    LaunchConfiguration("config"),
                    {
                        "vehicle": ParameterValue(LaunchConfiguration("vehicle"), value_type=str),
                        "use_sim_time": ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool),
                    },
                ],
                arguments=["--ros-args", "--log-level", LaunchConfiguration("log_level")],
            ),
        ]
    )
